# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The only part of texture_exploration that imports ROS, in addition to its nodes."""

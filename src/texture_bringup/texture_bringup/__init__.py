# SPDX-License-Identifier: Apache-2.0
"""Launch files, configuration, the stand-alone launcher and the texture command."""

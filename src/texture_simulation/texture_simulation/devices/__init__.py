# SPDX-License-Identifier: Apache-2.0
"""Devices emulated where the real ones are reached."""

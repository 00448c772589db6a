# SPDX-License-Identifier: Apache-2.0
"""Simulated surfaces, contact and sensors, and devices emulated at the wire."""

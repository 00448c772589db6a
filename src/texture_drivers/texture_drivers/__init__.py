# SPDX-License-Identifier: Apache-2.0
"""Drivers of tactile sensors: bytes to numbers to TactileSignal."""

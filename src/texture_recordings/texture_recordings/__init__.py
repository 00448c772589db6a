# SPDX-License-Identifier: Apache-2.0
"""Bags and labelled slides: recording, reading, replaying, importing and segmenting."""

# SPDX-License-Identifier: Apache-2.0
"""Bags and data sets, experiments, metrics and charts."""

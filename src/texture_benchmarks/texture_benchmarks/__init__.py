# SPDX-License-Identifier: Apache-2.0
"""Benchmarks, rebuilt experiments of papers and endurance runs."""

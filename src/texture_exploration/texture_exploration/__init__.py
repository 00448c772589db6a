# SPDX-License-Identifier: Apache-2.0
"""Exploratory motions, the robots that perform them, and their safety."""

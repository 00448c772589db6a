# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture`, one module each."""

# SPDX-License-Identifier: Apache-2.0
"""Windows of a tactile signal and the features that describe them."""

# SPDX-License-Identifier: Apache-2.0
"""Everything that is of the five papers: their features, learners and experiments."""

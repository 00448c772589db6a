# SPDX-License-Identifier: Apache-2.0
"""Recipes, learners and evidence: from features to texture and roughness."""

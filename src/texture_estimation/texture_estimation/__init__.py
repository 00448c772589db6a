"""Recipes, learners and evidence: from features to texture and roughness."""

"""Roughness as people grade it: heads, recipes, models and evidence."""

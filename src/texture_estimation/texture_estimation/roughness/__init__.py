"""Roughness as people grade it: regressors, recipes, models and evidence."""

"""Genetic optimisation of recipes: what is varied, how it is judged, and the search itself."""

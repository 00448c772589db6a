"""Benchmark: the recipe with a discriminant of its own for the first window of a slide."""

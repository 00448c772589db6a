"""Benchmark: all recipes side by side."""

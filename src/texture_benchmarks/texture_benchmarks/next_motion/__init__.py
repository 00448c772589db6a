"""Benchmark: choice of the next exploration."""

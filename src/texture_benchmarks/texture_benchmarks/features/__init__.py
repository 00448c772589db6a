"""Benchmark: computing time of each feature."""

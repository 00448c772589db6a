"""Benchmark: features, numbers, units and channels."""

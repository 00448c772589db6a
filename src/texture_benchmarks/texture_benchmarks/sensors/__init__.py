"""Benchmark: faults on every sensor's line."""

"""Benchmark: start and end of sliding."""

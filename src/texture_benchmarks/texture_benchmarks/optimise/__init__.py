"""Benchmark: genetic searches."""

"""Benchmark: simulated friction."""

"""Benchmark: time from window to estimate."""

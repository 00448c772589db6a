"""Benchmark: time from window to grade."""

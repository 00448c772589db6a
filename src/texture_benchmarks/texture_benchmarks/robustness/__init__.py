"""Benchmark: noise, wear, losses and speed errors."""

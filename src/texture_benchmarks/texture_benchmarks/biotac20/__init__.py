"""Benchmark: 20 recorded materials."""

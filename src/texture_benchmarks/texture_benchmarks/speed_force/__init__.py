"""Benchmark: speeds, forces and directions outside the training."""

"""Benchmark: accuracy by window length and sliding time, and the cost of training."""

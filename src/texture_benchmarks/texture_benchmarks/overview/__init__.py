"""Benchmark: accuracy against time in one picture, from the stored figures of other benchmarks."""

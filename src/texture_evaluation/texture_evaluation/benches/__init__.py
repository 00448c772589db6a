"""Benchmarks: each measures one thing and writes its numbers and a chart."""

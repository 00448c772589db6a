"""Benchmark: computing time and losses of sensor nodes."""

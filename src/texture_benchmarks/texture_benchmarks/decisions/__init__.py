"""Benchmark: early decisions, calibration, prediction sets and unknown surfaces."""

"""Benchmark: force, speed and path by robot and surface."""

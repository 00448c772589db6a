"""Benchmark: what trainings and windows cost with many textures and many windows."""

"""Benchmark: cost of simulated slides, and the effect of each term of a scene."""

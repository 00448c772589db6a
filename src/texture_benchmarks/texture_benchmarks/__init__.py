"""Benchmarks, rebuilt experiments of papers and endurance runs."""

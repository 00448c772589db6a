"""Benchmark: stamps in spite of late arrivals and drift."""

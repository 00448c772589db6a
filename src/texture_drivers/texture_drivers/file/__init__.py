"""Recordings played as a sensor: CSV, WAV, NumPy."""

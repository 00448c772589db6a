"""Simulated surfaces, contact and sensors, and devices emulated at the wire."""

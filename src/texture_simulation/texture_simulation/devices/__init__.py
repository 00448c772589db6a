"""Devices emulated where the real ones are reached."""

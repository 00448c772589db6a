"""Endurance: hours of explorations on the emulated bench while faults strike at random."""

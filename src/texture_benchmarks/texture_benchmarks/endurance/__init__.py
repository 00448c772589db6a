"""Endurance: hours of explorations on the emulator while faults strike at random."""

"""Endurance: hours of explorations on the emulator while faults is injected at random."""

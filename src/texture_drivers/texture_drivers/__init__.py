"""Drivers of tactile sensors: bytes to numbers to TactileSignal."""

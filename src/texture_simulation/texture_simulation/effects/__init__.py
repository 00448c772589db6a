"""What makes a measurement less than ideal: one file an effect, each off unless the scene names it."""

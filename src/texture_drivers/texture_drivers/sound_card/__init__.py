"""A contact microphone or accelerometer on a sound card."""

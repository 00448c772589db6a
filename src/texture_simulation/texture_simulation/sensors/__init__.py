"""What a sensor makes of being touched."""

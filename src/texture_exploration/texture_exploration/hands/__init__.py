"""Hands: several fingers, of which some hold an object and others slide on it."""

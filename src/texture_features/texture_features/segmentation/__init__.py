"""Segmentation: start and end of sliding, found from the signals alone."""

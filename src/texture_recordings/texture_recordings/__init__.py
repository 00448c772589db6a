"""Bags and labelled slides: recording, reading, replaying, importing and segmenting."""

"""PVDF finger of Hu et al. 2014: a film that senses vibration and a force sensor behind it."""

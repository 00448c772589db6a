"""Open-set recognition: novelty scores, prediction sets and early stopping."""

"""Divide examples for cross-validation so that no slide is on both sides."""

from __future__ import annotations

import numpy as np

from texture_estimation.learners.learner import Codes


def assign_folds(y: Codes, groups: Codes, count: int) -> tuple[Codes, str] | None:
    """Return the part (0 to count - 1) in which each example is held out, and how they were divided.

    The slides of each label, in the order in which they come, are cut into `count` stretches: sensors and surfaces
    drift, and a neighbour in time would flatter. A label with a single slide is divided by its windows instead, which
    does flatter. None if a label has a single window.

    Parameters
    ----------
    y, groups : (n,)
        Number of the label and of the slide of each example.
    count
        Number of parts, at least 2.

    Returns
    -------
    ((n,), str), or None
        Part of each example, and the division in words.
    """
    folds_of = np.empty(len(y), dtype=np.intp)
    note = f'held-out slides, {count} parts'
    for code in np.unique(y):
        rows = np.flatnonzero(y == code)
        slides = _numbered(groups[rows])
        if not slides.any():
            note = 'held-out windows, as a label has a single slide: too confident'
            slides = np.arange(len(rows))
        if len(rows) < 2:
            return None
        folds_of[rows] = slides * count // (slides.max() + 1)
    return folds_of, note


def _numbered(groups: Codes) -> Codes:
    """Return 0, 1, … for the groups in the order of their first appearance."""
    _, first, inverse = np.unique(groups, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.intp)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse.reshape(-1)]

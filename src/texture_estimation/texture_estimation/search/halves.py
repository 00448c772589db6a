"""Random halves of labelled slides: one for training, one to test on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import InvalidData
from texture_estimation.learners.learner import Codes

Mask = NDArray[np.bool_]


def random_halves(codes: Codes, groups: Codes, count: int, rng: np.random.Generator) -> Mask:
    """Return which examples are used for training in each of `count` splits, (count, n).

    Half of the slides of each label, rounded down, are used for training; all windows of a slide are on one side.

    Parameters
    ----------
    codes, groups : (n,)
        Label and slide number of each example.
    count
        How many splits.
    rng
        Draws the slides.

    Returns
    -------
    (count, n) bool
        True for training.

    Raises
    ------
    InvalidData
        If a label has fewer than two slides.

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.
    """
    slides, first = np.unique(groups, return_index=True)
    of_label = [slides[codes[first] == code] for code in np.unique(codes)]
    if min(len(members) for members in of_label) < 2:
        raise InvalidData(
            f'a surface has {min(len(members) for members in of_label)} slides; '
            'two at least are needed, one for training and one to test on'
        )
    halves = np.zeros((count, len(codes)), dtype=bool)
    for mask in halves:
        training = [rng.permutation(members)[: len(members) // 2] for members in of_label]
        mask[:] = np.isin(groups, np.concatenate(training))
    return halves

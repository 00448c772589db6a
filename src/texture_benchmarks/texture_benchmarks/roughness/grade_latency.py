"""How long from a window's samples to the grade."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from texture_core.types import Array
from texture_estimation.roughness import RoughnessAccumulator, RoughnessModel
from texture_features.windows import CutWindow

WARM_UP = 200


def times_us(model: RoughnessModel, windows: Sequence[CutWindow], count: int) -> Array:
    """Return the computing time of each of `count` windows, taken from `windows` in turn, one by one, (count,) µs.

    It is the time of the core, not of the clock: what other programs take does not count.

    Parameters
    ----------
    model
        Trained model.
    windows
        Windows to choose from.
    count
        Number of measurements.

    Returns
    -------
    (count,)
        µs.
    """
    evidence, taken_us = RoughnessAccumulator(model), []
    for number in range(WARM_UP + count):
        # each a slide of its own: nothing follows a grade that is final
        window = windows[number % len(windows)]
        began = time.thread_time()
        evidence.update(model.recipe.feature_set.extract(window))
        taken_us.append(1e6 * (time.thread_time() - began))
    return np.array(taken_us[WARM_UP:])

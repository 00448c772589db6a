"""From one yes or no a grade to a grade."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_estimation.roughness.regressor import GRADES


def mean_of_votes(votes: NDArray[np.bool_]) -> Array:
    """Return the mean of the grades that fired, (...,) of (..., 5); NaN where none did.

    Source: Rispal et al., "Texture roughness estimation using dynamic tactile sensing", section IV.C, where 0 stands
    for none.

    Parameters
    ----------
    votes : (..., 5) bool
        Whether each whole grade fired.

    Returns
    -------
    (...)
        Grades 1 to 5, or NaN.
    """
    count = votes.sum(axis=-1)
    total = votes @ GRADES
    mean: Array = np.divide(total, count, out=np.full(np.shape(total), np.nan), where=count > 0)
    return mean


def grade_membership(grades: Array) -> NDArray[np.bool_]:
    """Return to which of the five whole grades each grade belongs, (n, 5).

    Parameters
    ----------
    grades : (n,)
        1 to 5.

    Returns
    -------
    (n, 5) bool
    """
    member: NDArray[np.bool_] = np.rint(grades)[:, None] == GRADES
    return member

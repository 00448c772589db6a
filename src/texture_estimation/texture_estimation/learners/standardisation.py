"""Bring features to zero mean and unit variance, as plain arrays."""

from __future__ import annotations

import numpy as np

from texture_core.arrays import Array

# A deviation below this share of the largest value is rounding: the feature is constant.
ROUNDING = 1e-13


def standardisation(values: Array) -> tuple[Array, Array]:
    """Return mean and scale of each feature, (n_features,), of examples (n, n_features).

    The scale is the standard deviation; 1 for a constant feature, which then is 0 for every example.

    Parameters
    ----------
    values : (n, n_features)

    Returns
    -------
    (n_features,)
        Mean of each feature.
    (n_features,)
        Scale of each feature, above 0.
    """
    mean = values.mean(axis=0)
    deviation = values.std(axis=0)
    constant = deviation <= ROUNDING * np.abs(values).max(axis=0)
    return mean, np.where(constant, 1.0, deviation)

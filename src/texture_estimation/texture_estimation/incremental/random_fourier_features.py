"""Random Fourier features of a Gaussian kernel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.standardisation import standardisation

# Chosen on slides 1 to 30 of recorded materials: more cosines hardly help with many slides, and harm with one.
COSINES = 384
WIDTH = 1.0  # of the kernel, in the root mean square distance of a standardised feature vector from the mean


HIDDEN_WEIGHT = 0.3
SEED = 0


@dataclass(frozen=True, eq=False)
class RandomFourierFeatures:
    """Random Fourier features and hidden units, computed from the features of the recipe.

    Parameters
    ----------
    cosines : (n_features, n_cosines)
    phases : (n_cosines,)
    hidden : (n_features, n_hidden)
    hidden_offset : (n_hidden,)
        Of the network; n_hidden 0 without one.

    Examples
    --------
    >>> random_features = RandomFourierFeatures.over(np.arange(10.0)[:, None], None)
    >>> features = random_features(np.array([2.0]))
    >>> features.shape == (COSINES + 1,), features[-1].item()
    (True, 1.0)
    """

    cosines: Array
    phases: Array
    hidden: Array
    hidden_offset: Array

    @classmethod
    def over(cls, values: Array, parameters: Mapping[str, Any] | None) -> RandomFourierFeatures:
        """Return the features for examples (n, n_features); `parameters` are those of a network, or None.

        Parameters
        ----------
        values : (n, n_features)
            Examples, which give the scale.
        parameters
            Parameters of the network that was trained on them, or None.
        """
        rng = np.random.default_rng(SEED)
        mean, scale = standardisation(values)
        count = values.shape[1]
        directions = rng.normal(size=(count, COSINES)) * (1.0 / (WIDTH * math.sqrt(count)))
        cosines = directions / scale[:, None]
        phases = rng.uniform(0.0, 2.0 * np.pi, COSINES) - mean @ cosines
        if parameters is None:
            return cls(cosines, phases, np.zeros((count, 0)), np.zeros(0))
        hidden, offset = (np.asarray(parameters[name], dtype=np.float64) for name in ('hidden', 'hidden_offset'))
        deviation = np.maximum(values @ hidden + offset, 0.0).std(axis=0)
        weight = HIDDEN_WEIGHT / np.where(deviation > 0, deviation, 1.0)
        return cls(cosines, phases, hidden * weight, offset * weight)

    def __call__(self, X: Array) -> Array:
        """Return the features, (..., n_hidden + n_cosines + 1), of (..., n_features); the last is 1."""
        n_hidden, n_cosines = self.hidden.shape[1], self.cosines.shape[1]
        expanded = np.ones((*X.shape[:-1], n_hidden + n_cosines + 1))
        np.maximum(X @ self.hidden + self.hidden_offset, 0.0, out=expanded[..., :n_hidden])
        np.cos(X @ self.cosines + self.phases, out=expanded[..., n_hidden:-1])
        return expanded

"""What a window costs: operations counted, not timed, so that a search ends alike on any machine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from texture_features.feature import Feature
from texture_features.features.force import Force
from texture_features.features.speed import Speed
from texture_features.windowing.time_stretch import Stretched

# Operations of one exponential or hyperbolic tangent.
EXPONENTIAL = 10.0
# Of a feature without an entry, for each sample.
UNKNOWN = 50.0


def operations(
    features: Sequence[Feature], learner: Any, *, n_samples: int, n_values: int, n_labels: int, n_training: int
) -> float:
    """Return about how many operations it takes from the samples of one window to the decision.

    A feature or learner says it itself, if it has a method `operations`.

    Parameters
    ----------
    features, learner
        What is done; the learner may be a regressor that grades.
    n_samples
        Of a window, all channels together.
    n_values
        Values of all features.
    n_labels, n_training
        Surfaces or grades, and training examples, all of which may become support vectors.

    Returns
    -------
    float
        Additions and multiplications.
    """
    extracted = sum(_feature(feature, n_samples) for feature in features)
    own = getattr(learner, 'operations', None)
    return extracted + (own(n_values, n_labels, n_training) if own else float(n_training * n_values))


def _feature(feature: Any, n: int) -> float:
    if isinstance(feature, Stretched):
        return 2.0 * of_transform(n) + _feature(feature.feature, n)
    if isinstance(feature, Speed | Force):
        return 1.0
    own = getattr(feature, 'operations', None)
    return float(own(n)) if own else UNKNOWN * n


def of_networks(count: float, hidden: int, n_values: int) -> float:
    """Return the operations of so many networks with a hidden layer."""
    return count * hidden * (2.0 * n_values + EXPONENTIAL)


def of_machines(count: float, n_values: int, n_training: int) -> float:
    """Return the operations of so many machines that share their support vectors."""
    return n_training * (2.0 * n_values + EXPONENTIAL + 2.0 * count)


def of_transform(n: int) -> float:
    """Return the operations of a Fourier transform of n samples."""
    return 5.0 * n * math.log2(max(n, 2))

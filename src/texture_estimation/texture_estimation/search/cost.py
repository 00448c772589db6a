"""What a window costs: operations counted, not timed, so that a search ends alike on any machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from texture_estimation.learners.ann_pairs import AnnPairs
from texture_estimation.learners.svm_pairs import SvmPairs
from texture_estimation.roughness.ann1 import Ann1
from texture_estimation.roughness.ann5 import Ann5
from texture_estimation.roughness.svm5 import Svm5
from texture_features.feature import Feature
from texture_features.features.arc_length import ArcLength
from texture_features.features.force import Force
from texture_features.features.signal_energy import SignalEnergy
from texture_features.features.spectral_peaks import SpectralPeaks
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
    return extracted + LEARNERS.get(type(learner), _unknown_learner)(learner, n_values, n_labels, n_training)


def _feature(feature: Any, n: int) -> float:
    if isinstance(feature, Stretched):
        return 2.0 * _fourier(n) + _feature(feature.feature, n)
    return FEATURES.get(type(feature), _unknown)(feature, n)


def _networks(learner: Any, count: float, n_values: int) -> float:
    return float(count * learner.hidden * (2.0 * n_values + EXPONENTIAL))


def _machines(count: float, n_values: int, n_training: int) -> float:
    return n_training * (2.0 * n_values + EXPONENTIAL + 2.0 * count)


def _unknown_learner(_: Any, n_values: int, n_labels: int, n_training: int) -> float:
    return float(n_training * n_values)


def _fourier(n: int) -> float:
    return 5.0 * n * math.log2(max(n, 2))


def _peaks(feature: Any, n: int) -> float:
    points = max(int(feature.points), n)
    return _fourier(points) + points * (2.0 + 2.0 * int(feature.peaks))


def _unknown(_: Any, n: int) -> float:
    return UNKNOWN * n


FEATURES: Mapping[type[Feature], Callable[[Any, int], float]] = {
    SpectralPeaks: _peaks,  # transform, amplitudes, and twice through half the points for each peak
    SignalEnergy: lambda _, n: 3.0 * n,
    ArcLength: lambda _, n: 6.0 * n,
    Speed: lambda _, n: 1.0,
    Force: lambda _, n: 1.0,
}
LEARNERS: Mapping[type, Callable[[Any, int, int, int], float]] = {
    AnnPairs: lambda learner, v, k, _: _networks(learner, k * (k - 1) / 2, v),
    SvmPairs: lambda _, v, k, n: _machines(k - 1, v, n),  # each example has a weight in k - 1 pairs
    Ann1: lambda regressor, v, _, n: _networks(regressor, 1.0, v),
    Ann5: lambda regressor, v, k, _: _networks(regressor, k, v),
    Svm5: lambda _, v, k, n: _machines(k, v, n),
}

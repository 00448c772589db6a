"""What a window costs: operations counted, not timed, so that a search ends alike on any machine."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from texture_estimation.learners.ann_pairs import AnnPairs
from texture_estimation.learners.svm_pairs import SvmPairs
from texture_estimation.recipe import Recipe
from texture_features.feature import Feature
from texture_features.features.arc_length import ArcLength
from texture_features.features.force import Force
from texture_features.features.integral import Integral
from texture_features.features.spectral_peaks import SpectralPeaks
from texture_features.features.speed import Speed
from texture_features.stretch import Stretched

# Operations of one exponential or hyperbolic tangent.
EXPONENTIAL = 10.0
# Of a feature without an entry, for each sample.
UNKNOWN = 50.0


def operations(recipe: Recipe, n_samples: int, n_values: int, n_labels: int, n_learnt: int) -> float:
    """Return about how many operations it takes from the samples of one window to the decision.

    Parameters
    ----------
    recipe
        What is done.
    n_samples
        Of a window, all channels together.
    n_values
        Features.
    n_labels, n_learnt
        Surfaces, and examples learnt from, all of which may become support vectors.
    """
    features = [feature for item in recipe.feature_set.inputs for _, feature in item.features]
    described = sum(_feature(feature, n_samples) for feature in features)
    return described + _learner(recipe.learner, n_values, n_labels, n_learnt)


def _feature(feature: Any, n: int) -> float:
    if isinstance(feature, Stretched):
        return 2.0 * _fourier(n) + _feature(feature.feature, n)
    return FEATURES.get(type(feature), _unknown)(feature, n)


def _learner(learner: Any, n_values: int, n_labels: int, n_learnt: int) -> float:
    n_pairs = n_labels * (n_labels - 1) / 2
    if isinstance(learner, AnnPairs):
        return float(n_pairs * learner.hidden * (2.0 * n_values + EXPONENTIAL))
    if isinstance(learner, SvmPairs):
        return n_learnt * (2.0 * n_values + EXPONENTIAL + 2.0 * (n_labels - 1))
    return float(n_learnt * n_values)


def _fourier(n: int) -> float:
    return 5.0 * n * math.log2(max(n, 2))


def _peaks(feature: Any, n: int) -> float:
    points = max(int(feature.points), n)
    return _fourier(points) + points * (2.0 + 2.0 * int(feature.peaks))


def _unknown(_: Any, n: int) -> float:
    return UNKNOWN * n


FEATURES: Mapping[type[Feature], Callable[[Any, int], float]] = {
    SpectralPeaks: _peaks,  # transform, amplitudes, and twice through half the points for each peak
    Integral: lambda _, n: 3.0 * n,
    ArcLength: lambda _, n: 6.0 * n,
    Speed: lambda _, n: 1.0,
    Force: lambda _, n: 1.0,
}

"""Slides under several conditions, with the conditions as arrays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from texture_benchmarks.speed_force.held_out import EvaluateSplit, Mask, recognised
from texture_core.arrays import AnyArray, Array
from texture_estimation.learners.learner import Learner
from texture_features.feature import Feature, WindowBatch
from texture_recordings.slide_samples import SlideSamples


@dataclass(frozen=True, eq=False)
class Conditions:
    """Slides, each under a condition.

    Parameters
    ----------
    slides
        At least one.
    """

    slides: Sequence[SlideSamples]

    @property
    def surfaces(self) -> AnyArray:
        """Label of each slide, (n,)."""
        return np.array([slide.surface for slide in self.slides])

    @property
    def names(self) -> AnyArray:
        """Name of each slide, (n,)."""
        return np.array([slide.slide.name for slide in self.slides])

    @property
    def speed_mm_s(self) -> Array:
        """Speed of each slide, mm/s, (n,)."""
        return np.array([round(1000.0 * slide.speed_m_s, 3) for slide in self.slides])

    @property
    def force_n(self) -> Array:
        """Force of each slide, (n,)."""
        return np.array([round(slide.force_n, 3) for slide in self.slides])

    @property
    def upwards(self) -> Array:
        """1 for a direction of positive angle, -1 for a negative one, (n,)."""
        return np.array([math.copysign(1.0, math.sin(slide.direction_rad)) for slide in self.slides])

    def trial(self, values: Array, learner: Learner, tested_values: Array | None = None) -> EvaluateSplit:
        """Return what trains one example a slide, (n, n_features), and tests others; described otherwise if given."""
        surfaces, names = self.surfaces, self.names
        tested = values if tested_values is None else tested_values

        def test(train: Mask, test: Mask) -> Mask:
            return recognised(learner, (values[train], surfaces[train], names[train]), (tested[test], surfaces[test]))

        return test


def extracted(features: Sequence[Feature], windows: Sequence[WindowBatch]) -> Array:
    """Return the values of features, one row for each window there is, (n, n_features)."""
    return np.concatenate([_rows(features, window) for window in windows])


def _rows(features: Sequence[Feature], windows: WindowBatch) -> Array:
    values = [feature(windows) for feature in features]
    return np.atleast_2d(np.concatenate([value.reshape(*value.shape[:-2], -1) for value in values], axis=-1))

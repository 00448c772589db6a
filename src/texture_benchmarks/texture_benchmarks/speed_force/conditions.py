"""Trials of one example a slide, with what the benchmarks of conditions share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from texture_benchmarks.speed_force.held_out import EvaluateSplit, Mask, recognised
from texture_core.arrays import Array
from texture_estimation.learners.learner import Learner
from texture_features.feature import Feature, WindowBatch
from texture_recordings.slide_dataset import SlideDataset


def speed_mm_s(dataset: SlideDataset) -> Array:
    """Return the speed of each slide, mm/s, (n_slides,).

    Returns
    -------
    (n_slides,)
        mm/s.
    """
    return np.round(1000.0 * dataset.condition('speed'), 3)


def slide_trial(
    dataset: SlideDataset, learner: Learner, values: Array, tested_values: Array | None = None
) -> EvaluateSplit:
    """Return what trains one example a slide, (n_slides, n_features), and tests others; described otherwise if given.

    Parameters
    ----------
    dataset
        The slides.
    learner
        Trained again for each split.
    values : (n_slides, n_features)
        Features of each slide.
    tested_values : (n_slides, n_features)
        Features of the slides that are tested, if they are others.

    Returns
    -------
    callable
        Takes training and test slides, returns which test slides are recognised.
    """
    surfaces, names = dataset.labels, dataset.names
    tested = values if tested_values is None else tested_values

    def test(train: Mask, test: Mask) -> Mask:
        return recognised(learner, (values[train], surfaces[train], names[train]), (tested[test], surfaces[test]))

    return test


def extracted(features: Sequence[Feature], windows: Sequence[WindowBatch]) -> Array:
    """Return the values of features, one row for each window there is, (n, n_features).

    Parameters
    ----------
    features
        Features, one after the other.
    windows
        Batches of windows.

    Returns
    -------
    (n, n_features)
    """
    return np.concatenate([_rows(features, window) for window in windows])


def _rows(features: Sequence[Feature], windows: WindowBatch) -> Array:
    values = [feature(windows) for feature in features]
    return np.atleast_2d(np.concatenate([value.reshape(*value.shape[:-2], -1) for value in values], axis=-1))

"""MiniRocket and ridge regression, a strong general method for time series, to compare with; needs aeon installed.

Source: Dempster, Schmidt & Webb 2021, "MiniRocket: a very fast (almost) deterministic transform for time series".
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from texture_benchmarks.recipes.raw_windows import Vote, figures_of_windows, one_vote
from texture_benchmarks.recipes.trial import LENGTH_S
from texture_core.arrays import AnyArray, Array
from texture_evaluation.cross_validation.splits import Split
from texture_recordings.slide_dataset import SlideDataset

ABSENT = 'not measured: aeon is not installed (pip install aeon)'
# Of the ridge, tried on a fifth of the slides for training; the transform's values have unit variance.
ALPHAS = (10.0, 1000.0, 100_000.0)


def installed() -> bool:
    """Return whether MiniRocket can be run here."""
    return find_spec('aeon') is not None


def try_minirocket(
    dataset: SlideDataset, split: Split, seed: int, length_s: float = LENGTH_S, every: int = 1
) -> dict[str, Any]:
    """Return the figures of MiniRocket on the vibration, one window, one vote.

    Parameters
    ----------
    dataset, split
        Slides, and which of them are used for training and tested on.
    seed
        Of its kernels.
    length_s
        Of the windows, which begin LENGTH_S apart.
    every
        Of the windows of the slides for training, every so many-th is used for training: the time grows with the
        square.

    Returns
    -------
    dict
        Figures as plain values.
    """
    transform = import_module('aeon.transformations.collection.convolution_based').MiniRocket

    def fit(samples: AnyArray, labels: AnyArray, slides: AnyArray) -> Vote:
        rocket = transform(random_state=seed).fit(samples)
        ridge = _Ridge.fit(rocket.transform(samples), labels, slides)
        return one_vote(lambda windows: ridge(rocket.transform(windows)), ridge.labels)

    return figures_of_windows(dataset, split, fit, length_s, every)


@dataclass(frozen=True, eq=False)
class _Ridge:
    """Ridge regression on targets of -1 and 1, solved with one row and column for each example."""

    mean: AnyArray
    scale: AnyArray
    weights: AnyArray
    labels: AnyArray

    @classmethod
    def fit(cls, values: AnyArray, labels: AnyArray, slides: AnyArray) -> _Ridge:
        mean, scale = values.mean(axis=0), np.maximum(values.std(axis=0), 1e-6)
        standard = (values - mean) / scale
        names, codes = np.unique(labels, return_inverse=True)
        targets = 2.0 * np.eye(len(names))[codes] - 1.0
        products = (standard @ standard.T).astype(np.float64)
        held = np.unique(slides, return_inverse=True)[1] % 5 == 0
        alpha = max(ALPHAS, key=lambda tried: _score(products, targets, codes, held, tried))
        weights = standard.T @ _solve(products, targets, alpha).astype(values.dtype)
        return cls(mean, scale, weights, names)

    def __call__(self, values: AnyArray) -> AnyArray:
        answers: AnyArray = self.labels[((values - self.mean) / self.scale @ self.weights).argmax(axis=1)]
        return answers


def _solve(products: Array, targets: Array, alpha: float) -> Array:
    solved: Array = cho_solve(cho_factor(products + alpha * np.eye(len(products))), targets)
    return solved


def _score(products: Array, targets: Array, codes: AnyArray, held: NDArray[np.bool_], alpha: float) -> float:
    dual = _solve(products[np.ix_(~held, ~held)], targets[~held], alpha)
    return float(np.mean((products[np.ix_(held, ~held)] @ dual).argmax(axis=1) == codes[held]))

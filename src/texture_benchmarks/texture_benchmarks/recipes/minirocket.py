"""MiniRocket and ridge regression, a strong general method for time series, to compare with; needs aeon installed.

Source: Dempster, Schmidt & Webb 2021, "MiniRocket: a very fast (almost) deterministic transform for time series".
"""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from texture_benchmarks.recipes.trial import LENGTH_S
from texture_core.arrays import AnyArray, Array
from texture_evaluation.cross_validation.cross_validate import split_slides
from texture_evaluation.cross_validation.splits import Split
from texture_features.windowing.windows import CutWindow, WindowParams, cut_recording
from texture_recordings.slide_dataset import SlideDataset

ABSENT = 'not measured: aeon is not installed (pip install aeon)'
# Of the ridge, tried on a fifth of the slides for training; the transform's values have unit variance.
ALPHAS = (10.0, 1000.0, 100_000.0)
VOTING_WINDOWS = round(5.0 / LENGTH_S)  # and no more, as in the figures published with the data
TIMED = 200


def installed() -> bool:
    """Return whether MiniRocket can be run here."""
    return find_spec('aeon') is not None


def try_minirocket(
    dataset: SlideDataset,
    split: Split,
    seed: int,
    length_s: float = LENGTH_S,
    every: int = 1,
) -> dict[str, Any]:
    """Return the figures of MiniRocket on the vibration, the vote being one window, one vote.

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
    windows = _cut(dataset, length_s)
    right, voted, taken = [], [], []
    for training, tested in split_slides(dataset, split.splitter, split.groups):
        start = time.process_time()
        rows = np.flatnonzero(np.isin(windows.slides, dataset.names[training]))[::every]
        held = np.isin(windows.slides, dataset.names[tested])
        rocket = transform(random_state=seed).fit(windows.samples[rows])
        ridge = _Ridge.fit(rocket.transform(windows.samples[rows]), windows.labels[rows], windows.slides[rows])
        taken.append(time.process_time() - start)
        answers = ridge(rocket.transform(windows.samples[held]))
        right += (answers == windows.labels[held]).tolist()
        voted += _votes(answers, windows.labels[held], windows.slides[held])
    return {
        'window_accuracy': float(np.mean(right)),
        'accuracy_at_s': {'0.5': None, '1.0': None, '2.5': None, '5.0': float(np.mean(voted))},
        'unclassified_windows': 0.0,
        'unclassified_at_s': {'0.5': None, '1.0': None, '2.5': None, '5.0': 0.0},
        'train_s': round(float(np.mean(taken)), 2),
        'latency_us': _latency(rocket, ridge, windows.samples),
    }


@dataclass(frozen=True, eq=False)
class _Windows:
    samples: NDArray[np.float32]  # (n, 1, n_samples)
    labels: AnyArray
    slides: AnyArray


def _cut(dataset: SlideDataset, length_s: float) -> _Windows:
    params = WindowParams(length_s=length_s, hop_s=LENGTH_S)
    found = [
        (event.windows['signal'].samples[:, 0], item.surface, item.name)
        for item in dataset
        for event in cut_recording({'signal': item.signals['signal']}, item.states, params)
        if isinstance(event, CutWindow)
    ]
    samples, labels, slides = zip(*found, strict=True)
    return _Windows(np.stack(samples)[:, None].astype(np.float32), np.array(labels), np.array(slides))


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


def _votes(answers: AnyArray, labels: AnyArray, slides: AnyArray) -> list[bool]:
    right = []
    for slide in np.unique(slides):
        own = np.flatnonzero(slides == slide)[:VOTING_WINDOWS]
        [(answer, _)] = Counter(answers[own].tolist()).most_common(1)
        right.append(answer == labels[own[0]])
    return right


def _latency(rocket: Any, ridge: _Ridge, samples: AnyArray) -> dict[str, float]:
    taken = []
    for window in samples[:TIMED]:
        start = time.process_time()
        ridge(rocket.transform(window[None]))
        taken.append(1e6 * (time.process_time() - start))
    median, p99 = np.percentile(taken[10:], (50, 99))
    return {'median': float(median), 'p99': float(p99)}

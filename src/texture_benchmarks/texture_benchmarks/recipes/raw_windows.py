"""Methods that take windows of samples and not features: what aeon's classifiers do, with one window one vote."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_benchmarks.recipes.trial import LENGTH_S
from texture_core.arrays import AnyArray
from texture_core.catalogue import find
from texture_core.errors import InvalidData, InvalidParameter
from texture_evaluation.cross_validation.slide_splits import split_slides
from texture_evaluation.cross_validation.splits import Split
from texture_features.windowing.windows import CutWindow, WindowParams, cut_recording
from texture_recordings.slide_dataset import SlideDataset

VOTING_WINDOWS = round(5.0 / LENGTH_S)  # and no more, as in the figures published with the data
TIMED = 200
WARM_UP = 10
Predict = Callable[[AnyArray], AnyArray]  # windows (n, n_channels, n_samples) → labels (n,)
Fit = Callable[[AnyArray, AnyArray, AnyArray], Predict]  # windows, labels and slides of the training windows


@dataclass(frozen=True, eq=False)
class RawWindows:
    """All windows of a data set.

    Parameters
    ----------
    samples : (n, n_channels, n_samples)
        As aeon takes collections of time series.
    labels, slides : (n,)
        Surface and name of the slide of each.
    """

    samples: NDArray[np.float32]
    labels: AnyArray
    slides: AnyArray

    @classmethod
    def of(cls, dataset: SlideDataset, length_s: float = LENGTH_S) -> RawWindows:
        """Return windows that begin LENGTH_S apart, of the first topic of the slides.

        Raises
        ------
        InvalidData
            If no slide has a whole window.
        """
        params = WindowParams(length_s=length_s, hop_s=LENGTH_S)
        topic = next(iter(dataset[0].signals))
        found = [
            (event.windows[topic].samples.T, item.surface, item.name)
            for item in dataset
            for event in cut_recording({topic: item.signals[topic]}, item.states, params)
            if isinstance(event, CutWindow)
        ]
        if not found:
            raise InvalidData(f'no slide has a whole window of {length_s} s; use longer slides without losses')
        samples, labels, slides = zip(*found, strict=True)
        return cls(np.stack(samples).astype(np.float32), np.array(labels), np.array(slides))


def figures_of_windows(
    dataset: SlideDataset, split: Split, fit: Fit, length_s: float = LENGTH_S, every: int = 1
) -> dict[str, Any]:
    """Return the figures of a method that takes windows of samples.

    Parameters
    ----------
    dataset, split
        Slides, and which of them are used for training and tested on.
    fit
        Trains on windows, their labels and slides, and returns what predicts labels of windows.
    length_s
        Of the windows, which begin LENGTH_S apart.
    every
        Of the windows of the slides for training, every so many-th is used for training.

    Returns
    -------
    dict
        As those of a recipe.
    """
    windows = RawWindows.of(dataset, length_s)
    right, voted, taken = [], [], []
    for training, tested in split_slides(dataset, split.splitter, split.groups):
        start = time.process_time()
        rows = np.flatnonzero(np.isin(windows.slides, dataset.names[training]))[::every]
        held = np.isin(windows.slides, dataset.names[tested])
        predict = fit(windows.samples[rows], windows.labels[rows], windows.slides[rows])
        taken.append(time.process_time() - start)
        answers = np.asarray(predict(windows.samples[held]))
        right += (answers == windows.labels[held]).tolist()
        voted += _votes(answers, windows.labels[held], windows.slides[held])
    return {
        'window_accuracy': float(np.mean(right)),
        'accuracy_at_s': {'0.5': None, '1.0': None, '2.5': None, '5.0': float(np.mean(voted))},
        'unclassified_windows': 0.0,
        'unclassified_at_s': {'0.5': None, '1.0': None, '2.5': None, '5.0': 0.0},
        'train_s': round(float(np.mean(taken)), 2),
        'latency_us': _latency(predict, windows.samples),
    }


def try_estimator(dataset: SlideDataset, split: Split, name: str, seed: int) -> dict[str, Any]:
    """Return the figures of an estimator with `fit(X, y)` and `predict(X)` of windows, such as those of aeon.

    Parameters
    ----------
    dataset, split
        Slides, and which of them are used for training and tested on.
    name
        Name of the class, such as 'aeon.classification.convolution_based:MiniRocketClassifier'.
    seed
        Given as `random_state`, if the estimator has it.

    Returns
    -------
    dict
        As those of a recipe.

    Raises
    ------
    UnknownName
        If the class cannot be imported.
    InvalidParameter
        If it is no such estimator.
    """
    cls: Any = find({}, name, 'estimator')
    if not all(hasattr(cls, method) for method in ('fit', 'predict')):
        raise InvalidParameter(
            f"'{name}' has no methods fit and predict; name a class of aeon or one of your own like it"
        )

    def fit(samples: AnyArray, labels: AnyArray, _: AnyArray) -> Predict:
        estimator = cls()
        if hasattr(estimator, 'get_params') and 'random_state' in estimator.get_params():
            estimator.set_params(random_state=seed)
        trained: Predict = estimator.fit(samples, labels).predict
        return trained

    return figures_of_windows(dataset, split, fit)


def _votes(answers: AnyArray, labels: AnyArray, slides: AnyArray) -> list[bool]:
    right = []
    for slide in np.unique(slides):
        own = np.flatnonzero(slides == slide)[:VOTING_WINDOWS]
        [(answer, _)] = Counter(answers[own].tolist()).most_common(1)
        right.append(answer == labels[own[0]])
    return right


def _latency(predict: Predict, samples: AnyArray) -> dict[str, float]:
    taken = []
    for window in samples[:TIMED]:
        start = time.process_time()
        predict(window[None])
        taken.append(1e6 * (time.process_time() - start))
    median, p99 = np.percentile(taken[min(WARM_UP, len(taken) - 1) :], (50, 99))
    return {'median': float(median), 'p99': float(p99)}

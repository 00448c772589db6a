"""Methods that take windows of samples and not features, as aeon's classifiers do; windows of a slide vote."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_benchmarks.recipes.trial import LENGTH_S
from texture_core.arrays import AnyArray, Array
from texture_core.catalogue import find
from texture_core.errors import InvalidData, InvalidParameter
from texture_evaluation.cross_validation.slide_splits import split_slides
from texture_evaluation.cross_validation.splits import Split
from texture_features.windowing.windows import CutWindow, WindowParams, cut_recording
from texture_recordings.slide_dataset import SlideDataset

AT_S = (0.5, 1.0, 2.5, 5.0)
FIRST_COUNTS = 1e-6  # of a vote: of equal counts, the label that was voted for first wins
TIMED = 200
WARM_UP = 10
Predict = Callable[[AnyArray], AnyArray]  # windows (n, n_channels, n_samples) → labels (n,)
# windows (n, n_channels, n_samples) → votes for the sorted labels of the training (n, n_labels)
Vote = Callable[[AnyArray], Array]
Fit = Callable[[AnyArray, AnyArray, AnyArray], Vote]  # windows, labels and slides of the training windows


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
        Trains on windows, their labels and slides, and returns what votes for labels of windows.
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
    right, decided, taken = [], [], []
    for training, tested in split_slides(dataset, split.splitter, split.groups):
        start = time.process_time()
        rows = np.flatnonzero(np.isin(windows.slides, dataset.names[training]))[::every]
        held = np.isin(windows.slides, dataset.names[tested])
        vote = fit(windows.samples[rows], windows.labels[rows], windows.slides[rows])
        taken.append(time.process_time() - start)
        votes = np.asarray(vote(windows.samples[held]))
        codes = np.searchsorted(np.unique(windows.labels[rows]), windows.labels[held])
        right.append(votes.argmax(axis=1) == codes)
        decided += decisions(votes, codes, windows.slides[held])
    shares = [float(np.mean(own)) for own in zip(*decided, strict=False)]
    return {
        'window_accuracy': float(np.mean(np.concatenate(right))),
        'accuracy_at_s': {str(seconds): _share_at(shares, seconds, length_s) for seconds in AT_S},
        'decisions': {'s': [length_s + LENGTH_S * number for number in range(len(shares))], 'share': shares},
        'unclassified_windows': 0.0,
        'unclassified_at_s': dict.fromkeys(map(str, AT_S), 0.0),
        'train_s': round(float(np.mean(taken)), 2),
        'latency_us': _latency(vote, windows.samples),
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
        raise InvalidParameter(f"'{name}' has no methods fit and predict; name a class of aeon or your own like it")

    def fit(samples: AnyArray, labels: AnyArray, _: AnyArray) -> Vote:
        estimator = cls()
        if hasattr(estimator, 'get_params') and 'random_state' in estimator.get_params():
            estimator.set_params(random_state=seed)
        trained = estimator.fit(samples, labels)
        vote: Vote = getattr(trained, 'predict_proba', None) or one_vote(trained.predict, np.unique(labels))
        return vote

    return figures_of_windows(dataset, split, fit)


def one_vote(predict: Predict, labels: AnyArray) -> Vote:
    """Return votes of 1 for the predicted label, from what predicts labels of windows.

    Parameters
    ----------
    predict
        Windows → labels, (n,).
    labels : (n_labels,)
        Sorted labels of the training.

    Returns
    -------
    Vote
        Windows → votes, (n, n_labels).
    """
    return lambda windows: (np.asarray(predict(windows))[:, None] == labels).astype(np.float64)


def decisions(votes: Array, codes: AnyArray, slides: AnyArray) -> list[list[bool]]:
    """Return for each slide whether the sum of the votes is right after its first window, its second, and so on.

    Parameters
    ----------
    votes : (n, n_labels)
        Of windows, slide by slide and in the order of time.
    codes, slides : (n,)
        Number of the true label, and name of the slide of each.

    Returns
    -------
    list of list of bool
        By slide, after each of its windows.

    Examples
    --------
    >>> decisions(np.array([[0.6, 0.4], [0.1, 0.9], [1.0, 0.0]]), np.array([1, 1, 0]), np.array(['a', 'a', 'b']))
    [[False, True], [True]]
    """
    found = []
    for slide in np.unique(slides):
        own = votes[slides == slide]
        weights = 1.0 - FIRST_COUNTS * np.arange(len(own))
        sums = np.cumsum(own * weights[:, None], axis=0)
        found.append((sums.argmax(axis=1) == codes[slides == slide]).tolist())
    return found


def _share_at(shares: Sequence[float], seconds: float, length_s: float) -> float | None:
    """Return the share after so much sliding; None before the first window ends."""
    number = round((seconds - length_s) / LENGTH_S)
    return shares[number] if 0 <= number < len(shares) else None


def _latency(vote: Vote, samples: AnyArray) -> dict[str, float]:
    taken = []
    for window in samples[:TIMED]:
        start = time.process_time()
        vote(window[None])
        taken.append(1e6 * (time.process_time() - start))
    median, p99 = np.percentile(taken[min(WARM_UP, len(taken) - 1) :], (50, 99))
    return {'median': float(median), 'p99': float(p99)}

"""Ridge classifier on random Fourier features that adds textures in milliseconds, in closed form.

The features of a window do not change: the hidden layer of the network that was trained, if it was one, and
random cosines of the standardised features, which stand for a Gaussian kernel. Only a linear layer on top is fitted, by
ridge regression to 1 for the own texture and 0 for the others, every texture counting alike however many examples it
has. It depends on the examples of a texture through their mean and their second moments alone: adding examples changes
these, and a linear system is solved again. So nothing is forgotten, and the order of added slides does not matter.

Among the textures of the training without added slides, trained learner and linear layer have equal weights.

Source: Rahimi & Recht 2007 for the random features.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import solve
from scipy.optimize import minimize_scalar

from texture_core.arrays import Array
from texture_estimation.incremental.random_fourier_features import RandomFourierFeatures
from texture_estimation.learners.learner import Codes, Predictor
from texture_estimation.log_probabilities import log_loss, log_softmax

RIDGE = 3e-4
# Examples of a texture that count; more cost time and memory, and hardly help.
MAX_EXAMPLES = 400
DEFAULT_INVERSE_TEMPERATURE = 10.0


@dataclass(frozen=True, eq=False)
class RidgePredictor:
    """Linear layer over the random features, combined with the predictor of the training.

    Parameters
    ----------
    random_features
        The fixed features.
    weights : (n_lifted, n_labels)
    trained
        Predictor of the training, for the first labels.
    kept : (n_kept,)
        Numbers of the labels for which it is used.

    Examples
    --------
    >>> values = np.repeat([0.0, 1.0], 10)[:, None] + 0.1 * np.random.default_rng(0).standard_normal((20, 1))
    >>> codes, slides = np.repeat([0, 1], 10), np.repeat(np.arange(4), 5)
    >>> trained = lambda rows: log_softmax(np.concatenate([-(rows**2), -((rows - 1.0) ** 2)], axis=-1))
    >>> classifier = RidgeClassifier(values, codes, slides, trained=trained)
    >>> isinstance(classifier.predictor, RidgePredictor), classifier.predictor(values).shape
    (True, (20, 2))
    """

    random_features: RandomFourierFeatures
    weights: Array
    trained: Predictor
    kept: Codes

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""
        scores: Array = self.random_features(X) @ self.weights
        if len(self.kept) > 1:
            own = scores[..., self.kept]
            both = log_softmax(0.5 * (own + self.trained(X)[..., self.kept]))
            highest = np.maximum.reduce(own, axis=-1, keepdims=True)
            any_of_them = highest + np.log(np.add.reduce(np.exp(own - highest), axis=-1, keepdims=True))
            scores[..., self.kept] = any_of_them + both
        return scores


class RidgeClassifier:
    """Ridge regression to class indicators, with equal class weights, updated label by label.

    Parameters
    ----------
    values : (n, n_features)
    codes, slides : (n,)
        Number of the label, 0…, and of the slide of each example.
    trained
        Predictor of their labels from the training.
    parameters
        Of the network that was trained on them, or None.

    Examples
    --------
    >>> values = np.repeat([0.0, 1.0], 10)[:, None] + 0.1 * np.random.default_rng(0).standard_normal((20, 1))
    >>> codes, slides = np.repeat([0, 1], 10), np.repeat(np.arange(4), 5)
    >>> trained = lambda rows: log_softmax(np.concatenate([-(rows**2), -((rows - 1.0) ** 2)], axis=-1))
    >>> classifier = RidgeClassifier(values, codes, slides, trained=trained)
    >>> classifier.set_examples(2, np.full((5, 1), 3.0))  # a third label
    >>> classifier.predictor(np.array([[0.0], [1.0], [3.0]])).argmax(axis=1).tolist()
    [0, 1, 2]
    """

    def __init__(
        self, X: Array, y: Codes, slides: Codes, *, trained: Predictor, parameters: Mapping[str, Any] | None = None
    ) -> None:
        self._trained = trained
        self._kept = set(range(int(y.max()) + 1))
        self._random_features = RandomFourierFeatures.over(X, parameters)
        self._rows: list[Array] = [X[y == code] for code in range(int(y.max()) + 1)]
        expanded = self._random_features(X)
        half = _half(y, slides)
        halves = [
            [_Moments.of(expanded[(y == code) & (half == side)]) for code in range(len(self._rows))] for side in (0, 1)
        ]
        whole = [first.with_(second) for first, second in zip(*halves, strict=True)]
        self._inverse_temperature = _inverse_temperature(halves, expanded, y, half)
        self._squares = np.sum([moments.square for moments in whole], axis=0)
        self._means = [moments.mean for moments in whole]

    @property
    def predictor(self) -> RidgePredictor:
        """Predictor of all examples so far."""
        weights = self._inverse_temperature * _solve(self._squares, self._means)
        return RidgePredictor(
            self._random_features, weights, self._trained, np.array(sorted(self._kept), dtype=np.intp)
        )

    def examples_of(self, code: int) -> Array:
        """Return the examples of a label, (n, n_features).

        Returns
        -------
        (n, n_features)
            Those that count, thinned.
        """
        return self._rows[code]

    def set_examples(self, code: int, rows: Array, *, as_trained: bool = False) -> None:
        """Let `rows`, (n, n_features), be the examples of a label; of the next new one if `code` is their number.

        No rows remove the last label. `as_trained`: the rows are those of the training.

        Parameters
        ----------
        code
            Number of the label.
        rows : (n, n_features)
            Its examples; none remove the last label.
        as_trained
            Whether they are those of the training alone.
        """
        (self._kept.add if as_trained else self._kept.discard)(code)
        if code == len(self._rows):
            self._rows.append(rows[:0])
            self._means.append(np.zeros(len(self._squares)))
        before, after = self._rows[code], thinned(rows)
        old = _Moments.of(self._random_features(before))
        more = len(after) > len(before) and np.array_equal(after[: len(before)], before)
        new = (
            old.with_(_Moments.of(self._random_features(after[len(before) :])))
            if more
            else _Moments.of(self._random_features(after))
        )
        self._squares += new.square - old.square
        self._rows[code], self._means[code] = after, new.mean
        if not len(rows):
            del self._rows[code], self._means[code]


def thinned(rows: Array, most: int = MAX_EXAMPLES) -> Array:
    """Return at most so many of the rows, evenly spread over all.

    Parameters
    ----------
    rows : (n, n_features)
    most
        Largest number of rows.

    Returns
    -------
    (at most `most`, n_features)
        In the same order.
    """
    kept: Array = rows[spread(len(rows), most)]
    return kept


def spread(count: int, most: int = MAX_EXAMPLES) -> Codes:
    """Return at most so many of the numbers 0 to count - 1, evenly spread."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).round().astype(np.intp))


@dataclass(frozen=True, eq=False)
class _Moments:
    """Mean, (n_lifted,), and mean outer product, (n_lifted, n_lifted), of `count` examples."""

    count: int
    mean: Array
    square: Array

    @classmethod
    def of(cls, expanded: Array) -> _Moments:
        count = len(expanded)
        return cls(count, expanded.sum(axis=0) / max(count, 1), expanded.T @ expanded / max(count, 1))

    def with_(self, other: _Moments) -> _Moments:
        count = self.count + other.count
        mine, its = self.count / count, other.count / count
        return _Moments(count, mine * self.mean + its * other.mean, mine * self.square + its * other.square)


def _solve(squares: Array, means: list[Array]) -> Array:
    """Return the weights, (n_lifted, n_labels)."""
    system = squares + RIDGE * len(means) * np.eye(len(squares))
    weights: Array = solve(system, np.stack(means, axis=1), assume_a='pos')
    return weights


def _half(y: Codes, slides: Codes) -> Codes:
    """Return 0 or 1 for each example: every second slide of each label, or window if a label has a single slide."""
    half = np.zeros(len(y), dtype=np.intp)
    for code in np.unique(y):
        rows = np.flatnonzero(y == code)
        numbers = np.unique(slides[rows], return_inverse=True)[1].reshape(-1)
        half[rows] = (numbers if numbers.any() else np.arange(len(rows))) % 2
    return half


def _inverse_temperature(halves: list[list[_Moments]], expanded: Array, y: Codes, half: Codes) -> float:
    """Return the factor of the scores that makes each half most probable to a layer fitted to the other."""
    if any(moments.count == 0 for side in halves for moments in side):
        return DEFAULT_INVERSE_TEMPERATURE
    scores = np.empty((len(y), len(halves[0])))
    for side in (0, 1):
        training = halves[1 - side]
        weights = _solve(
            np.sum([moments.square for moments in training], axis=0), [moments.mean for moments in training]
        )
        scores[half == side] = expanded[half == side] @ weights
    best = minimize_scalar(
        lambda log_s: log_loss(log_softmax(scores * math.exp(log_s)), y), bounds=(0.0, 5.0), method='bounded'
    )
    return math.exp(best.x)

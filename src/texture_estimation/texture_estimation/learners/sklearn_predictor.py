"""Predict with a fitted estimator of scikit-learn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import ModelMismatch
from texture_estimation.log_probabilities import log_softmax

FLOOR = 1e-3  # trees give a probability of 0 to what none of their leaves holds


@dataclass(frozen=True, eq=False)
class SklearnPredictor:
    """A fitted classifier behind the interface of all predictors.

    Parameters
    ----------
    estimator
        Fitted with label numbers.
    mean, scale : (n_features,)
        Mean and scale of the features in the training.
    n_labels
        Number of labels, of which the estimator may lack some.
    temperature
        Divisor of the logarithms.

    Examples
    --------
    >>> from texture_estimation.learners.sklearn_learner import SklearnLearner
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> learner = SklearnLearner('sklearn.linear_model:LogisticRegression')
    >>> predictor = learner.predictor(learner.fit(values, codes, groups).parameters)
    >>> isinstance(predictor, SklearnPredictor), bool((predictor(values).argmax(axis=1) == codes).all())
    (True, True)
    """

    estimator: Any
    mean: Array
    scale: Array
    n_labels: int
    temperature: float

    def __post_init__(self) -> None:
        for tree in _trees(self.estimator, 0):
            _check_tree(tree, len(self.mean))

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities, (..., n_labels) of (..., n_features)."""
        rows = ((X - self.mean) / self.scale).reshape(-1, len(self.mean))
        scores = np.full((len(rows), self.n_labels), np.log(FLOOR / self.n_labels))
        scores[:, self.estimator.classes_] = self._scores(rows)
        result: Array = log_softmax(scores / self.temperature).reshape(*X.shape[:-1], self.n_labels)
        return result

    def _scores(self, rows: Array) -> Array:
        if hasattr(self.estimator, 'predict_proba'):
            probabilities = np.asarray(self.estimator.predict_proba(rows), dtype=np.float64)
            scores: Array = np.log((1.0 - FLOOR) * probabilities + FLOOR / self.n_labels)
            return scores
        decisions = np.asarray(self.estimator.decision_function(rows), dtype=np.float64)
        return np.stack((-decisions, decisions), axis=-1) if decisions.ndim == 1 else decisions


def _trees(value: Any, depth: int) -> Iterator[Any]:
    """Yield the trees in an estimator."""
    if depth > 6:
        return
    if type(value).__name__ == 'Tree':
        yield value
    elif isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        for item in np.ravel(np.array(value, dtype=object)) if isinstance(value, np.ndarray) else value:
            yield from _trees(item, depth + 1)
    elif hasattr(value, '__dict__'):
        for item in vars(value).values():
            yield from _trees(item, depth + 1)


def _check_tree(tree: Any, n_features: int) -> None:
    """Raise ModelMismatch at a tree that points outside its arrays: scikit-learn does not check, and would crash."""
    left, right, feature = tree.children_left, tree.children_right, tree.feature
    index = np.arange(len(left))
    leaf = left == -1
    inside = (left > index) & (right > index) & (left < len(left)) & (right < len(left))
    fits = (feature >= 0) & (feature < n_features)
    if not len(left) or not np.all(np.where(leaf, right == -1, inside & fits)):
        raise ModelMismatch('a tree in it points outside its nodes or features')

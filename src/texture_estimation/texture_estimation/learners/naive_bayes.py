"""Naive Bayes: a distribution of its own for each feature, normal or counted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.folds import assign_folds
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.log_probabilities import log_softmax

FOLDS = 5


@dataclass(frozen=True)
class NaiveBayes:
    """Each feature is distributed for each label independently of the others.

    Source: Jamali & Sammut 2010, section IV.B.

    Examples
    --------
    >>> import numpy as np
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> fitted = NaiveBayes().fit(values, codes, groups)
    >>> predictor = NaiveBayes.predictor(fitted.parameters)
    >>> isinstance(predictor, GaussianNaiveBayesPredictor), bool((predictor(values).argmax(axis=1) == codes).all())
    (True, True)
    """

    smoothing: float = param(
        1e-9,
        'Sets the variance added to each class, as a fraction of the variance over all classes; a larger '
        'one smooths more.',
        low=1e-12,
        high=1.0,
    )
    bins: int = param(
        0,
        'Sets the number of equally filled histogram bins per feature; 0 takes normal distributions.',
        low=0,
        high=1000,
    )

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        n_labels = int(y.max()) + 1
        split = assign_folds(y, groups, FOLDS)
        parameters = self._fit(X, y, n_labels)
        if split is None:
            return Fitted(parameters, None, 'not calibrated, as a label has a single window')
        held_out = np.empty((len(y), n_labels))
        for part in np.unique(split[0]):
            held = split[0] == part
            held_out[held] = self.predictor(self._fit(X[~held], y[~held], n_labels))(X[held])
        return Fitted(parameters, held_out, f'not calibrated; growth from {split[1]}')

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> GaussianNaiveBayesPredictor | HistogramNaiveBayesPredictor:
        """Return the predictor made from the stored parameters."""
        return (
            HistogramNaiveBayesPredictor(**parameters)
            if 'edges' in parameters
            else GaussianNaiveBayesPredictor(**parameters)
        )

    def _fit(self, X: Array, y: Codes, n_labels: int) -> dict[str, Array]:
        log_priors = np.log(np.bincount(y, minlength=n_labels) / len(y))
        fitted = self._counted(X, y, n_labels) if self.bins else self._normal(X, y, n_labels)
        return {**fitted, 'log_priors': log_priors}

    def _counted(self, X: Array, y: Codes, n_labels: int) -> dict[str, Array]:
        edges = np.quantile(X, np.arange(1, self.bins) / self.bins, axis=0).T
        places = bins_of(X, edges)
        counts = np.ones((X.shape[1], self.bins, n_labels))  # none is impossible because it never occurred
        np.add.at(counts, (np.arange(X.shape[1]), places, y[:, None]), 1.0)
        return {'edges': edges, 'log_shares': np.log(counts / counts.sum(axis=1, keepdims=True))}

    def _normal(self, X: Array, y: Codes, n_labels: int) -> dict[str, Array]:
        mean, scale = standardisation(X)
        standard = (X - mean) / scale
        own = [standard[y == code] for code in range(n_labels)]
        variances = np.stack([rows.var(axis=0) for rows in own])
        return {
            'mean': mean,
            'scale': scale,
            'centres': np.stack([rows.mean(axis=0) for rows in own]),
            'variances': variances + self.smoothing,
        }


@dataclass(frozen=True, eq=False)
class GaussianNaiveBayesPredictor:
    """Independent normal distributions, as one product with the features and their squares.

    Parameters
    ----------
    mean, scale : (n_features,)
        Of the standardisation.
    centres, variances : (n_labels, n_features)
        Of the standardised features.
    log_priors : (n_labels,)
    """

    mean: Array
    scale: Array
    centres: Array
    variances: Array
    log_priors: Array

    def __post_init__(self) -> None:
        # -(x - c)² / 2v = -x² / 2v + x c / v - c² / 2v
        quadratic = np.concatenate((-0.5 / self.variances, self.centres / self.variances), axis=1)
        constant = -0.5 * (np.log(2.0 * np.pi * self.variances) + self.centres**2 / self.variances).sum(axis=1)
        object.__setattr__(self, '_quadratic', quadratic.T.copy())
        object.__setattr__(self, '_constant', constant + self.log_priors)

    def __call__(self, X: Array) -> Array:
        """Return the log-probability of each label, (..., n_labels) of (..., n_features)."""
        standard = (X - self.mean) / self.scale
        both = np.concatenate((standard * standard, standard), axis=-1)
        scores: Array = both @ self._quadratic + self._constant  # type: ignore[attr-defined]
        return log_softmax(scores)


@dataclass(frozen=True, eq=False)
class HistogramNaiveBayesPredictor:
    """How often each feature lies between which edges.

    Parameters
    ----------
    edges : (n_features, n_bins - 1)
        Ascending.
    log_shares : (n_features, n_bins, n_labels)
    log_priors : (n_labels,)

    Examples
    --------
    >>> edges, shares = np.array([[0.5]]), np.array([[[0.9, 0.2], [0.1, 0.8]]])  # below and above ½, for two labels
    >>> predictor = HistogramNaiveBayesPredictor(edges, np.log(shares), np.log([0.5, 0.5]))
    >>> np.exp(predictor(np.array([0.3]))).round(2).tolist()  # 0.9 : 0.2
    [0.82, 0.18]
    """

    edges: Array
    log_shares: Array
    log_priors: Array

    def __call__(self, X: Array) -> Array:
        """Return the log-probability of each label, (..., n_labels) of (..., n_features)."""
        shares = self.log_shares[np.arange(len(self.edges)), bins_of(X, self.edges)]
        return log_softmax(np.add.reduce(shares, axis=-2) + self.log_priors)


def bins_of(values: Array, edges: Array) -> Codes:
    """Return how many edges, (n_features, n_edges), each value lies above, (..., n_features).

    Parameters
    ----------
    values : (..., n_features)
    edges : (n_features, n_edges)
        Ascending.

    Returns
    -------
    (..., n_features)
        Whole numbers, 0 to n_edges.
    """
    above: Codes = np.count_nonzero(values[..., None] > edges, axis=-1)
    return above

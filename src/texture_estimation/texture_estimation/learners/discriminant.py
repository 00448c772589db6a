# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Linear discriminant analysis with a shrunk covariance, in plain arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.types import Array
from texture_estimation.learners.learner import (
    FORCE,
    UNBOUND,
    Codes,
    Fitted,
    Predictor,
    column_of,
    fit_in_folds,
    shrunk_covariance,
)

# --------------------
# Linear discriminant analysis with a shrunk covariance, as one linear layer.

CONSTANT = 1e-12
ABSENT = 7.0  # how far a label without examples is below the mean score of the others: a thousandth


def linear_discriminant(
    X: Array,
    y: Codes,
    n_labels: int,
    shrinkage: float,
    *,
    weights: Array | None = None,
    stretches: Codes | None = None,
    stretch_weight: float = 0.0,
) -> tuple[Array, Array]:
    """Return the layer that gives the log-probabilities of Gaussian classes with one covariance, up to a constant.

    A label without examples is nowhere the most probable.

    Source: Fisher 1936; Friedman 1989, "Regularized discriminant analysis"; Hatch et al. 2006, "Within-class covariance
    normalization for SVM-based speaker recognition", for the differences between places.
    """
    counted = np.ones(len(X)) if weights is None else weights
    totals = np.bincount(y, counted, n_labels)
    counted = counted / totals[y]  # in each class they add up to 1
    means, present = _sums(X, y, counted, n_labels), totals > 0
    centre = means[~present] = means[present].mean(axis=0)
    rest = X - means[y]
    place_weights = counted / present.sum()
    covariance = (rest.T * place_weights) @ rest
    if stretches is not None and stretch_weight:
        places = np.unique(np.stack([y, stretches]), axis=1, return_inverse=True)[1].reshape(-1)
        shares = np.bincount(places, place_weights)
        between = _sums(rest, places, place_weights, len(shares)) / shares[:, None]
        covariance += stretch_weight * (between.T * shares) @ between
    scale = np.sqrt(np.diag(covariance))
    scale[scale <= CONSTANT * (1.0 + np.abs(centre))] = np.inf
    correlations = shrunk_covariance(covariance / np.outer(scale, scale), shrinkage)
    correlations[np.diag_indices_from(correlations)] += CONSTANT
    relative = (means - centre) / scale
    layer = np.linalg.solve(correlations, relative.T)
    offsets = -0.5 * np.einsum('cf,fc->c', relative, layer)
    # Everywhere the scores of the others have this mean, so that the highest of them is above that of an absent one.
    offsets[~present] = offsets[present].mean() - ABSENT
    layer /= scale[:, None]
    return layer, offsets - centre @ layer


def _sums(X: Array, y: Codes, weights: Array, n_labels: int) -> Array:
    """Return the weighted sum of the examples of each label, (n_labels, n_features)."""
    return np.stack([weights[y == code] @ X[y == code] for code in range(n_labels)])


# --------------------
# The discriminant as a learner: Gaussian classes of one covariance, calibrated on what was held out.


@dataclass(frozen=True)
class Discriminant:
    """Gaussian classes with one covariance, which is shrunk towards its diagonal; one temperature from held-out slides.

    Scores are linear in the features, so that the mean log-probability of the windows is that of the mean features of
    the slide so far. With few parameters it holds where the slides to come differ from those of the training.

    Source: Fisher 1936; Friedman 1989, "Regularized discriminant analysis"; Guo et al. 2017 for the temperature.

    Examples
    --------
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> fitted = Discriminant().fit(values, codes, groups)
    >>> bool((Discriminant.predictor(fitted.parameters)(values).argmax(axis=1) == codes).all())
    True
    """

    extras: ClassVar[tuple[str, ...]] = ('parts',)

    shrinkage: float = param(
        0.1,
        'How far the correlations within classes are shrunk towards 0; more needs fewer slides and separates '
        'less finely.',
        low=0.0,
        high=1.0,
    )
    folds: int = param(
        5, 'Number of cross-validation folds for the calibration; more folds take longer to train.', low=2, high=50
    )

    def fit(self, X: Array, y: Codes, groups: Codes, parts: Codes | None = None) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,).

        Parameters
        ----------
        X : (n, n_features)
            Features of windows; finite.
        y : (n,)
            Number of the label of each, from 0, without gaps.
        groups : (n,)
            Number of the slide of each.
        parts : (n_groups,) or None
            Part in which the slide of each number is held out; by slides if None.

        Returns
        -------
        Fitted
            Parameters, log-probabilities when held out, and a note on the calibration.
        """
        n_labels = int(y.max()) + 1

        def fit(held: NDArray[np.bool_]) -> dict[str, Array]:
            return self._fit(X[~held], y[~held], groups[~held], n_labels)

        tempered = ('weights', 'offsets')
        return fit_in_folds(
            fit, self.predictor, X, y, groups, folds=self.folds, parts=parts, tempered=tempered, most=8.0
        )

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Predictor:
        """Return the predictor made from the stored parameters."""
        weights = np.asarray(parameters['weights'], dtype=np.float64, order='F')
        offsets = np.asarray(parameters['offsets'], dtype=np.float64)
        return lambda X: X @ weights + offsets

    def _fit(self, X: Array, y: Codes, _: Codes, n_labels: int) -> dict[str, Array]:
        weights, offsets = linear_discriminant(X, y, n_labels, self.shrinkage)
        return {'weights': weights, 'offsets': offsets}


# --------------------
# One discriminant for each range of forces: the spectrum that a surface excites changes with the force of the finger.

STRETCHES = 6  # of a slide
ELSEWHERE = 0.02  # of the weight of a window at the middle of a range, for those far from it: no class is without any
FURTHEST = 30.0  # times the reach: a slide made wholly outside still has a label
OUTERMOST = 0.05  # of the windows lie below the trained range, and as many above it


class ForceDiscriminantPredictor:
    """The layer of the nearest force; windows outside the trained forces count less."""

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        self.weights, self.offsets, self.log_forces, self.trained = (
            np.asarray(parameters[name], dtype=np.float64) for name in ('weights', 'offsets', 'log_forces', 'trained')
        )
        self.reach, self.column = float(parameters['reach']), int(parameters['column'])

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""
        force = _log_force(X, self.column)
        near = np.abs(force[..., None] - self.log_forces).argmin(axis=-1)
        scores = np.empty((*near.shape, self.offsets.shape[-1]))
        for number in np.unique(near).tolist():
            rows = near == number
            scores[rows] = X[rows] @ self.weights[number] + self.offsets[number]
        return scores

    def trust(self, X: Array) -> Array:
        """Return how much each window counts, (...) of (..., n_features): less outside the trained forces."""
        force = _log_force(X, self.column)
        beyond = np.maximum(np.maximum(self.trained[0] - force, force - self.trained[1]), 0.0)
        return np.exp(-np.minimum(beyond / self.reach, FURTHEST))


def _log_force(X: Array, column: int) -> Array:
    """Return the logarithm of the force of each window, (...); the same for all where none is a feature."""
    if column == UNBOUND:
        return np.zeros(X.shape[:-1])
    return np.log(np.maximum(X[..., column], CONSTANT))


@dataclass(frozen=True)
class ForceDiscriminant(Discriminant):
    """A shrunk discriminant for each range of forces, and less weight for windows outside the trained forces.

    Amplitude and spectrum of a vibration change with the force, and on a surface that is not level the force changes
    from place to place. A window is therefore classified by what was trained near its force, and one recorded far from
    any trained force carries little information. Differences between places along a slide count more than what
    varies at one place. Needs the feature `force`; without it there is one discriminant for all.

    Source: Fisher 1936; Friedman 1989; Hatch et al. 2006; Cleveland & Devlin 1988, "Locally weighted regression", for
    the weights around a force.

    Examples
    --------
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 2))
    >>> values[:, 1] = np.tile([1.0, 1.2, 1.4, 1.6, 1.8], 8)
    >>> learner = ForceDiscriminant().of_examples(['signal/mean/pac', 'signal/force'], ['cork', 'felt'])
    >>> fitted = learner.fit(values, codes, groups)
    >>> bool((learner.predictor(fitted.parameters)(values).argmax(axis=1) == codes).all())
    True
    """

    ranges: int = param(
        4, 'Number of ranges of force; more follow the force more closely and need more windows.', low=1, high=32
    )
    width: float = param(
        0.1,
        'How far from the middle of a range windows train its discriminant, standard deviation of the logarithm '
        'of the force; a larger one makes the ranges more alike.',
        low=0.01,
        high=10.0,
    )
    reach: float = param(
        0.1,
        'How fast a window counts less outside the trained forces: 1 / e where the logarithm of the force is so '
        'far outside; a smaller one relies on the trained forces alone.',
        low=0.01,
        high=1e6,
    )
    stretch_weight: float = param(
        5.0,
        'How much differences between places along a slide add to the covariance; a larger one relies less on '
        'what changes from place to place.',
        low=0.0,
        high=1e3,
    )
    column: int = param(
        UNBOUND, 'Number of the feature `force`; set by the training from the names of the features.', low=UNBOUND
    )

    def of_examples(self, names: Sequence[str], _labels: Sequence[str]) -> ForceDiscriminant:
        """Return the learner for examples with these features."""
        return replace(self, column=column_of(names, FORCE))

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Predictor:
        """Return the predictor made from the stored parameters."""
        return ForceDiscriminantPredictor(parameters)

    def _fit(self, X: Array, y: Codes, groups: Codes, n_labels: int) -> dict[str, Array]:
        forces = _log_force(X, self.column)
        middles = np.quantile(forces, (np.arange(self.ranges) + 0.5) / self.ranges)
        blind = X.copy()
        if self.column != UNBOUND:
            blind[:, self.column] = 0.0  # constant features carry no information
        stretches = stretches_of(groups, STRETCHES)
        layers = [
            linear_discriminant(
                blind,
                y,
                n_labels,
                self.shrinkage,
                weights=np.exp(-0.5 * ((forces - middle) / self.width) ** 2) + ELSEWHERE,
                stretches=stretches,
                stretch_weight=self.stretch_weight,
            )
            for middle in middles
        ]
        return {
            'weights': np.stack([weights for weights, _ in layers]),
            'offsets': np.stack([offsets for _, offsets in layers]),
            'log_forces': middles,
            'trained': np.quantile(forces, [OUTERMOST, 1.0 - OUTERMOST]),
            'reach': np.array(self.reach),
            'column': np.array(self.column),
        }


def stretches_of(groups: Codes, count: int) -> Codes:
    """Return the stretch of its slide in which each window lies, (n,), of `count` with as many windows each."""
    found = np.zeros(len(groups), dtype=np.intp)
    for group in np.unique(groups):
        rows = np.flatnonzero(groups == group)
        found[rows] = np.arange(len(rows)) * count // len(rows)
    return found

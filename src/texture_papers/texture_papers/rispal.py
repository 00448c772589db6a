# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Roughness by dynamic tactile sensing (Rispal et al.): three regressors of grades.

What the paper describes and what is done here, element by element:

slide
    :Paper: 0.15 m/s, 2.5 N, against the ridges, 700 ms, of which 500 are transformed (IV.B, V.A).
    :Here: The same in preset and experiment.
features
    :Paper: As in the paper on textures, without speed and force (IV.D).
    :Here: The same.
hidden layer
    :Paper: "The transfer function in the hidden layer is linear" (IV.C).
    :Here: The same.
ANN 1
    :Paper: One output, a number from 1 to 5 (IV.C).
    :Here: The output, cut off at 1 and 5.
ANN 5, SVM 5
    :Paper: A boolean for each grade; the mean of those that fire, 0 if none does (IV.C).
    :Here: The same, but none firing is no grade; figures count it separately, and as 0.
people
    :Paper: 30 people, 25 textures, 15 to train and 10 to test, whole grades (III, table I).
    :Here: The same: `ets_roughness.csv`.
search
    :Paper: 20 individuals, 30 generations on the 15 textures (IV.D).
    :Here: `texture experiment roughness --tune`: the same size, 40 of the 200 slides of each texture, 20 halves.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.types import Array
from texture_estimation.learners.learner import Codes, standardisation
from texture_estimation.learners.sklearn_learner import packed, unpacked
from texture_estimation.roughness import REGRESSOR_GRADES as GRADES
from texture_estimation.roughness import ROUGH, SMOOTH
from texture_papers.roberge import (
    LINEAR,
    Network,
    Networks,
    fit_network,
)

# From features (..., n_features) to grades and their standard deviations, (...) each.
Grader = Callable[[Array], tuple[Array, Array]]


def _without_std(grades: Array) -> tuple[Array, Array]:
    """Return grades and their standard deviations, which the paper's regressors do not give."""
    return grades, np.zeros_like(grades)


def mean_of_votes(votes: NDArray[np.bool_]) -> Array:
    """Return the mean of the grades that fired, (...,) of (..., 5); NaN where none did.

    Source: Rispal et al., "Texture roughness estimation using dynamic tactile sensing", section IV.C, where 0 denotes
    for none.
    """
    count = votes.sum(axis=-1)
    total = votes @ GRADES
    return np.divide(total, count, out=np.full(np.shape(total), np.nan), where=count > 0)


def grade_membership(grades: Array) -> NDArray[np.bool_]:
    """Return to which of the five whole grades each grade belongs, (n, 5)."""
    return np.rint(grades)[:, None] == GRADES


# One of this many windows of each texture decides when to stop: MATLAB holds out 15 %.
HELD_OUT = 7


def fit_networks(
    values: Array, targets: Sequence[Array], groups: Codes, *, hidden: int, iterations: int, seed: int
) -> Mapping[str, Any]:
    """Return the fields of `Networks`, one network for each target, (n,), of values (n, n_features)."""
    mean, scale = standardisation(values)
    standard = (values - mean) / scale
    rng = np.random.default_rng(seed)
    held = _held_out(groups)
    fitted = [
        fit_network(Network.random(hidden, values.shape[1], rng, LINEAR), standard, target, held, iterations)
        for target in targets
    ]
    return asdict(Networks.joined(fitted, mean, scale))


def _held_out(textures: Codes) -> Any:
    """Return every seventh window of each texture, (n,) bool."""
    held = np.zeros(len(textures), dtype=bool)
    for code in np.unique(textures):
        held[np.flatnonzero(textures == code)[HELD_OUT - 1 :: HELD_OUT]] = True
    return held


@dataclass(frozen=True)
class Ann1:
    """A network with a hidden layer and one linear output, the grade.

    The paper's text states that the hidden layer is linear, which leaves a linear model whatever its number of neurons.

    Source: Rispal et al., "Texture roughness estimation using dynamic tactile sensing", section IV.C.
    """

    hidden: int = param(
        10,
        'Number of neurons in the hidden layer of a network; more neurons separate finer and cost computing time.',
        low=1,
        high=200,
    )
    iterations: int = param(50, 'Largest number of training iterations.', low=1, high=10_000)
    seed: int = param(0, 'Seed of the initial weights; equal seeds give equal models.', low=0)

    def fit(self, X: Array, y: Array, groups: Codes) -> Mapping[str, Any]:
        """Learn from features `X` (n, n_features), grades `y` (n,) and numbers of the textures, `groups` (n,)."""
        return fit_networks(X, [y], groups, **asdict(self))

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Grader:
        """Return the predictor made from the stored parameters."""
        networks = Networks(**parameters)
        return lambda X: _without_std(np.clip(networks(X)[..., 0], SMOOTH, ROUGH))


VOTE_THRESHOLD = 0.5  # the networks are trained 0 and 1, and their output is rounded


@dataclass(frozen=True)
class Ann5(Ann1):
    """A network per grade that answers yes or no; the grade is the mean of those that fire, none if none does.

    Source: Rispal et al., "Texture roughness estimation using dynamic tactile sensing", section IV.C.
    """

    iterations: int = param(30, 'Largest number of training iterations.', low=1, high=10_000)

    def fit(self, X: Array, y: Array, groups: Codes) -> Mapping[str, Any]:
        """Learn from features `X` (n, n_features), grades `y` (n,) and numbers of the textures, `groups` (n,)."""
        targets = grade_membership(y).T.astype(np.float64)
        return fit_networks(X, list(targets), groups, **asdict(self))

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Grader:
        """Return the predictor made from the stored parameters."""
        networks = Networks(**parameters)
        return lambda X: _without_std(mean_of_votes(networks(X) >= VOTE_THRESHOLD))


@dataclass(frozen=True)
class Svm5:
    """An RBF SVM per grade that answers yes or no; the grade is the mean of those that fire, none if none does.

    Source: Rispal et al., "Texture roughness estimation using dynamic tactile sensing", section IV.C.
    """

    c: float = param(
        10.0,
        'Penalty of a training error (box constraint C); a larger one fits the training data more closely.',
        low=1e-6,
        high=1e9,
    )
    kernel_scale: float = param(
        3.0,
        'Width of the kernel exp(-(d / scale)²) over standardised features; a larger one smooths more.',
        low=1e-9,
        high=1e9,
    )

    def fit(self, X: Array, y: Array, groups: Codes) -> Mapping[str, Any]:
        """Learn from features `X` (n, n_features) and grades `y` (n,)."""
        from sklearn.multiclass import OneVsRestClassifier  # noqa: PLC0415  # takes a second to import
        from sklearn.pipeline import make_pipeline  # noqa: PLC0415
        from sklearn.preprocessing import StandardScaler  # noqa: PLC0415
        from sklearn.svm import SVC  # noqa: PLC0415

        machines = OneVsRestClassifier(SVC(C=self.c, gamma=self.kernel_scale**-2.0))
        with warnings.catch_warnings():
            warnings.filterwarnings('ignore', 'Label .* is present in')  # a grade that no texture has never fires
            fitted = make_pipeline(StandardScaler(), machines).fit(X, grade_membership(y).astype(np.intp))
        return {'packed': packed(fitted, 'SVC')}

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Grader:
        """Return the predictor made from the stored parameters."""
        machines = unpacked(parameters['packed'])

        def grade(X: Array) -> tuple[Array, Array]:
            votes = machines.predict(X.reshape(-1, X.shape[-1])).astype(bool)
            return _without_std(mean_of_votes(votes.reshape(*X.shape[:-1], -1)))

        return grade

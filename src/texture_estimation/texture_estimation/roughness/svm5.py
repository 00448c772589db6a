"""Five support vector machines, one for each grade."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.roughness.grade_votes import grade_membership, mean_of_votes
from texture_estimation.roughness.regressor import GRADES


@dataclass(frozen=True)
class Svm5:
    """An RBF machine for each grade that says yes or no; the grade is the mean of those that fire, none if none does.

    Source: Rispal et al., "Texture roughness estimation using dynamic tactile sensing", section IV.C.

    Examples
    --------
    >>> import numpy as np
    >>> grades, textures = np.repeat([1.0, 3.0, 5.0], 20), np.repeat(np.arange(3), 20)
    >>> values = grades[:, None] + 0.1 * np.random.default_rng(0).standard_normal((60, 1))
    >>> predictor = Svm5.predictor(Svm5().fit(values, grades, textures))
    >>> isinstance(predictor, VotingSvmsPredictor), bool(np.nanmean(np.abs(predictor(values)[0] - grades)) < 0.5)
    (True, True)
    """

    c: float = param(
        10.0,
        'Sets the penalty of a training error (box constraint C); a larger one fits the training data more closely.',
        low=1e-6,
        high=1e9,
    )
    kernel_scale: float = param(
        3.0,
        'Sets the width of the kernel exp(-(d / scale)²) over standardised features; a larger one smooths more.',
        low=1e-9,
        high=1e9,
    )

    def fit(self, X: Array, y: Array, groups: Codes) -> Mapping[str, Any]:
        """Learn from features `X` (n, n_features) and grades `y` (n,)."""
        from sklearn.svm import SVC  # noqa: PLC0415  # takes a second, and a node that only grades has no need of it

        mean, scale = standardisation(X)
        standard = (X - mean) / scale
        weights = np.zeros((len(X), len(GRADES)))
        # A grade that no texture has never fires.
        offsets = np.full(len(GRADES), -1.0)
        for number, member in enumerate(grade_membership(y).T):
            if member.all():
                offsets[number] = 1.0
            elif member.any():
                svc = SVC(C=self.c, kernel='rbf', gamma=self.kernel_scale**-2.0).fit(standard, member)
                weights[svc.support_, number] = svc.dual_coef_[0]
                offsets[number] = svc.intercept_[0]
        used = weights.any(axis=1)
        return {
            'mean': mean,
            'scale': scale,
            'vectors': standard[used],
            'weights': weights[used],
            'offsets': offsets,
            'gamma': self.kernel_scale**-2.0,
        }

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> VotingSvmsPredictor:
        """Return the predictor made from the stored parameters."""
        return VotingSvmsPredictor(**parameters)


@dataclass(frozen=True, eq=False)
class VotingSvmsPredictor:
    """The mean of the grades whose machine fires.

    Parameters
    ----------
    mean, scale : (n_features,)
    vectors : (n_vectors, n_features)
        Support vectors of all machines.
    weights : (n_vectors, 5)
    offsets : (5,)
    gamma
        Of the kernel exp(-gamma d²).
    """

    mean: Array
    scale: Array
    vectors: Array
    weights: Array
    offsets: Array
    gamma: float

    def __call__(self, X: Array) -> tuple[Array, Array]:
        """Return grade and standard deviation, the latter not known."""
        standard = (X - self.mean) / self.scale
        squares = (standard**2).sum(axis=-1)[..., None] + (self.vectors**2).sum(axis=1)
        distances = squares - 2.0 * standard @ self.vectors.T
        grade = mean_of_votes(np.exp(-self.gamma * distances) @ self.weights + self.offsets > 0.0)
        return grade, np.zeros_like(grade)

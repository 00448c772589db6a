"""Gaussian-process regression of the grade, with one point a texture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.roughness.regressor import ROUGH, SMOOTH

MIDDLE = 3.0  # of the scale: the grade of a texture of which nothing is known
# What is known beforehand of the logarithms of the hyperparameters, in grades and in distances between textures:
# mean and standard deviation of slope, of what is not straight, of its length, and of people's disagreement.
PRIOR_MEANS = np.log([0.5, 0.5, 2.0, 0.5])
PRIOR_SPREAD = np.array([1.0, 1.0, 0.5, 0.5])
JITTER = 1e-9


@dataclass(frozen=True)
class GaussianProcess:
    """A straight line plus a smooth function of standardised features, plus noise for each texture.

    The windows of a texture share its grade and its noise: they are one point, their mean. So three thousand windows of
    fifteen textures are fifteen opinions, not three thousand, and the standard deviation says so. The hyperparameters
    maximise the marginal likelihood times a wide prior.

    Source: Rasmussen & Williams 2006, sections 2.2 and 5.4.1.

    Examples
    --------
    >>> import numpy as np
    >>> grades, textures = np.repeat([1.0, 3.0, 5.0], 20), np.repeat(np.arange(3), 20)
    >>> values = grades[:, None] + 0.1 * np.random.default_rng(0).standard_normal((60, 1))
    >>> predictor = GaussianProcess.predictor(GaussianProcess().fit(values, grades, textures))
    >>> isinstance(predictor, GaussianProcessPredictor), bool(np.nanmean(np.abs(predictor(values)[0] - grades)) < 0.5)
    (True, True)
    """

    curved: bool = param(True, 'Whether a nonlinear (RBF) term is added; false: Bayesian linear regression.')

    def fit(self, X: Array, y: Array, groups: Codes) -> Mapping[str, Any]:
        """Learn from features `X` (n, n_features), grades `y` (n,) and numbers of the textures, `groups` (n,).

        Raises
        ------
        InvalidData
            If all windows are of one texture.
        """
        from scipy.optimize import minimize  # noqa: PLC0415

        codes = np.unique(groups)
        if len(codes) < 2:
            raise InvalidData('all graded windows are of one texture; two or more are needed')
        points = np.stack([X[groups == code].mean(axis=0) for code in codes])
        targets = np.array([y[groups == code].mean() for code in codes]) - MIDDLE
        mean, scale = standardisation(points)
        # One unit is the distance of two typical textures, however many features tell of it.
        places = (points - mean) / (scale * np.sqrt(points.shape[1]))
        products, squares = places @ places.T, _squares(places, places)

        def loss(logs: Array) -> float:
            surprise = (logs - PRIOR_MEANS) / PRIOR_SPREAD
            return _surprise(_covariance(self._hyper(logs), products, squares), targets) + 0.5 * float(
                surprise @ surprise
            )

        hyper = self._hyper(minimize(loss, PRIOR_MEANS, method='L-BFGS-B').x)
        covariance = _covariance(hyper, products, squares)
        return {
            'mean': mean,
            'scale': scale * np.sqrt(points.shape[1]),
            'places': places,
            'weights': np.linalg.solve(covariance, targets),
            'precision': np.linalg.inv(covariance),
            'hyper': hyper,
        }

    def _hyper(self, logs: Array) -> Array:
        hyper: Array = np.exp(logs)
        if not self.curved:
            hyper[1] = 0.0
        return hyper

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> GaussianProcessPredictor:
        """Return the predictor made from the stored parameters."""
        return GaussianProcessPredictor(**parameters)


@dataclass(frozen=True, eq=False)
class GaussianProcessPredictor:
    """The posterior at a window's features.

    Parameters
    ----------
    mean, scale : (n_features,)
        Of the standardisation.
    places : (n_textures, n_features)
    weights : (n_textures,)
    precision : (n_textures, n_textures)
        Inverse of the covariance of the grades.
    hyper : (4,)
        Slope, size and length of what is not straight, and noise.
    """

    mean: Array
    scale: Array
    places: Array
    weights: Array
    precision: Array
    hyper: Array

    def __call__(self, X: Array) -> tuple[Array, Array]:
        """Return grade, within 1 and 5, and standard deviation, noise between textures included."""
        place = (X - self.mean) / self.scale
        grade, variance = self._curved(place) if self.hyper[1] else self._straight(place)
        return np.minimum(np.maximum(MIDDLE + grade, SMOOTH), ROUGH), np.sqrt(np.maximum(variance, 0.0))

    def _curved(self, place: Array) -> tuple[Array, Array]:
        slope, size, length, noise = self.hyper
        own = slope**2 * (place * place).sum(axis=-1)
        shared = slope**2 * (place @ self.places.T)
        shared += size**2 * np.exp(-0.5 * _squares(place, self.places) / length**2)
        return shared @ self.weights, own + size**2 + noise**2 - ((shared @ self.precision) * shared).sum(axis=-1)

    def _straight(self, place: Array) -> tuple[Array, Array]:
        line, spread = self._line
        return place @ line, np.add.reduce((place @ spread) * place, axis=-1) + self.hyper[3] ** 2

    @cached_property
    def _line(self) -> tuple[Array, Array]:
        """The posterior of a straight line: mean (n_features,) and covariance (n_features, n_features) of its slopes.

        What `_curved` gives without its smooth function, multiplied out: a third of the time.
        """
        variance = float(self.hyper[0]) ** 2
        line = variance * self.weights @ self.places
        spread = np.eye(self.places.shape[1]) - variance * self.places.T @ self.precision @ self.places
        return line, variance * spread


def _covariance(hyper: Array, products: Array, squares: Array) -> Array:
    """Return the covariance of the grades of textures with noise, (n, n)."""
    slope, size, length, noise = hyper
    smooth = slope**2 * products + size**2 * np.exp(-0.5 * squares / length**2)
    covariance: Array = smooth + (noise**2 + JITTER) * np.eye(len(products))
    return covariance


def _surprise(covariance: Array, targets: Array) -> float:
    """Return the negative logarithm of the marginal likelihood, less a constant."""
    _, log_size = np.linalg.slogdet(covariance)
    return 0.5 * float(targets @ np.linalg.solve(covariance, targets) + log_size)


def _squares(left: Array, right: Array) -> Array:
    """Return the squared distances, (..., n_right) of (..., n_features) and (n_right, n_features)."""
    distances = (left * left).sum(axis=-1)[..., None] + (right * right).sum(axis=1) - 2.0 * left @ right.T
    positive: Array = np.maximum(distances, 0.0)
    return positive

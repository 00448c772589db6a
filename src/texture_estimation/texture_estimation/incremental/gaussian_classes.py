"""Gaussian classes with one covariance, to which classes of a few samples can be added."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from texture_core.arrays import Array
from texture_estimation.group_means import group_means
from texture_estimation.learners.learner import Codes
from texture_estimation.log_probabilities import log_softmax

# Chosen on slides 21-30 of recorded materials, five of twenty added to a model of slides 1-20 of the others.
PRIOR_SAMPLES = 30.0  # the covariance is drawn to its diagonal as by so many further samples
MIN_VARIANCE = 0.01  # within classes, in that of all samples: few samples may agree by chance
MAX_CORRELATED = 1024  # features; of more, the covariance would take minutes and gigabytes, and few slides tell it
CONSTANT = 1e-12  # deviation of a feature that is taken for constant, relative to its largest value


@dataclass(frozen=True, eq=False)
class GaussianClasses:
    """Gaussians with the covariance within the trained classes, wider for a class of which few slides are known.

    The mean of n slides is uncertain: about it, a further slide has the variance of 1 + 1/n slides.

    Parameters
    ----------
    centre : (n_features,)
        Mean of the trained classes.
    projection : (n_features, n_features) or (n_features,)
        Makes the covariance within the trained classes the identity; a vector holds the diagonal of a diagonal one.
    means : (n_classes, n_features)
        Of the classes, less the centre, projected.
    slides : (n_classes,)
        Number of slides of each class.
    uncertainty_exponent
        Of 1 + 1/n in the variance of a class of n slides; 1 would suit slides that do not drift, 0 widens no class.
    inverse_temperature
        Of the log-densities: features are no Gaussians, and sessions drift.

    Examples
    --------
    >>> samples = np.array([[-1.0], [1.0], [9.0], [11.0]])
    >>> classes = GaussianClasses.fit(samples, np.array([0, 0, 1, 1]), np.array([2, 2]))
    >>> with_third = classes.with_classes(np.array([[20.0]]), np.array([1]))
    >>> with_third.log_probabilities(np.array([[0.0], [9.0], [20.0]])).argmax(axis=1).tolist()
    [0, 1, 2]
    """

    centre: Array
    projection: Array
    means: Array
    slides: Codes
    uncertainty_exponent: float = 0.6
    inverse_temperature: float = 0.2

    @classmethod
    def fit(cls, samples: Array, classes: Codes, slides: Codes) -> GaussianClasses:
        """Return the Gaussians of labelled samples.

        Parameters
        ----------
        samples : (n_samples, n_features)
            Such as the mean features of slides.
        classes : (n_samples,)
            Number of the class of each, from 0, without gaps.
        slides : (n_classes,)
            Number of slides of each class.

        Returns
        -------
        GaussianClasses
            More than `MAX_CORRELATED` features are taken for uncorrelated.
        """
        means = group_means(samples, classes)
        deviations = samples - means[classes]
        freedom = len(samples) - len(means)
        scale = _scale(samples, deviations, freedom)
        centre = means.mean(axis=0)
        projection = _projection(deviations / scale, freedom, scale)
        return cls(centre, projection, _projected(means - centre, projection), slides)

    def with_classes(self, means: Array, slides: Codes) -> GaussianClasses:
        """Return the Gaussians with further classes, given by their means and numbers of slides.

        Parameters
        ----------
        means : (n_further, n_features)
        slides : (n_further,)
        """
        further = _projected(means - self.centre, self.projection)
        return replace(self, means=np.concatenate([self.means, further]), slides=np.concatenate([self.slides, slides]))

    def log_probabilities(self, samples: Array) -> Array:
        """Return the log-probability of each class.

        Parameters
        ----------
        samples : (..., n_features)

        Returns
        -------
        (..., n_classes)
        """
        projected = _projected(samples - self.centre, self.projection)
        squares = np.add.reduce(projected * projected, axis=-1, keepdims=True)
        distances = squares - 2.0 * (projected @ self.means.T) + np.add.reduce(self.means * self.means, axis=1)
        variances = (1.0 + 1.0 / self.slides) ** self.uncertainty_exponent
        return log_softmax(-0.5 * self.inverse_temperature * distances / variances)


def _scale(samples: Array, deviations: Array, freedom: int) -> Array:
    """Return the standard deviation of each feature within classes; infinite for one that is constant."""
    overall = samples.var(axis=0)
    constant = np.sqrt(overall) <= CONSTANT * np.abs(samples).max(axis=0)
    within = np.square(deviations).sum(axis=0) / max(freedom, 1)
    scale: Array = np.sqrt(np.where(constant, np.inf, np.maximum(within, MIN_VARIANCE * overall)))
    return scale


def _projection(deviations: Array, freedom: int, scale: Array) -> Array:
    """Return what makes the covariance of these scaled deviations within classes the identity."""
    from scipy.linalg import eigh  # noqa: PLC0415  # takes 0.3 s, and only training needs it

    if deviations.shape[1] > MAX_CORRELATED:
        diagonal: Array = 1.0 / scale
        return diagonal
    covariance = freedom / (freedom + PRIOR_SAMPLES) * (deviations.T @ deviations) / max(freedom, 1)
    np.fill_diagonal(covariance, 1.0)
    variances, directions = eigh(covariance)
    full: Array = directions / np.sqrt(variances) / scale[:, None]
    return full


def _projected(samples: Array, projection: Array) -> Array:
    projected: Array = samples * projection if projection.ndim == 1 else samples @ projection
    return projected

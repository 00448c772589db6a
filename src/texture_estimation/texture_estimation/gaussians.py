# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Distance of the mean features of a slide to the training slides of one class."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from texture_core.types import Array
from texture_estimation.learners.learner import Codes, shrunk_covariance

# Chosen on slides 1-24 against 25-30 of recorded materials, five of twenty left out of the training.
DISTANCE_WINDOWS = 5.0  # number of first windows that determine the distance: later ones drift
NEAREST = 3  # slides to which the distance counts: one alone may be an odd one
SHRINKAGE = 0.6  # of the covariances towards their diagonals: there are hardly more slides than features
FLOOR = 0.18  # of the mean variance within classes, added to each
MAX_DIRECTIONS = 128  # in which slides are compared: those in which classes differ most; more cost time
SMALLEST = 1e-9  # variance within classes, in that of all: slides that are the same to the last bit


@dataclass(frozen=True, eq=False)
class ClassDistance:
    """Squared distance to the nearest slides of a class, less that to the centre of all classes.

    The metric is that of the covariance within classes, as in probabilistic linear discriminant analysis.

    Source: Ioffe 2006, "Probabilistic linear discriminant analysis", with slides in place of the mean of a class.
    """

    projection: Array
    references: Array
    classes: Codes
    centre: Array
    weights: Array

    @classmethod
    def fit(cls, means: Array, classes: Codes) -> ClassDistance:
        """Fit to the means of slides (n_slides, n_features) and the numbers of their classes (n_slides,)."""
        from scipy.linalg import eigh  # noqa: PLC0415  # takes 0.3 s, and only training needs it

        names, codes = np.unique(classes, return_inverse=True)
        scale = means.std(axis=0)
        scale[scale <= 1e-12 * np.abs(means).max(axis=0)] = np.inf  # constant features carry no information
        scaled = means / scale
        class_means = np.stack([scaled[codes == code].mean(axis=0) for code in range(len(names))])
        centre = class_means.mean(axis=0)
        deviations, between_classes = scaled - class_means[codes], class_means - centre
        within = shrunk_covariance(deviations.T @ deviations / max(len(means) - len(names), 1), SHRINKAGE)
        floor = FLOOR * max(float(np.diag(within).mean()), SMALLEST)
        between = shrunk_covariance(between_classes.T @ between_classes / max(len(names) - 1, 1), SHRINKAGE)
        spread, directions = eigh(between, within + floor * np.eye(len(within)))
        spread, directions = spread[-MAX_DIRECTIONS:], directions[:, -MAX_DIRECTIONS:]
        order = np.argsort(classes, kind='stable')
        return cls(
            projection=directions / scale[:, None],
            references=(scaled @ directions)[order],
            classes=classes[order],
            centre=centre @ directions,
            weights=1.0 / (1.0 + np.maximum(spread, 0.0)),
        )

    @cached_property
    def _of_class(self) -> dict[int, tuple[Array, Array]]:
        """Slides of each class relative to the centre, (n_directions, n_own), and half their squares, (n_own,)."""
        found = {}
        for code in np.unique(self.classes).tolist():
            points = self.references[self.classes == code] - self.centre
            found[code] = (points.T, 0.5 * np.einsum('ij,ij->i', points, points))
        return found

    def score(self, mean: Array, code: int) -> Array:
        """Return the score, (...), of mean features (..., n_features) for a class; infinite without its slides."""
        found = self._of_class.get(code)
        if found is None:
            return np.full(mean.shape[:-1], np.inf)
        points, half_squares = found
        projected = mean @ self.projection
        projected -= self.centre
        # Half the squared distances, less half the square of what is away from the centre.
        halves = half_squares - projected @ points
        if halves.shape[-1] > NEAREST:
            halves.partition(NEAREST - 1)
            halves = halves[..., :NEAREST]
        nearest: Array = np.add.reduce(halves, axis=-1) * (2.0 / halves.shape[-1])
        nearest += (projected * projected) @ (1.0 - self.weights)
        return nearest

    def with_slides(self, means: Array, classes: Codes) -> ClassDistance:
        """Return the distance with more reference slides, (n_slides, n_features) and (n_slides,)."""
        references = np.concatenate([self.references, means @ self.projection])
        every = np.concatenate([self.classes, classes])
        order = np.argsort(every, kind='stable')
        return ClassDistance(self.projection, references[order], every[order], self.centre, self.weights)


def compared_start(values: Array, hop_ratio: float) -> Array:
    """Return the mean of what is compared of a slide, (n_compared,) of (n_windows, n_compared): of its start."""
    mean: Array = values[: 1 + round((DISTANCE_WINDOWS - 1.0) / hop_ratio)].mean(axis=0)
    return mean

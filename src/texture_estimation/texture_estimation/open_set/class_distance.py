"""Distance of the mean features of a slide to the training slides of one class."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_estimation.learners.learner import Codes

# Chosen on slides 1-24 against 25-30 of recorded materials, five of twenty left out of the training.
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

    Parameters
    ----------
    projection : (n_features, n_directions)
        Makes the covariance within classes the identity, and that between them diagonal.
    references : (n_slides, n_directions)
        Mean of each training slide, projected; class by class.
    classes : (n_slides,)
        Number of the class of each, ascending.
    centre, weights : (n_directions,)
        Mean of the classes, projected, and one over the variance about it.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> classes = np.repeat([0, 1], 10)
    >>> means = 5.0 * classes[:, None] + 0.1 * rng.standard_normal((20, 2))
    >>> distance = ClassDistance.fit(means, classes)
    >>> distance.score(np.array([0.0, 0.0]), 0) < distance.score(np.array([0.0, 0.0]), 1)
    True
    """

    projection: Array
    references: Array
    classes: Codes
    centre: Array
    weights: Array

    @classmethod
    def fit(cls, means: Array, classes: Codes) -> ClassDistance:
        """Fit to the means of slides (n_slides, n_features) and the numbers of their classes (n_slides,).

        Parameters
        ----------
        means : (n_slides, n_features)
            Mean features of each slide.
        classes : (n_slides,)
            Number of the label of each.
        """
        from scipy.linalg import eigh  # noqa: PLC0415  # takes 0.3 s, and only training needs it

        names, codes = np.unique(classes, return_inverse=True)
        scale = means.std(axis=0)
        scale[scale <= 1e-12 * np.abs(means).max(axis=0)] = np.inf  # what is constant tells nothing
        scaled = means / scale
        own = np.stack([scaled[codes == code].mean(axis=0) for code in range(len(names))])
        centre = own.mean(axis=0)
        within = _covariance(scaled - own[codes], len(means) - len(names))
        floor = FLOOR * max(float(np.diag(within).mean()), SMALLEST)
        between = _covariance(own - centre, len(names) - 1)
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
    def _own(self) -> dict[int, tuple[Array, Array]]:
        """Slides of each class relative to the centre, (n_own, n_directions), and half their squares, (n_own,)."""
        found = {}
        for code in np.unique(self.classes).tolist():
            own = self.references[self.classes == code] - self.centre
            found[code] = (own, 0.5 * np.einsum('ij,ij->i', own, own))
        return found

    @cached_property
    def _directions(self) -> Array:
        """Projection by columns: so a product with one slide is faster."""
        return np.asfortranarray(self.projection)

    @cached_property
    def _nearer(self) -> Array:
        """What the square along each direction counts less about the centre than about a slide, (n_directions,)."""
        return 1.0 - self.weights

    def score(self, mean: Array, code: int) -> float:
        """Return the score of the mean features (n_features,) of a slide for a class; infinite without its slides.

        Parameters
        ----------
        mean : (n_features,)
            Mean features of the slide.
        code
            Number of the label.
        """
        found = self._own.get(code)
        if found is None:
            return np.inf
        own, half_squares = found
        away = mean @ self._directions
        away -= self.centre
        # Half the squared distances, less half the square of what is away from the centre.
        halves = half_squares - own @ away
        if len(halves) > NEAREST:
            halves.partition(NEAREST - 1)
            halves = halves[:NEAREST]
        return 2.0 * float(np.add.reduce(halves)) / len(halves) + float((away * away) @ self._nearer)

    def with_slides(self, means: Array, classes: Codes) -> ClassDistance:
        """Return the distance with more reference slides, (n_slides, n_features) and (n_slides,).

        Parameters
        ----------
        means : (n_slides, n_features)
            Mean features of each further slide.
        classes : (n_slides,)
            Number of the label of each.
        """
        references = np.concatenate([self.references, means @ self.projection])
        every = np.concatenate([self.classes, classes])
        order = np.argsort(every, kind='stable')
        return ClassDistance(self.projection, references[order], every[order], self.centre, self.weights)

    def as_arrays(self) -> dict[str, AnyArray]:
        """Return the arrays for the model file.

        Returns
        -------
        dict
            Name of each field, and its array.
        """
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> ClassDistance:
        """Return what `as_arrays` gave."""
        projection, references, centre, weights = (
            np.asarray(arrays[name], dtype=np.float64) for name in ('projection', 'references', 'centre', 'weights')
        )
        return cls(projection, references, np.asarray(arrays['classes'], dtype=np.intp), centre, weights)


def _covariance(deviations: Array, freedom: int) -> Array:
    """Return the covariance, drawn to its diagonal: few classes do not show all directions in which others differ."""
    covariance = deviations.T @ deviations / max(freedom, 1)
    shrunk: Array = (1.0 - SHRINKAGE) * covariance + SHRINKAGE * np.diag(np.diag(covariance))
    return shrunk

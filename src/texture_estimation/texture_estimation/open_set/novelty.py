"""Whether a surface resembles any that was learnt: the distance to the slides learnt from, against what is usual."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import eigh

from texture_core.arrays import AnyArray, Array
from texture_estimation.learners.learner import Codes

# Chosen on slides 1-24 against 25-30 of recorded materials, five of twenty left out of the training.
NEAREST = 3  # slides to which the distance counts: one alone may be an odd one
SHRINKAGE = 0.6  # of the covariances towards their diagonals: there are hardly more slides than features
FLOOR = 0.18  # of the mean variance within surfaces, added to each
SMALLEST = 1e-9  # variance within surfaces, in that of all: slides that are the same to the last bit
FOLDS = 5
MIN_SLIDES = 3  # of a surface: with one held out, two tell how much slides differ
# Lengths of evidence at which the limit is learnt, in windows that do not overlap. The start of a slide is like no
# other part, so slides are compared by the same stretch: by all that was felt, up to the last of these.
WORTHS = (1.0, 1.5, 2.0, 3.0, 5.0)


@dataclass(frozen=True, eq=False)
class Familiarity:
    """How strange the mean features of a slide are, and from where on they are those of an unknown surface.

    Strange is what is far from the slides that were learnt, measured by how much the slides of one surface differ, and
    nearer to what any surface might be: the squared distance to the nearest slides less that to the centre of all
    surfaces, as in probabilistic discriminant analysis.

    Source: Ioffe 2006, "Probabilistic linear discriminant analysis", with slides in place of the mean of a class.

    Parameters
    ----------
    projection : (n_features, n_features)
        Makes the covariance within surfaces the identity, and that between them diagonal.
    places : (n_slides, n_features)
        Slides that were learnt, projected.
    centre, weights : (n_features,)
        Mean of the surfaces, projected, and one over the variance about it.
    worths, limits : (n,)
        Strangeness that a known surface exceeds as rarely as was asked for, by the length of the evidence.
    """

    projection: Array
    places: Array
    centre: Array
    weights: Array
    worths: Array
    limits: Array

    @cached_property
    def _squares(self) -> Array:
        squares: Array = np.einsum('ij,ij->i', self.places, self.places)
        return squares

    @classmethod
    def learnt(
        cls, values: Array, codes: Codes, groups: Codes, overlap: float, false_rejections: float
    ) -> Familiarity | None:
        """Learn from the windows of slides, in the order of time; None if there are too few.

        Each surface needs LEAST_SLIDES, and all together one over the share of false rejections.

        Parameters
        ----------
        values : (n, n_features)
        codes, groups : (n,)
            Number of the surface and of the slide of each window.
        overlap
            Distance of two windows over their length, at most 1.
        false_rejections
            Share of the slides over known surfaces that may be taken for unknown: of new slides like those held out, no
            more are, on average.
        """
        slides = [np.flatnonzero(groups == group) for group in np.unique(groups)]
        surfaces = codes[[rows[0] for rows in slides]]
        allowed = math.floor((len(slides) + 1) * false_rejections)
        own = np.unique(surfaces, return_counts=True)[1]
        if len(own) < 2 or own.min() < MIN_SLIDES or not allowed:
            return None
        means = np.stack([values[rows[: _count(WORTHS[-1], overlap)]].mean(axis=0) for rows in slides])
        strange: list[list[float]] = [[] for _ in WORTHS]
        for train, test in _folds(surfaces):
            known = cls._of(means[train], surfaces[train])
            for slide in np.flatnonzero(test):
                for level, worth in enumerate(WORTHS):
                    part = slides[slide][: _count(worth, overlap)]
                    strange[level].append(float(known.strangeness(values[part].mean(axis=0))))
        limits = [sorted(level)[-allowed] for level in strange]
        whole = cls._of(means, surfaces)
        return cls(whole.projection, whole.places, whole.centre, whole.weights, np.array(WORTHS), np.array(limits))

    def strangeness(self, mean_values: Array) -> float:
        """Return how strange the mean (n_features,) of the first windows of a slide is; higher is stranger."""
        place = mean_values @ self.projection
        off = self._squares - 2.0 * (self.places @ place)
        near = np.partition(off, min(NEAREST, len(off)) - 1)[:NEAREST]
        away = place - self.centre
        return float(near.mean() + place @ place - (away * away) @ self.weights)

    def knows(self, mean_values: Array, worth: float) -> bool:
        """Return whether a surface resembles one that was learnt, after evidence worth so many windows."""
        return self.strangeness(mean_values) <= float(np.interp(worth, self.worths, self.limits))

    def with_slides(self, slides: Sequence[Array], overlap: float) -> Familiarity:
        """Return the same, knowing more slides by their windows, (n_windows, n_features) each, in the order of time."""
        means = np.stack([values[: _count(WORTHS[-1], overlap)].mean(axis=0) for values in slides])
        places = np.concatenate([self.places, means @ self.projection])
        return Familiarity(self.projection, places, self.centre, self.weights, self.worths, self.limits)

    def as_parts(self) -> dict[str, AnyArray]:
        """Return the arrays for the model file."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    @classmethod
    def from_parts(cls, parts: Mapping[str, Any]) -> Familiarity:
        """Return what `as_parts` gave."""
        return cls(*(np.asarray(parts[name], dtype=np.float64) for name in cls.__dataclass_fields__))

    @classmethod
    def _of(cls, means: Array, surfaces: Codes) -> Familiarity:
        """Learn the distance from slides, without limits."""
        names, codes = np.unique(surfaces, return_inverse=True)
        scale = means.std(axis=0)
        scale[scale <= 1e-12 * np.abs(means).max(axis=0)] = np.inf  # what is constant tells nothing
        scaled = means / scale
        own = np.stack([scaled[codes == code].mean(axis=0) for code in range(len(names))])
        centre = own.mean(axis=0)
        within = _covariance(scaled - own[codes], len(means) - len(names))
        floor = FLOOR * max(float(np.diag(within).mean()), SMALLEST)
        between = _covariance(own - centre, len(names) - 1)
        spread, directions = eigh(between, within + floor * np.eye(len(within)))
        nothing = np.zeros(0)
        return cls(
            projection=directions / scale[:, None],
            places=scaled @ directions,
            centre=centre @ directions,
            weights=1.0 / (1.0 + np.maximum(spread, 0.0)),
            worths=nothing,
            limits=nothing,
        )


def _count(worth: float, overlap: float) -> int:
    """Return how many windows are worth so many that do not overlap."""
    return 1 + round((worth - 1.0) / overlap)


def _covariance(deviations: Array, freedom: int) -> Array:
    """Return the covariance, drawn to its diagonal: few surfaces do not show all directions in which others differ."""
    covariance = deviations.T @ deviations / max(freedom, 1)
    shrunk: Array = (1.0 - SHRINKAGE) * covariance + SHRINKAGE * np.diag(np.diag(covariance))
    return shrunk


def _folds(surfaces: Codes) -> Iterator[tuple[AnyArray, AnyArray]]:
    """Yield train and test slides of each part; neighbours in time are apart, for a limit that is not too generous."""
    part = np.empty(len(surfaces), dtype=np.intp)
    for surface in np.unique(surfaces):
        rows = np.flatnonzero(surfaces == surface)
        part[rows] = np.arange(len(rows)) % FOLDS
    for held in np.unique(part):
        yield part != held, part == held

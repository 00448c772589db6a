"""Novelty detection: the distance of a slide to the training slides."""

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
# Lengths of evidence at which the threshold is fitted, in windows that do not overlap. The start of a slide is like no
# other part, so slides are compared by the same stretch: by all that was measured, up to the last of these.
EFFECTIVE_WINDOWS = (1.0, 1.5, 2.0, 3.0, 5.0)


@dataclass(frozen=True, eq=False)
class NoveltyDetector:
    """Novelty score of the mean features of a slide, and the threshold above which the surface is unknown.

    The score is the squared distance to the nearest training slides less that to the centre of all surfaces, in the
    metric of the covariance within surfaces, as in probabilistic linear discriminant analysis.

    Source: Ioffe 2006, "Probabilistic linear discriminant analysis", with slides in place of the mean of a class.

    Parameters
    ----------
    projection : (n_features, n_features)
        Makes the covariance within surfaces the identity, and that between them diagonal.
    references : (n_slides, n_features)
        Training slides, projected.
    centre, weights : (n_features,)
        Mean of the surfaces, projected, and one over the variance about it.
    effective_window_counts, thresholds : (n,)
        Score that known surfaces exceed at the false rejection rate, by the effective window count.
    """

    projection: Array
    references: Array
    centre: Array
    weights: Array
    effective_window_counts: Array
    thresholds: Array

    @cached_property
    def _squares(self) -> Array:
        squares: Array = np.einsum('ij,ij->i', self.references, self.references)
        return squares

    @classmethod
    def fit(
        cls, values: Array, codes: Codes, groups: Codes, overlap: float, false_rejection_rate: float
    ) -> NoveltyDetector | None:
        """Fit to the windows of slides, in temporal order; return None if there are too few.

        Each surface needs LEAST_SLIDES, and all together one over the share of false rejections.

        Parameters
        ----------
        values : (n, n_features)
        codes, groups : (n,)
            Number of the surface and of the slide of each window.
        overlap
            Distance of two windows over their length, at most 1.
        false_rejection_rate
            Share of the slides over known surfaces that may be taken for unknown: of new slides like those held out, no
            more are, on average.
        """
        slides = [np.flatnonzero(groups == group) for group in np.unique(groups)]
        surfaces = codes[[rows[0] for rows in slides]]
        allowed = math.floor((len(slides) + 1) * false_rejection_rate)
        own = np.unique(surfaces, return_counts=True)[1]
        if len(own) < 2 or own.min() < MIN_SLIDES or not allowed:
            return None
        means = np.stack([values[rows[: _count(EFFECTIVE_WINDOWS[-1], overlap)]].mean(axis=0) for rows in slides])
        novelty_scores: list[list[float]] = [[] for _ in EFFECTIVE_WINDOWS]
        for train, test in _folds(surfaces):
            known = cls._of(means[train], surfaces[train])
            for slide in np.flatnonzero(test):
                for level, effective_windows in enumerate(EFFECTIVE_WINDOWS):
                    part = slides[slide][: _count(effective_windows, overlap)]
                    novelty_scores[level].append(float(known.novelty_score(values[part].mean(axis=0))))
        thresholds = [sorted(level)[-allowed] for level in novelty_scores]
        whole = cls._of(means, surfaces)
        return cls(
            whole.projection,
            whole.references,
            whole.centre,
            whole.weights,
            np.array(EFFECTIVE_WINDOWS),
            np.array(thresholds),
        )

    def novelty_score(self, mean_values: Array) -> float:
        """Return the novelty score of the mean (n_features,) of the first windows of a slide."""
        projected = mean_values @ self.projection
        off = self._squares - 2.0 * (self.references @ projected)
        near = np.partition(off, min(NEAREST, len(off)) - 1)[:NEAREST]
        away = projected - self.centre
        return float(near.mean() + projected @ projected - (away * away) @ self.weights)

    def is_known(self, mean_values: Array, effective_windows: float) -> bool:
        """Return whether the novelty score is below the threshold for this effective window count."""
        return self.novelty_score(mean_values) <= float(
            np.interp(effective_windows, self.effective_window_counts, self.thresholds)
        )

    def with_slides(self, slides: Sequence[Array], overlap: float) -> NoveltyDetector:
        """Return the detector with more reference slides, (n_windows, n_features) each, in temporal order."""
        means = np.stack([values[: _count(EFFECTIVE_WINDOWS[-1], overlap)].mean(axis=0) for values in slides])
        references = np.concatenate([self.references, means @ self.projection])
        return NoveltyDetector(
            self.projection, references, self.centre, self.weights, self.effective_window_counts, self.thresholds
        )

    def as_arrays(self) -> dict[str, AnyArray]:
        """Return the arrays for the model file."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    @classmethod
    def from_arrays(cls, parameters: Mapping[str, Any]) -> NoveltyDetector:
        """Return what `as_arrays` gave."""
        return cls(*(np.asarray(parameters[name], dtype=np.float64) for name in cls.__dataclass_fields__))

    @classmethod
    def _of(cls, means: Array, surfaces: Codes) -> NoveltyDetector:
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
            references=scaled @ directions,
            centre=centre @ directions,
            weights=1.0 / (1.0 + np.maximum(spread, 0.0)),
            effective_window_counts=nothing,
            thresholds=nothing,
        )


def _count(effective_windows: float, overlap: float) -> int:
    """Return how many windows count as so many that do not overlap."""
    return 1 + round((effective_windows - 1.0) / overlap)


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

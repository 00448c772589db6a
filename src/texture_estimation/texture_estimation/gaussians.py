# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Class-conditional Gaussians with shrunken covariances, and what they are fitted to."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from texture_core.types import Array
from texture_estimation.learners.learner import Codes, group_means, log_softmax, shrunk_covariance

# --------------------
# Gaussian classes with one covariance, to which classes of a few samples can be added.

# Chosen on slides 21-30 of recorded materials, five of twenty added to a model of slides 1-20 of the others.
PRIOR_SAMPLES = 30.0  # the covariance is shrunk towards its diagonal as by this many further samples
MIN_VARIANCE = 0.01  # within classes, in that of all samples: few samples may agree by chance
MAX_CORRELATED = 1024  # features; of more, the covariance would take minutes and gigabytes, and few slides determine it
CONSTANT = 1e-12  # largest deviation of a constant feature, relative to its largest value


@dataclass(frozen=True, eq=False)
class GaussianClasses:
    """Gaussians with the covariance within the trained classes, wider for a class of which few slides are known.

    The mean of n slides is uncertain: about it, a further slide has the variance of 1 + 1/n slides.
    """

    centre: Array
    projection: Array
    means: Array
    slides: Codes
    uncertainty_exponent: float = 0.6
    inverse_temperature: float = 0.2

    @classmethod
    def fit(cls, samples: Array, classes: Codes, slides: Codes) -> GaussianClasses:
        """Return the Gaussians of labelled samples."""
        means = group_means(samples, classes)
        deviations = samples - means[classes]
        freedom = len(samples) - len(means)
        scale = within_scale(samples, deviations, freedom, MIN_VARIANCE)
        centre = means.mean(axis=0)
        projection = _projection(deviations / scale, freedom, scale)
        return cls(centre, projection, _projected(means - centre, projection), slides)

    def with_classes(self, means: Array, slides: Codes) -> GaussianClasses:
        """Return the Gaussians with further classes, given by their means and numbers of slides."""
        further = _projected(means - self.centre, self.projection)
        return replace(self, means=np.concatenate([self.means, further]), slides=np.concatenate([self.slides, slides]))

    def log_probabilities(self, samples: Array) -> Array:
        """Return the log-probability of each class."""
        projected = _projected(samples - self.centre, self.projection)
        squares = np.add.reduce(projected * projected, axis=-1, keepdims=True)
        distances = squares - 2.0 * (projected @ self.means.T) + np.add.reduce(self.means * self.means, axis=1)
        variances = (1.0 + 1.0 / self.slides) ** self.uncertainty_exponent
        return log_softmax(-0.5 * self.inverse_temperature * distances / variances)


def within_scale(samples: Array, deviations: Array, freedom: int, least: float) -> Array:
    """Return the deviation of each feature within classes, of all at least this variance; infinite for a constant."""
    overall = samples.var(axis=0)
    constant = np.sqrt(overall) <= CONSTANT * np.abs(samples).max(axis=0)
    within = np.square(deviations).sum(axis=0) / max(freedom, 1)
    return np.sqrt(np.where(constant, np.inf, np.maximum(within, least * overall)))


def _projection(deviations: Array, freedom: int, scale: Array) -> Array:
    """Return what makes the covariance of these scaled deviations within classes the identity."""
    from scipy.linalg import eigh  # noqa: PLC0415  # takes 0.3 s, and only training needs it

    if deviations.shape[1] > MAX_CORRELATED:
        return 1.0 / scale
    products = deviations.T @ deviations / max(freedom, 1)
    covariance = shrunk_covariance(products, PRIOR_SAMPLES / (freedom + PRIOR_SAMPLES))
    np.fill_diagonal(covariance, 1.0)
    variances, directions = eigh(covariance)
    return directions / np.sqrt(variances) / scale[:, None]


def _projected(samples: Array, projection: Array) -> Array:
    return samples * projection if projection.ndim == 1 else samples @ projection


# --------------------
# Gaussians of whole slides: they distinguish added textures from the trained ones and from each other.

# Lengths of the start of a slide that have separate Gaussians, in windows that do not overlap: the start of a
# slide is like no other part of it.
LENGTHS = (1.0, 2.0, 3.0, 5.0, 9.0)
WHOLE = 0.9  # of the typical length of the trained slides: from here on a slide is compared with whole ones
# Chosen as the constants of the Gaussians. Short starts of slides decide little, and should not go to a new texture.
SHORT_EXPONENT = 0.4
WINDOW_EXPONENT, WINDOW_INVERSE_TEMPERATURE = 0.0, 0.5
SPREAD_LENGTH = 9.0  # from here on, the logarithm of the deviation of the windows helps; of fewer windows it is noise
SPREAD_FLOOR = 0.01  # of the mean variance of the windows within a slide, added to each: slides that are constant


@dataclass(frozen=True, eq=False)
class SlideGaussians:
    """Probability of each texture in a slide, by the mean and the deviation of its features so far.

    The first classes are the trained textures. The further ones are the textures of the added slides, which may include
    trained ones: slides that were added to a trained texture are a separate class.
    """

    windows: GaussianClasses
    lengths: tuple[float, ...]
    starts: tuple[GaussianClasses, ...]
    spread_floor: Array
    n_trained: int
    added: Codes

    @classmethod
    def fit(
        cls, values: Array, codes: Codes, slides: Codes, hop_ratio: float, compared: Array | float = 1.0
    ) -> SlideGaussians:
        """Return the Gaussians of the trained textures."""
        values = compared * values
        order = np.argsort(slides, kind='stable')
        first = np.unique(slides[order], return_index=True)[1]
        parts = np.split(values[order], first[1:])
        classes = codes[order][first]
        counts = np.bincount(classes)
        typical = 1.0 + (float(np.median([len(part) for part in parts])) - 1.0) * hop_ratio
        whole = max(WHOLE * typical, LENGTHS[0])
        lengths = (*(length for length in LENGTHS if length < whole), whole)
        variance = SPREAD_FLOOR * np.mean([part.var(axis=0) for part in parts], axis=0)
        fitted = cls(
            replace(
                GaussianClasses.fit(values, codes, counts),
                uncertainty_exponent=WINDOW_EXPONENT,
                inverse_temperature=WINDOW_INVERSE_TEMPERATURE,
            ),
            lengths,
            (),
            np.where(variance > 0.0, variance, 1.0),
            len(counts),
            np.empty(0, dtype=np.intp),
        )
        described = [fitted._described(part, hop_ratio) for part in parts]
        starts = [GaussianClasses.fit(np.stack(rows), classes, counts) for rows in zip(*described, strict=True)]
        short = sum(length < SPREAD_LENGTH for length in lengths)
        starts[:short] = [replace(start, uncertainty_exponent=SHORT_EXPONENT) for start in starts[:short]]
        return replace(fitted, starts=tuple(starts))

    def with_added(self, slides: Sequence[Array], codes: Codes, hop_ratio: float = 1.0) -> SlideGaussians:
        """Return the Gaussians of the trained textures and of these added slides, in place of others added before."""
        added, groups = np.unique(codes, return_inverse=True)
        counts = np.bincount(groups)
        trained = self.trained
        described = [self._described(values, hop_ratio) for values in slides]
        means = [group_means(np.stack(rows), groups) for rows in zip(*described, strict=True)]
        starts = tuple(start.with_classes(mean, counts) for start, mean in zip(trained.starts, means, strict=True))
        single = group_means(np.stack([values.mean(axis=0) for values in slides]), groups)
        return replace(trained, windows=trained.windows.with_classes(single, counts), starts=starts, added=added)

    @property
    def trained(self) -> SlideGaussians:
        """Those of the trained textures alone."""
        windows, *starts = (
            replace(classes, means=classes.means[: self.n_trained], slides=classes.slides[: self.n_trained])
            for classes in (self.windows, *self.starts)
        )
        return replace(self, windows=windows, starts=tuple(starts), added=self.added[:0])

    def log_proba(self, mean: Array, variance: Array, effective_windows: float) -> Array:
        """Return the log-probability of each class for a slide so far."""
        place = max(bisect_right(self.lengths, effective_windows + 1e-9) - 1, 0)
        return self.starts[place].log_probabilities(self._descriptor(mean, variance, self.lengths[place]))

    def combined(self, trained: Array, log_proba: Array) -> Array:
        """Return the probability of each label: the trained textures keep the ratios of their probabilities."""
        proba = np.exp(log_proba)
        n_labels = max(self.n_trained, int(self.added.max(initial=-1)) + 1)
        probabilities = np.zeros((*proba.shape[:-1], n_labels))
        together = np.add.reduce(proba[..., : self.n_trained], axis=-1, keepdims=True)
        probabilities[..., : self.n_trained] = together * trained
        probabilities[..., self.added] += proba[..., self.n_trained :]
        return probabilities

    def check(self, mean: Array) -> None:
        """Raise ValueError unless a slide with this mean, (n_features,), has finite probabilities at every length."""
        if not all(np.isfinite(self.log_proba(mean, np.zeros_like(mean), length)).all() for length in self.lengths):
            raise ValueError('its values are too large to be features')

    def _described(self, values: Array, hop_ratio: float) -> list[Array]:
        """Return the descriptor of the start of a slide of each length; the last one is of the whole slide."""
        ends = [*(window_count(length, hop_ratio) for length in self.lengths[:-1]), len(values)]
        parts = [values[:end] for end in ends]
        return [
            self._descriptor(part.mean(axis=0), part.var(axis=0), length)
            for part, length in zip(parts, self.lengths, strict=True)
        ]

    def _descriptor(self, mean: Array, variance: Array, length: float) -> Array:
        if length < SPREAD_LENGTH:
            return mean
        return np.concatenate([mean, 0.5 * np.log(variance + self.spread_floor)])


# --------------------
# Running mean and variance of the features of a slide.


class SlideMoments:
    """Mean and variance of the windows of one slide so far, updated in constant memory.

    Source: Welford 1962 for the update without cancellation.
    """

    def __init__(self, n_features: int) -> None:
        self.mean: Array = np.zeros(n_features)
        self.variance: Array = np.zeros(n_features)
        self._count = 0

    def add(self, values: Array) -> None:
        """Add a window."""
        self._count += 1
        before = values - self.mean
        self.mean = self.mean + before / self._count
        self.variance = self.variance + (before * (values - self.mean) - self.variance) / self._count


# --------------------
# Distance of the mean features of a slide to the training slides of one class.

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
    mean: Array = values[: window_count(DISTANCE_WINDOWS, hop_ratio)].mean(axis=0)
    return mean


def window_count(effective_windows: float, hop_ratio: float) -> int:
    """Return how many windows are equivalent to this many that do not overlap."""
    return 1 + round((effective_windows - 1.0) / hop_ratio)

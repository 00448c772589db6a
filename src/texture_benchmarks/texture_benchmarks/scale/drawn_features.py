"""Features of simulated textures and slides, drawn with the covariances that recorded slides have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle, islice

import numpy as np
from scipy.linalg import eigh

from texture_core.arrays import AnyArray, Array
from texture_estimation.group_means import group_means
from texture_features.augmentation.augmented_features import NOISE
from texture_features.augmentation.disturbances import KINDS
from texture_features.augmentation.feature_copies import AugmentedFeatures, FeatureCopies
from texture_features.labelled_features import LabelledFeatures

GAIN_RESPONSES = {'log_bands': 2.0, 'log_power': 2.0, 'log_amplitude': 1.0}  # per natural logarithm of the gain


@dataclass(frozen=True)
class DrawnSize:
    """How much is drawn.

    Parameters
    ----------
    labels
        Number of textures.
    slides
        Slides of each.
    windows
        Windows of each slide.
    copies, disturbed
        Augmented and disturbed copies of each slide.
    """

    labels: int
    slides: int
    windows: int
    copies: int = 0
    disturbed: int = 0


@dataclass(frozen=True, eq=False)
class FeatureSpread:
    """How features vary among textures, among slides over one, and among windows of one.

    Parameters
    ----------
    like
        Recorded examples, of which names, fingerprint and windows are taken.
    mean : (n_features,)
        Of the textures.
    among_textures, among_slides, among_windows : (n_features, n_features)
        Square roots of the covariances: rows of standard normal numbers times these have them.
    """

    like: LabelledFeatures
    mean: Array
    among_textures: Array
    among_slides: Array
    among_windows: Array

    @classmethod
    def of(cls, examples: LabelledFeatures) -> FeatureSpread:
        """Measure the covariances of recorded slides.

        Parameters
        ----------
        examples
            Windows of several slides over several textures.
        """
        _, first, groups = np.unique(examples.groups, return_index=True, return_inverse=True)
        classes = np.unique(examples.labels[first], return_inverse=True)[1]
        slides = group_means(examples.values, groups)
        textures = group_means(slides, classes)
        return cls(
            examples,
            textures.mean(axis=0),
            _root(textures - textures.mean(axis=0)),
            _root(slides - textures[classes]),
            _root(examples.values - slides[groups]),
        )

    def textures(self, labels: int, rng: np.random.Generator) -> Array:
        """Return the centres of so many textures.

        Returns
        -------
        (labels, n_features)
            In the units of the features.
        """
        return self.mean + rng.standard_normal((labels, len(self.mean))) @ self.among_textures

    def slides(self, textures: Array, size: DrawnSize, rng: np.random.Generator, first: int = 1) -> LabelledFeatures:
        """Return windows of slides over textures, and their copies.

        Parameters
        ----------
        textures : (size.labels, n_features)
            Centres of the textures.
        size
            How much.
        rng
            Draws slides and windows.
        first
            Number of the first slide of each texture.

        Returns
        -------
        LabelledFeatures
            Slide by slide.
        """
        names = [f't{number:04d}' for number in range(size.labels)]
        slides = np.array([f'{name}/{first + number}' for name in names for number in range(size.slides)])
        means = np.repeat(textures, size.slides, axis=0)
        means = means + rng.standard_normal(means.shape) @ self.among_slides
        return LabelledFeatures(
            values=self._windows(means, size.windows, rng),
            labels=np.repeat(names, size.slides * size.windows),
            groups=np.repeat(slides, size.windows),
            names=self.like.names,
            feature_set=self.like.feature_set,
            window_s=self.like.window_s,
            hop_s=self.like.hop_s,
            augmented=self._augmented(means, slides, size, rng) if size.copies else None,
        )

    def _augmented(
        self, means: Array, slides: AnyArray, size: DrawnSize, rng: np.random.Generator
    ) -> AugmentedFeatures:
        """Return copies: other windows of the same slides, that half of the copies are called noisy for their cost."""
        response = [next((r for part, r in GAIN_RESPONSES.items() if part in name), 0.0) for name in self.like.names]
        return AugmentedFeatures(
            self._copies(means, slides, size.windows, _first(size.copies, ('', NOISE)), rng=rng),
            self._copies(means, slides, size.windows, _first(size.disturbed, KINDS), rng=rng),
            np.array(response),
        )

    def _copies(
        self, means: Array, slides: AnyArray, windows: int, kinds: Sequence[str], *, rng: np.random.Generator
    ) -> FeatureCopies:
        count = len(kinds)
        values = np.empty((len(slides), count, windows, len(self.mean)), dtype=np.float32)
        for number in range(count):
            values[:, number] = self._windows(means, windows, rng).reshape(len(slides), windows, -1)
        return FeatureCopies(
            values.reshape(-1, len(self.mean)),
            np.repeat(slides, count * windows),
            np.tile(np.repeat(np.arange(count), windows), len(slides)),
            np.tile(np.repeat(kinds, windows), len(slides)),
        )

    def _windows(self, means: Array, windows: int, rng: np.random.Generator) -> Array:
        drawn = rng.standard_normal((len(means) * windows, means.shape[1])) @ self.among_windows
        drawn += np.repeat(means, windows, axis=0)
        return drawn


def _first(count: int, kinds: Sequence[str]) -> list[str]:
    """Return so many kinds, one after the other and again from the first."""
    return list(islice(cycle(kinds), count))


def _root(deviations: Array) -> Array:
    """Return the symmetric square root of a covariance, from deviations (n, n_features)."""
    values, vectors = eigh(deviations.T @ deviations / max(1, len(deviations) - 1))
    root: Array = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return root

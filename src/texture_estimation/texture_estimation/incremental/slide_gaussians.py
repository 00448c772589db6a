"""Gaussians of whole slides: what tells added textures from the trained ones and from each other."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from texture_core.arrays import Array
from texture_estimation.group_means import group_means
from texture_estimation.incremental.gaussian_classes import GaussianClasses
from texture_estimation.learners.learner import Codes
from texture_estimation.open_set.novelty import window_count

# Lengths of the start of a slide that have Gaussians of their own, in windows that do not overlap: the start of a
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
    """Share of each texture in a slide, by the mean and the deviation of its features so far.

    The first classes are the trained textures. The further ones are the textures of the added slides, which may include
    trained ones: slides that were added to a trained texture are a class of their own.

    Parameters
    ----------
    windows
        Gaussians of single windows, wherever they lie in a slide.
    lengths
        Lengths of slides that have Gaussians, in effective windows, rising.
    starts
        Gaussians of slides of each length; those of the last length are of whole slides.
    spread_floor : (n_features,)
        Added to the variance within a slide.
    n_trained
        Number of trained textures.
    added : (n_added,)
        Number of the label of each further class.

    Examples
    --------
    >>> values = np.array([0.0, 0.2, 0.1, 0.3, 5.0, 5.2, 5.1, 5.3])[:, None]
    >>> classes, slides = np.repeat([0, 1], 4), np.repeat([0, 1, 2, 3], 2)
    >>> gaussians = SlideGaussians.fit(values, classes, slides, overlap=1.0)
    >>> three = gaussians.with_added([np.array([[9.0], [9.2]])], np.array([2]))
    >>> three.combined(np.array([0.5, 0.5]), three.window_shares(np.array([9.1]))).round(2).tolist()
    [0.0, 0.0, 1.0]
    """

    windows: GaussianClasses
    lengths: tuple[float, ...]
    starts: tuple[GaussianClasses, ...]
    spread_floor: Array
    n_trained: int
    added: Codes

    @classmethod
    def fit(
        cls, values: Array, codes: Codes, slides: Codes, overlap: float, compared: Array | float = 1.0
    ) -> SlideGaussians:
        """Return the Gaussians of the trained textures.

        Parameters
        ----------
        values : (n, n_features)
            Features of windows, in temporal order within each slide.
        codes, slides : (n,)
            Number of the texture, from 0, and of the slide of each.
        overlap
            Distance of two windows of a slide over their length.
        compared : (n_features,)
            0 for features that are left out.

        Returns
        -------
        SlideGaussians
            Without added slides.
        """
        values = compared * values
        order = np.argsort(slides, kind='stable')
        first = np.unique(slides[order], return_index=True)[1]
        parts = np.split(values[order], first[1:])
        classes = codes[order][first]
        counts = np.bincount(classes)
        typical = 1.0 + (float(np.median([len(part) for part in parts])) - 1.0) * overlap
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
        described = [fitted._described(part, overlap) for part in parts]
        starts = [GaussianClasses.fit(np.stack(rows), classes, counts) for rows in zip(*described, strict=True)]
        return replace(fitted, starts=tuple(map(_of_length, starts, lengths)))

    def with_added(self, slides: Sequence[Array], codes: Codes, overlap: float = 1.0) -> SlideGaussians:
        """Return the Gaussians of the trained textures and of these added slides, in place of others added before.

        Parameters
        ----------
        slides : each (n_windows, n_features)
            Features of the windows of each added slide, in temporal order.
        codes : (n_slides,)
            Number of the label of each.
        overlap
            Distance of two windows of a slide over their length.

        Returns
        -------
        SlideGaussians
        """
        added, groups = np.unique(codes, return_inverse=True)
        counts = np.bincount(groups)
        trained = self.trained
        described = [self._described(values, overlap) for values in slides]
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

    def shares(self, mean: Array, variance: Array, effective_windows: float) -> Array:
        """Return the log-probability of each class for a slide so far.

        Parameters
        ----------
        mean, variance : (n_features,)
            Of the features of its windows.
        effective_windows
            Effective window count so far.

        Returns
        -------
        (n_classes,)
        """
        place = max(bisect_right(self.lengths, effective_windows + 1e-9) - 1, 0)
        return self.starts[place].log_probabilities(self._descriptor(mean, variance, self.lengths[place]))

    def window_shares(self, X: Array) -> Array:
        """Return the log-probability of each class for windows alone.

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n_classes)
        """
        return self.windows.log_probabilities(X)

    def combined(self, trained: Array, shares: Array) -> Array:
        """Return the probability of each label: the trained textures share what they have together as they were.

        Parameters
        ----------
        trained : (..., n_trained)
            Probabilities of the trained textures among themselves.
        shares : (..., n_classes)
            Log-probabilities of all classes.

        Returns
        -------
        (..., n_labels)
            They add up to 1.
        """
        own = np.exp(shares)
        n_labels = max(self.n_trained, int(self.added.max(initial=-1)) + 1)
        probabilities = np.zeros((*own.shape[:-1], n_labels))
        together = np.add.reduce(own[..., : self.n_trained], axis=-1, keepdims=True)
        probabilities[..., : self.n_trained] = together * trained
        probabilities[..., self.added] += own[..., self.n_trained :]
        return probabilities

    def check(self, mean: Array) -> None:
        """Raise ValueError unless the shares of a slide with this mean, (n_features,), are numbers at every length.

        Parameters
        ----------
        mean : (n_features,)

        Raises
        ------
        ValueError
            If an added slide holds values so large that they overflow.
        """
        if not all(np.isfinite(self.shares(mean, np.zeros_like(mean), length)).all() for length in self.lengths):
            raise ValueError('its values are too large to be features')

    def _described(self, values: Array, overlap: float) -> list[Array]:
        """Return the descriptor of the start of a slide of each length; the last one is of the whole slide."""
        ends = [*(window_count(length, overlap) for length in self.lengths[:-1]), len(values)]
        parts = [values[:end] for end in ends]
        return [
            self._descriptor(part.mean(axis=0), part.var(axis=0), length)
            for part, length in zip(parts, self.lengths, strict=True)
        ]

    def _descriptor(self, mean: Array, variance: Array, length: float) -> Array:
        if length < SPREAD_LENGTH:
            return mean
        return np.concatenate([mean, 0.5 * np.log(variance + self.spread_floor)])


def _of_length(start: GaussianClasses, length: float) -> GaussianClasses:
    return start if length >= SPREAD_LENGTH else replace(start, uncertainty_exponent=SHORT_EXPONENT)

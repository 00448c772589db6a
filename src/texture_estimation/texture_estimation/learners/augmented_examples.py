"""Augmented training examples of a learner: copies of slides, gains and slide jitter, drawn batch by batch."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_features.augmentation.augmentation import Augmentation

Inputs = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class AugmentedExamples:
    """What a learner draws besides the examples of the undisturbed slides.

    Parameters
    ----------
    values : (n, n_features) float32
        Windows of changed copies of the slides.
    codes, groups : (n,)
        Number of the label and of the slide of each.
    rows : (n_rows,)
        Windows to draw from, those that count more often several times.
    gain_response : (n_features,)
        Change of each feature per natural logarithm of the gain.
    slide_deviations : (n_slides, n_features)
        Mean of each undisturbed slide less that of its class.
    slides : (n_slides,)
        Number of each of these.
    augmentation
        Ranges and shares.

    Examples
    --------
    >>> nothing = np.zeros((0, 2), dtype=np.float32)
    >>> none = np.zeros(0, dtype=np.intp)
    >>> zeros, slides = np.zeros((2, 2)), np.arange(2)
    >>> augmented = AugmentedExamples(nothing, none, none, none, zeros[0], zeros, slides, Augmentation())
    >>> augmented.without(np.array([1])).slides.tolist()
    [0]
    """

    values: Inputs
    codes: Codes
    groups: Codes
    rows: Codes
    gain_response: Array
    slide_deviations: Array
    slides: Codes
    augmentation: Augmentation

    def without(self, held_out: Codes) -> AugmentedExamples:
        """Return the examples without those of the slides with these numbers; class means stay as they are."""
        kept = ~np.isin(self.slides, held_out)
        return dataclasses.replace(
            self,
            rows=self.rows[~np.isin(self.groups[self.rows], held_out)],
            slide_deviations=self.slide_deviations[kept],
            slides=self.slides[kept],
        )


class AugmentedBatches:
    """Draw batches of standardised inputs: undisturbed examples and copies, with random gains and slide jitter.

    Parameters
    ----------
    inputs : (n, n_features) float32
        Undisturbed examples, standardised.
    y : (n,)
        Their labels.
    augmented
        What is drawn besides.
    mean, scale : (n_features,)
        Of the standardisation.

    Examples
    --------
    >>> inputs = np.ones((4, 2), dtype=np.float32)
    >>> none = np.zeros(0, dtype=np.intp)
    >>> changes = Augmentation(gain_probability=0.0, slide_jitter=0.0, clean_share=1.0)
    >>> zeros, slides = np.zeros((2, 2)), np.arange(2)
    >>> augmented = AugmentedExamples(inputs[:0], none, none, none, zeros[0], zeros, slides, changes)
    >>> rng = np.random.default_rng(0)
    >>> batches = AugmentedBatches(inputs, np.arange(4) // 2, augmented, rng, mean=zeros[0], scale=np.ones(2))
    >>> drawn, codes = batches.draw(3)
    >>> drawn.shape, codes.shape
    ((3, 2), (3,))
    """

    def __init__(
        self,
        inputs: Inputs,
        y: Codes,
        augmented: AugmentedExamples,
        rng: np.random.Generator,
        *,
        mean: Array,
        scale: Array,
    ) -> None:
        self._inputs, self._codes, self._augmented, self._rng = inputs, y, augmented, rng
        self._mean, self._factor = mean.astype(np.float32), (1.0 / scale).astype(np.float32)
        self._response = (augmented.gain_response / scale).astype(np.float32)
        self._deviations = (augmented.slide_deviations / scale).astype(np.float32)
        self._clean, self._copies = _Rows(np.arange(len(inputs)), rng), _Rows(augmented.rows, rng)

    def draw(self, count: int) -> tuple[Inputs, Codes]:
        """Return so many inputs, (count, n_features), and their labels, (count,)."""
        n_clean = round(count * self._augmented.augmentation.clean_share) if len(self._augmented.rows) else count
        clean, copies = self._clean.take(n_clean), self._copies.take(count - n_clean)
        changed = (self._augmented.values[copies] - self._mean) * self._factor
        drawn = np.concatenate([self._inputs[clean], changed])
        drawn += self._log_gains(count) * self._response
        if len(self._deviations):
            drawn += self._jitter(count) * self._deviations[self._rng.integers(len(self._deviations), size=count)]
        return drawn, np.concatenate([self._codes[clean], self._augmented.codes[copies]])

    def _log_gains(self, count: int) -> Inputs:
        params = self._augmented.augmentation
        widest = math.log(params.gain_range)
        changed = self._rng.random((count, 1)) < params.gain_probability
        gains: Inputs = (self._rng.uniform(-widest, widest, (count, 1)) * changed).astype(np.float32)
        return gains

    def _jitter(self, count: int) -> Inputs:
        factors = self._rng.standard_normal((count, 1), dtype=np.float32)
        jitter: Inputs = np.float32(self._augmented.augmentation.slide_jitter) * factors
        return jitter


class _Rows:
    """Numbers in random order, each once before any comes again."""

    def __init__(self, rows: Codes, rng: np.random.Generator) -> None:
        self._rows, self._rng = rows, rng
        self._left = rows[:0]

    def take(self, count: int) -> Codes:
        while len(self._left) < count:
            self._left = np.concatenate([self._left, self._rng.permutation(self._rows)])
        taken, self._left = self._left[:count], self._left[count:]
        return taken

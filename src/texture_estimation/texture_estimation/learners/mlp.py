# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The networks of our recipes: training with augmented copies, plain-array predictor."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.types import Array
from texture_estimation.learners.learner import Codes, Fitted, chunks, fit_in_folds
from texture_features.augmentation import Augmentation

# --------------------
# Augmented training examples of a learner: copies of slides, gains and slide jitter, drawn batch by batch.

Inputs = NDArray[np.float32]
BLOCK = 16  # batches that are drawn at once


@dataclass(frozen=True, eq=False)
class AugmentedExamples:
    """What a learner draws in addition to the examples of the undisturbed slides."""

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
    """Draw batches of standardised inputs: undisturbed examples and copies, with random gains and slide jitter."""

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
        self._drawn: list[tuple[Inputs, Codes]] = []

    def draw(self, count: int) -> tuple[Inputs, Codes]:
        """Return `count` inputs, (count, n_features), and their labels, (count,); the same count at each call."""
        if not self._drawn:
            self._drawn = self._draw_block(count)
        return self._drawn.pop()

    def _draw_block(self, count: int) -> list[tuple[Inputs, Codes]]:
        """Return several batches, whose random numbers and rows cost half as much together."""
        params, total = self._augmented.augmentation, BLOCK * count
        n_clean = round(count * params.clean_fraction) if len(self._augmented.rows) else count
        block = np.empty((BLOCK, count, len(self._mean)), dtype=np.float32)
        codes = np.empty((BLOCK, count), dtype=np.intp)
        clean, copies = self._clean.take(BLOCK * n_clean), self._copies.take(total - BLOCK * n_clean)
        block[:, :n_clean] = self._inputs[clean].reshape(BLOCK, n_clean, len(self._mean))
        changed = self._augmented.values[copies]
        changed -= self._mean
        changed *= self._factor
        block[:, n_clean:] = changed.reshape(BLOCK, count - n_clean, len(self._mean))
        codes[:, :n_clean] = self._codes[clean].reshape(BLOCK, n_clean)
        codes[:, n_clean:] = self._augmented.codes[copies].reshape(BLOCK, count - n_clean)
        widest = math.log(params.gain_range)
        louder = self._rng.random((BLOCK, count, 1), dtype=np.float32) < params.gain_probability
        louder = louder * self._rng.uniform(-widest, widest, louder.shape).astype(np.float32)
        block += louder * self._response
        if len(self._deviations):
            factors = self._rng.standard_normal((BLOCK, count, 1), dtype=np.float32)
            factors *= params.slide_jitter
            block += factors * self._deviations[self._rng.integers(len(self._deviations), size=(BLOCK, count))]
        return list(zip(block, codes, strict=True))


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


# --------------------
# Predict with a fitted multi-layer perceptron.


class MlpPredictor:
    """The two layers, made for features as they come."""

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        # Column by column a product with one window is a quarter faster.
        self._hidden, self._hidden_offset, self._output, self._output_offset = (
            np.asarray(parameters[name], dtype=np.float64, order='F')
            for name in ('hidden', 'hidden_offset', 'output', 'output_offset')
        )

    def activations(self, X: Array) -> Array:
        """Return the outputs of the hidden layer, (..., n_hidden) of (..., n_features)."""
        active: Array = X @ self._hidden
        active += self._hidden_offset
        np.maximum(active, 0.0, out=active)
        return active

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""
        return self.scores(self.activations(X))

    def scores(self, activations: Array) -> Array:
        """Return the same, (..., n_labels), from the outputs of the hidden layer, (..., n_hidden)."""
        scores: Array = activations @ self._output
        scores += self._output_offset
        return scores


# --------------------
# Multilayer perceptron: one hidden layer, softmax output, trained with noise on its inputs.

Weights = list[NDArray[np.float32]]  # hidden: (n_features, hidden), (hidden,); output: (hidden, n_labels), (n_labels,)
BATCH = 128
MIN_STEPS = 400
RATE = 2e-3
MEAN_DECAY, SQUARE_DECAY = 0.9, 0.999  # Kingma & Ba's
TINY = 1e-8
NOISE_TABLE = 1 << 20
CALIBRATION_FRACTION = 0.5  # of the passes, that a network for the calibration makes
HIDDEN_LAYER, OUTPUT_LAYER = 0, 2  # of the weights; their offsets follow them
# Of one network, steps times features and labels: larger trainings make fewer passes, so that they end within minutes.
# The shipped recipes come to 3 to 5 millions with 20 textures of 40 slides.
MAX_WORK = 10e6
# Parameters of which the scores are linear functions.
TEMPERED = ('output', 'output_offset')


@dataclass(frozen=True)
class Mlp:
    """Standardised features, one ReLU layer, softmax; probabilities calibrated on held-out slides.

    As accurate on recorded slides as an RBF support vector machine, at a cost that does not grow with the examples and
    hardly with the labels. Noise on the standardised inputs takes the place of an early stop (Bishop 1995).

    Source: Adam of Kingma & Ba 2015 with a rate that falls like a cosine; one temperature (Guo et al. 2017).

    Examples
    --------
    >>> import numpy as np
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> fitted = Mlp().fit(values, codes, groups)
    >>> predictor = Mlp.predictor(fitted.parameters)
    >>> isinstance(predictor, MlpPredictor), bool((predictor(values).argmax(axis=1) == codes).all())
    (True, True)
    """

    extras: ClassVar[tuple[str, ...]] = ('augmented', 'parts')

    hidden: int = param(
        128, 'Number of units in the hidden layer; more units separate finer and cost computing time.', low=1, high=4096
    )
    noise: float = param(
        0.3,
        'Standard deviation of the noise added to the standardised features in training; more noise smooths more.',
        low=0.0,
        high=10.0,
    )
    decay: float = param(
        0.01, 'Weight decay, divided by the number of examples; a larger one smooths more.', low=0.0, high=1e6
    )
    epochs: int = param(60, 'Number of passes over the training examples.', low=1, high=100_000)
    folds: int = param(
        5, 'Number of cross-validation folds for the calibration; more folds take longer to train.', low=2, high=50
    )
    seed: int = param(
        0, 'Seed of the initial weights, the order of the examples and the noise; equal seeds give equal models.', low=0
    )

    def fit(
        self,
        X: Array,
        y: Codes,
        groups: Codes,
        augmented: AugmentedExamples | None = None,
        parts: Codes | None = None,
    ) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,).

        With augmented examples, the number of passes counts those over the undisturbed ones. A network for the
        calibration makes half of the passes, or half of the steps where these are limited.

        Parameters
        ----------
        X : (n, n_features)
            Features of windows; finite.
        y : (n,)
            Number of the label of each, from 0, without gaps.
        groups : (n,)
            Number of the slide of each.
        augmented
            Copies of the examples to draw from, or None.
        parts : (n_groups,) or None
            Part in which the slide of each number is held out; by slides if None.

        Returns
        -------
        Fitted
            Parameters, log-probabilities when held out, and a note on the calibration.
        """
        n_labels = int(y.max()) + 1

        def fit(held: NDArray[np.bool_]) -> dict[str, Array]:
            rest = augmented.without(np.unique(groups[held])) if augmented else None
            fraction = CALIBRATION_FRACTION if augmented and held.any() else 1.0
            return self._fit(X[~held], y[~held], n_labels, rest, fraction)

        return fit_in_folds(fit, self.predictor, X, y, groups, folds=self.folds, parts=parts, tempered=TEMPERED)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> MlpPredictor:
        """Return the predictor made from the stored parameters."""
        return MlpPredictor(parameters)

    def _fit(
        self, X: Array, y: Codes, n_labels: int, augmented: AugmentedExamples | None, fraction: float = 1.0
    ) -> dict[str, Array]:
        """Return the layers after a fraction of the steps, with the standardisation worked into them."""
        mean, scale = X.mean(axis=0), X.std(axis=0)
        scale[scale <= 1e-12 * np.abs(mean)] = np.inf  # constant features carry no information
        inputs, rng = np.empty(X.shape, np.float32), np.random.default_rng(self.seed)
        for rows in chunks(*X.shape):
            inputs[rows] = (X[rows] - mean) / scale
        drawn = (
            AugmentedBatches(inputs, y, augmented, rng, mean=mean, scale=scale)
            if augmented
            else _Batches(inputs, y, rng)
        )
        weights = self._descend(drawn, inputs.shape, n_labels, rng, fraction)
        hidden, hidden_offset, output, output_offset = (part.astype(np.float64) for part in weights)
        hidden /= scale[:, None]
        return {
            'hidden': hidden,
            'hidden_offset': hidden_offset - mean @ hidden,
            'output': output,
            'output_offset': output_offset,
        }

    def _descend(
        self, drawn: AugmentedBatches | _Batches, shape: tuple[int, ...], n_labels: int, rng: np.random.Generator,
        fraction: float,
    ) -> Weights:  # fmt: skip
        """Return the weights after this fraction of all passes over the examples, (n, n_features)."""
        n_examples, n_features = shape
        network = MlpTraining(n_features, self.hidden, n_labels, rng)
        # Noise is cut from a table at random places: a new number for each input took a fifth of the training.
        table = np.float32(self.noise) * rng.standard_normal(max(NOISE_TABLE, 4 * BATCH * n_features), dtype=np.float32)
        # Fewer steps where each costs much: with many features and labels.
        passes, most = math.ceil(fraction * self.epochs), round(fraction * MAX_WORK / (n_features + n_labels))
        steps = min(max(passes * -(-n_examples // BATCH), MIN_STEPS), max(most, MIN_STEPS))
        for step in range(steps):
            inputs, codes = drawn.draw(min(BATCH, n_examples))
            start = rng.integers(len(table) - inputs.size + 1)
            inputs += table[start : start + inputs.size].reshape(inputs.shape)
            network.find_slopes(inputs, codes)
            for part in (HIDDEN_LAYER, OUTPUT_LAYER):
                network.slopes[part] += self.decay / n_examples * network.weights[part]
            network.step(RATE * 0.5 * (1.0 + math.cos(math.pi * step / steps)))
        return network.weights


class _Batches:
    """The examples in batches of nearly equal size, in a new order at each pass."""

    def __init__(self, inputs: NDArray[np.float32], y: Codes, rng: np.random.Generator) -> None:
        self._inputs, self._codes, self._rng = inputs, y, rng
        self._count = -(-len(inputs) // BATCH)
        self._drawn = 0
        self._order: Codes = np.zeros(0, np.intp)

    def draw(self, _count: int) -> tuple[NDArray[np.float32], Codes]:
        if self._drawn % self._count == 0:
            self._order = self._rng.permutation(len(self._inputs))
        rows = self._order[self._drawn % self._count :: self._count]
        self._drawn += 1
        return self._inputs[rows], self._codes[rows]


class MlpTraining:
    """A network in training: weights, slopes and Adam's means as one vector each, so that a step is a few passes.

    Source: Adam of Kingma & Ba 2015.
    """

    def __init__(
        self, n_features: int, hidden: int, n_labels: int, rng: np.random.Generator, dtype: Any = np.float32
    ) -> None:
        shapes = [(n_features, hidden), (hidden,), (hidden, n_labels), (n_labels,)]
        count = sum(map(math.prod, shapes))
        self._vectors = np.zeros((6, count), dtype)  # weights, slopes, means, squares, two to compute in
        ends = np.cumsum([math.prod(shape) for shape in shapes])[:-1]
        self.weights, self.slopes = (
            [part.reshape(shape) for part, shape in zip(np.split(vector, ends), shapes, strict=True)]
            for vector in self._vectors[:2]
        )
        # Random layers that keep the size of the signals (He et al. 2015).
        for part, factor in ((HIDDEN_LAYER, 2.0 / n_features), (OUTPUT_LAYER, 1.0 / hidden)):
            rng.standard_normal(out=self.weights[part], dtype=dtype)
            self.weights[part] *= math.sqrt(factor)
        self._count = 0

    def find_slopes(self, inputs: NDArray[np.floating[Any]], codes: Codes) -> None:
        """Set the derivatives of the mean cross-entropy of inputs (n, n_features) with these labels (n,)."""
        hidden, hidden_offset, output, output_offset = self.weights
        active = inputs @ hidden
        active += hidden_offset
        np.maximum(active, 0.0, out=active)
        error = active @ output
        error += output_offset
        error -= error.max(axis=1, keepdims=True)
        np.exp(error, out=error)
        error /= error.sum(axis=1, keepdims=True)
        error[np.arange(len(codes)), codes] -= 1.0
        error /= len(codes)
        back = error @ output.T
        back *= active > 0.0
        np.matmul(inputs.T, back, out=self.slopes[0])
        np.add.reduce(back, axis=0, out=self.slopes[1])
        np.matmul(active.T, error, out=self.slopes[2])
        np.add.reduce(error, axis=0, out=self.slopes[3])

    def step(self, rate: float) -> None:
        """Update the weights along the gradients, with adaptive rates (Kingma & Ba 2015)."""
        weights, slopes, means, squares, change, spread = self._vectors
        self._count += 1
        pace = rate * math.sqrt(1 - SQUARE_DECAY**self._count) / (1 - MEAN_DECAY**self._count)
        means *= MEAN_DECAY
        means += np.multiply(slopes, 1 - MEAN_DECAY, out=change)
        np.multiply(slopes, slopes, out=change)
        change *= 1 - SQUARE_DECAY
        squares *= SQUARE_DECAY
        squares += change
        np.sqrt(squares, out=spread)
        spread += TINY
        np.multiply(means, pace, out=change)
        change /= spread
        weights -= change

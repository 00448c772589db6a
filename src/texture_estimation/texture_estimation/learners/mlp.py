"""Multilayer perceptron: one hidden layer, softmax output, trained with noise on its inputs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.augmented_examples import AugmentedBatches, AugmentedExamples
from texture_estimation.learners.folds import assign_folds
from texture_estimation.learners.learner import Codes, Fitted, FoldFit
from texture_estimation.learners.mlp_predictor import MlpPredictor
from texture_estimation.log_probabilities import chunks, log_loss, log_softmax

Weights = list[NDArray[np.float32]]  # hidden: (n_features, hidden), (hidden,); output: (hidden, n_labels), (n_labels,)
BATCH = 128
MIN_STEPS = 400
RATE = 2e-3
MEAN_DECAY, SQUARE_DECAY = 0.9, 0.999  # Kingma & Ba's
TINY = np.float32(1e-8)
# Of one network, steps times features and labels: larger trainings make fewer passes, so that they end within minutes.
# The shipped recipes come to 3 to 5 millions with 20 textures of 40 slides.
MAX_WORK = 10e6
# Parameters of which the scores are linear functions; the last two are those of a learner with a layer for the onset.
TEMPERED = ('output', 'output_offset', 'onset', 'onset_offset')


@dataclass(frozen=True)
class Mlp:
    """Standardised features, one layer of rectifiers, softmax; probabilities calibrated on slides held out.

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

    extras: ClassVar[tuple[str, ...]] = ('augmented',)

    hidden: int = param(
        128,
        'Sets the number of units in the hidden layer; more units separate finer and cost computing time.',
        low=1,
        high=4096,
    )
    noise: float = param(
        0.3,
        'Sets the standard deviation of the noise added to the standardised features in training; more '
        'noise smooths more.',
        low=0.0,
        high=10.0,
    )
    decay: float = param(
        0.01, 'Sets the weight decay, divided by the number of examples; a larger one smooths more.', low=0.0, high=1e6
    )
    epochs: int = param(
        60, 'Sets the number of passes over the training examples; more take longer to train.', low=1, high=100_000
    )
    folds: int = param(
        5,
        'Sets the number of cross-validation folds for the calibration; more folds take longer to train.',
        low=2,
        high=50,
    )
    seed: int = param(
        0,
        'Sets the seed of the initial weights, the order of the examples and the noise; equal seeds give equal models.',
        low=0,
    )

    def fit(self, X: Array, y: Codes, groups: Codes, augmented: AugmentedExamples | None = None) -> Fitted:
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

        Returns
        -------
        Fitted
            Parameters, log-probabilities when held out, and a note on the calibration.
        """
        from scipy.optimize import minimize_scalar  # noqa: PLC0415  # takes 0.3 s, and only training needs it

        n_labels = int(y.max()) + 1
        split = assign_folds(y, groups, self.folds)
        if split is None:
            fitted = self._fit(X, y, n_labels, augmented)
            return Fitted(fitted, None, 'not calibrated, as a label has a single window')
        folds_of, note = split
        scores = np.empty((len(y), n_labels))
        share = 1.0 if augmented is None else 0.5
        folds = []
        for part in np.unique(folds_of):
            held = folds_of == part
            slides = np.unique(groups[held])
            rest = augmented.without(slides) if augmented else None
            folds.append(FoldFit(slides, self._fit(X[~held], y[~held], n_labels, rest, share)))
            scores[held] = self.predictor(folds[-1].parameters)(X[held])
        best = minimize_scalar(lambda log_t: _loss_at(scores, y, math.exp(log_t)), bounds=(-2.0, 4.0), method='bounded')
        temperature = math.exp(best.x)
        fitted = _calibrated(self._fit(X, y, n_labels, augmented), temperature)
        folds = [FoldFit(fold.held_out, _calibrated(fold.parameters, temperature)) for fold in folds]
        for rows in chunks(*scores.shape):
            scores[rows] = log_softmax(scores[rows] / temperature)
        return Fitted(fitted, scores, note, folds)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> MlpPredictor:
        """Return the predictor made from the stored parameters."""
        # Column by column a product with one window is a quarter faster.
        names = MlpPredictor.__dataclass_fields__
        return MlpPredictor(*(np.asarray(parameters[name], dtype=np.float64, order='F') for name in names))

    def _fit(
        self, X: Array, y: Codes, n_labels: int, augmented: AugmentedExamples | None, share: float = 1.0
    ) -> dict[str, Array]:
        """Return the layers after a share of the steps, with the standardisation worked into them."""
        mean, scale = X.mean(axis=0), X.std(axis=0)
        scale[scale <= 1e-12 * np.abs(mean)] = np.inf  # what is constant tells nothing
        inputs, rng = np.empty(X.shape, np.float32), np.random.default_rng(self.seed)
        for rows in chunks(*X.shape):
            inputs[rows] = (X[rows] - mean) / scale
        drawn: _Draws = (
            AugmentedBatches(inputs, y, augmented, rng, mean=mean, scale=scale)
            if augmented
            else _Batches(inputs, y, rng)
        )
        weights = self._descend(drawn, inputs.shape, n_labels, rng, share)
        hidden, hidden_offset, output, output_offset = (part.astype(np.float64) for part in weights)
        hidden /= scale[:, None]
        return {
            'hidden': hidden,
            'hidden_offset': hidden_offset - mean @ hidden,
            'output': output,
            'output_offset': output_offset,
        }

    def _steps(self, n_examples: int, work: int, share: float) -> int:
        """Return the number of batches, fewer where each costs much: with so many features and labels."""
        passes, most = math.ceil(share * self.epochs), round(share * MAX_WORK / work)
        return min(max(passes * -(-n_examples // BATCH), MIN_STEPS), max(most, MIN_STEPS))

    def _descend(
        self, drawn: _Draws, shape: tuple[int, ...], n_labels: int, rng: np.random.Generator, share: float
    ) -> Weights:
        """Return the weights after this share of all passes over so many examples, (n, n_features)."""
        n_examples, n_features = shape
        weights = _first_weights(n_features, self.hidden, n_labels, rng)
        truth = np.eye(n_labels, dtype=np.float32)
        steps = self._steps(n_examples, n_features + n_labels, share)
        adam = _Adam(weights)
        for step in range(steps):
            inputs, codes = drawn.draw(min(BATCH, n_examples))
            noisy = inputs + np.float32(self.noise) * rng.standard_normal(inputs.shape, dtype=np.float32)
            slopes = _slopes(weights, noisy, truth[codes])
            for layer in (0, 2):
                slopes[layer] += np.float32(self.decay / n_examples) * weights[layer]
            adam.step(weights, slopes, RATE * 0.5 * (1.0 + math.cos(math.pi * step / steps)))
        return weights


class _Draws(Protocol):
    def draw(self, count: int) -> tuple[NDArray[np.float32], Codes]:
        """Return standardised inputs, (about count, n_features), and their labels."""


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


def _loss_at(scores: Array, y: Codes, temperature: float) -> float:
    """Return the mean negative log-probability of the true labels at a temperature; few rows at once take memory."""
    parts = list(chunks(*scores.shape))
    losses = [log_loss(log_softmax(scores[rows] / temperature), y[rows]) for rows in parts]
    return float(np.average(losses, weights=[rows.stop - rows.start for rows in parts])) if losses[1:] else losses[0]


def _calibrated(parameters: Mapping[str, Array], temperature: float) -> dict[str, Array]:
    """Return the layers with the temperature worked into them."""
    output = {name: parameters[name] / temperature for name in TEMPERED if name in parameters}
    return {**parameters, **output}


class _Adam:
    """Steps along the slopes, each weight at its own pace."""

    def __init__(self, weights: Weights) -> None:
        self._means = [np.zeros_like(weight) for weight in weights]
        self._squares = [np.zeros_like(weight) for weight in weights]
        self._count = 0

    def step(self, weights: Weights, slopes: Weights, rate: float) -> None:
        """Change the weights in place."""
        self._count += 1
        pace = np.float32(rate * math.sqrt(1 - SQUARE_DECAY**self._count) / (1 - MEAN_DECAY**self._count))
        for part, slope in enumerate(slopes):
            self._means[part] += np.float32(1 - MEAN_DECAY) * (slope - self._means[part])
            self._squares[part] += np.float32(1 - SQUARE_DECAY) * (slope * slope - self._squares[part])
            weights[part] -= pace * self._means[part] / (np.sqrt(self._squares[part]) + TINY)


def _first_weights(n_features: int, hidden: int, n_labels: int, rng: np.random.Generator) -> Weights:
    """Return random layers that keep the size of the signals (He et al. 2015)."""
    first = rng.standard_normal((n_features, hidden), dtype=np.float32) * np.float32(math.sqrt(2.0 / n_features))
    second = rng.standard_normal((hidden, n_labels), dtype=np.float32) * np.float32(math.sqrt(1.0 / hidden))
    return [first, np.zeros(hidden, np.float32), second, np.zeros(n_labels, np.float32)]


def _slopes(weights: Weights, inputs: NDArray[np.float32], truth: NDArray[np.float32]) -> Weights:
    """Return the derivatives of the mean cross-entropy, (n, n_features) and (n, n_labels)."""
    hidden, hidden_offset, output, output_offset = weights
    before = inputs @ hidden + hidden_offset
    active = np.maximum(before, 0)
    scores = active @ output + output_offset
    odds = np.exp(scores - scores.max(axis=1, keepdims=True))
    error = (odds / odds.sum(axis=1, keepdims=True) - truth) / np.float32(len(inputs))
    back = (error @ output.T) * (before > 0)
    return [inputs.T @ back, back.sum(axis=0), active.T @ error, error.sum(axis=0)]

# SPDX-License-Identifier: Apache-2.0
"""The networks of our recipes: training with augmented copies, plain-array predictors, onset network."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.types import Array
from texture_estimation.learners.discriminant import linear_discriminant
from texture_estimation.learners.learner import Codes, Fitted, FoldFit, assign_folds
from texture_estimation.numerics import chunks, log_loss, log_softmax
from texture_features.augmentation import Augmentation
from texture_features.features.temporal import SLIDE_ONSET

# --------------------
# Augmented training examples of a learner: copies of slides, gains and slide jitter, drawn batch by batch.

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


# --------------------
# Predict with a fitted multi-layer perceptron.


@dataclass(frozen=True, eq=False)
class MlpPredictor:
    """The two layers, made for features as they come.

    Parameters
    ----------
    hidden : (n_features, n_hidden)
    hidden_offset : (n_hidden,)
    output : (n_hidden, n_labels)
    output_offset : (n_labels,)

    Examples
    --------
    >>> predictor = MlpPredictor(np.eye(2), np.zeros(2), np.eye(2), np.zeros(2))
    >>> predictor(np.array([3.0, -1.0])).tolist()
    [3.0, 0.0]
    """

    hidden: Array
    hidden_offset: Array
    output: Array
    output_offset: Array

    def activations(self, X: Array) -> Array:
        """Return the outputs of the hidden layer, (..., n_hidden) of (..., n_features)."""
        active: Array = X @ self.hidden
        active += self.hidden_offset
        np.maximum(active, 0.0, out=active)
        return active

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""
        return self.scores(self.activations(X))

    def scores(self, activations: Array) -> Array:
        """Return the same, (..., n_labels), from the outputs of the hidden layer, (..., n_hidden).

        Parameters
        ----------
        activations : (..., n_hidden)

        Returns
        -------
        (..., n_labels)
        """
        scores: Array = activations @ self.output
        scores += self.output_offset
        return scores


# --------------------
# Multilayer perceptron: one hidden layer, softmax output, trained with noise on its inputs.

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

    extras: ClassVar[tuple[str, ...]] = ('augmented', 'parts')

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
        from scipy.optimize import minimize_scalar  # noqa: PLC0415  # takes 0.3 s, and only training needs it

        n_labels = int(y.max()) + 1
        split = assign_folds(y, groups, self.folds, parts)
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


# --------------------
# Predict with a fitted multi-layer perceptron and a linear discriminant for first windows.


@dataclass(frozen=True, eq=False)
class OnsetMlpPredictor(MlpPredictor):
    """The layers of the network, and one that is added to its scores for first windows.

    Parameters
    ----------
    onset : (n_features, n_labels)
    onset_offset : (n_labels,)
    column
        Number of the feature that is 1 for first windows.

    Examples
    --------
    >>> import numpy as np
    >>> predictor = OnsetMlpPredictor(np.eye(2), np.zeros(2), np.eye(2), np.zeros(2), np.eye(2), np.ones(2), column=1)
    >>> predictor(np.array([[3.0, 0.0], [3.0, 1.0]])).tolist()
    [[3.0, 0.0], [7.0, 3.0]]
    """

    onset: Array
    onset_offset: Array
    column: int

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities up to a constant of the window, (..., n_labels) of (..., n_features)."""
        scores, first = super().__call__(X), X[..., self.column, None]
        if first.any():
            scores += first * (X @ self.onset + self.onset_offset)
        return scores


# --------------------
# Multilayer perceptron with a linear discriminant for the first window of a slide.

UNBOUND = -1


@dataclass(frozen=True)
class OnsetMlp(Mlp):
    """The network `mlp` for all windows; the first of a slide is also judged by linear discriminant analysis.

    While friction, contact and sensor settle, features have other means and another covariance than later: a classifier
    of all windows knows little of it. First windows therefore have class-conditional Gaussians of their own, with one
    covariance that is shrunk towards its diagonal, as there is one example a slide. Their log-probabilities are added
    to those of the network. The feature `slide_onset` says which windows these are; the network does not see it.
    Without this feature there is the network alone.

    Source: Fisher 1936; Friedman 1989 for the shrinkage.

    Examples
    --------
    >>> codes, slides = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> X = np.stack([codes + 0.1 * np.random.default_rng(0).standard_normal(40), np.arange(40) % 5 == 0], axis=1)
    >>> learner = OnsetMlp(epochs=1).of_examples(['signal/mean/pac', 'signal/slide_onset'], ['cork', 'felt'])
    >>> predictor = learner.predictor(learner.fit(X, codes, slides).parameters)
    >>> predictor(np.array([[0.0, 1.0], [1.0, 1.0]])).argmax(axis=1).tolist()
    [0, 1]
    """

    onset_weight: float = param(
        1.0,
        'Sets the weight of the discriminant of the first window, relative to the network; a larger one lets the first '
        'window count more in the whole slide.',
        low=0.0,
        high=100.0,
    )
    shrinkage: float = param(
        0.3,
        'Sets how far the correlations within classes are shrunk towards 0; more needs fewer slides and separates '
        'less finely.',
        low=0.0,
        high=1.0,
    )
    column: int = param(
        UNBOUND, 'Number of the feature `slide_onset`; set by the training from the names of the features.', low=UNBOUND
    )

    def of_examples(self, names: Sequence[str], _labels: Sequence[str]) -> OnsetMlp:
        """Return the learner for examples with these features; without `slide_onset` it is the network alone."""
        found = [number for number, name in enumerate(names) if name.rsplit('/', 1)[-1] == SLIDE_ONSET]
        return dataclasses.replace(self, column=found[0] if found else UNBOUND)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> OnsetMlpPredictor:
        """Return the predictor made from the stored parameters."""
        network = Mlp.predictor(parameters)
        return OnsetMlpPredictor(
            network.hidden,
            network.hidden_offset,
            network.output,
            network.output_offset,
            np.asarray(parameters['onset'], dtype=np.float64, order='F'),
            np.asarray(parameters['onset_offset'], dtype=np.float64),
            int(parameters['onset_column']),
        )

    def _fit(
        self, X: Array, y: Codes, n_labels: int, augmented: AugmentedExamples | None, share: float = 1.0
    ) -> dict[str, Array]:
        """Return the layers of the network and that of the onset."""
        blind = X.copy()
        first: Codes = np.zeros(0, dtype=np.intp)
        if self.column != UNBOUND:
            first = np.flatnonzero(X[:, self.column] > 0.0)
            blind[:, self.column] = 0.0  # what is constant tells nothing
        network = super()._fit(blind, y, n_labels, augmented, share)
        values, codes = X[first].astype(np.float64), y[first]
        if augmented is not None and len(first):
            values, codes = self._with_copies(values, codes, augmented)
        onset, offset = linear_discriminant(values, codes, n_labels, self.shrinkage)
        return {
            **network,
            'onset': self.onset_weight * onset,
            'onset_offset': self.onset_weight * offset,
            'onset_column': np.array(self.column),
        }

    def _with_copies(self, values: Array, codes: Codes, augmented: AugmentedExamples) -> tuple[Array, Codes]:
        """Return the first windows with those of changed copies, and all of them at both ends of the range of gains."""
        rows = np.unique(augmented.rows)
        rows = rows[augmented.values[rows, self.column] > 0.0]
        every = np.concatenate([values, augmented.values[rows].astype(np.float64)])
        labels = np.concatenate([codes, augmented.codes[rows]])
        louder = np.log(augmented.augmentation.gain_range) / np.sqrt(3.0) * augmented.gain_response
        return np.concatenate([every + louder, every - louder]), np.concatenate([labels, labels])

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Textures by tactile exploration (Roberge et al.): Fourier peaks; a network or a machine for each pair of textures.

What the paper describes and what is done here, element by element:

slide
    :Paper: 500 ms at 0.10, 0.15, 0.20 m/s and 1, 2.5, 5 N; ten textures: 10 cm at 0.125 m/s and 2 N (IV.A, V.A).
    :Here: The same in the presets, 50 ms longer, so that a late arm also covers it.
transform
    :Paper: The signal less its mean, 1024 values from 0 to 500 Hz (III.B).
    :Here: The same: 2048 points at 1 kHz.
peaks
    :Paper: Maxima with a least gap, 2 to 15, their frequency and amplitude, ranked by either (III.B, IV).
    :Here: The same: `SpectralPeaks`.
integral, length
    :Paper: Equations 1 and 2.
    :Here: The same: `SignalEnergy`, `ArcLength`.
network
    :Paper: Sigmoid hidden layer, linear output, rounded, one for each pair (III.C). Its training is not given.
    :Here: `AnnPairs`, trained as by MATLAB's default.
machine
    :Paper: One for each pair, with box constraint and kernel scale of MATLAB (III.C, IV). Its kernel is not given.
    :Here: `SvmPairs` with the RBF kernel.
decision
    :Paper: Most pairs; a tie is unclassified (III.C).
    :Here: The same: `pairs_won`.
vote
    :Paper: Five parts of one scan of 500 ms, at least three equal (III.C, IV.B.1).
    :Here: The newest five windows of 0.1 s; on a longer slide every 0.5 s is a separate decision.
parts of a circle
    :Paper: 1 to 9, most votes; 7 or 9 in almost all cases (IV, IV.B.2).
    :Here: 7 of 70 ms for all pairs.
search
    :Paper: 20 individuals, 30 generations, the mean of learning and test over 20 halves (IV); from there 10 and 10
        for the vote, 13 and 10 for ten textures. Test slides are part of the fitness.
    :Here: `texture experiment NAME --tune`: the same for each pair, on the training half alone; 10 halves for the vote.
        Networks 10 and 5 with 4 halves, for the vote the best 10 of these with 2. Test slides are never part.
variables
    :Paper: A set for each pair (III.C), not printed.
    :Here: `…-pairs`: those found for the first seed of the experiment, in the size that the file names. The other
        recipes have one set for all pairs.
standardisation
    :Paper: Not given.
    :Here: Features have zero mean and unit variance.
friction
    :Paper: The next question (VI).
    :Here: The recipe `friction-svm`, which needs the arm `ur` or `ros_controllers`; without figures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from itertools import combinations
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param, safe_repr
from texture_core.errors import InvalidParameter, ModelMismatch
from texture_core.types import Array
from texture_estimation.evidence_rules import EvidenceRule, followed
from texture_estimation.learners.learner import Codes, Fitted, Learner, Predictor, log_softmax, standardisation
from texture_estimation.learners.sklearn_learner import packed, unpacked
from texture_estimation.recipe import check_keys
from texture_features.feature_set import choose, entry_of
from texture_features.features.spectral import amplitudes_of
from texture_features.windows import WindowBatch, first_difference, power


@dataclass(frozen=True)
class SignalEnergy:
    """Integral of the squared, zero-mean signal over the window, unit² s.

    Source: Roberge et al., "Textures recognition through tactile exploration", eq. 1.
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return ∫ s² dt."""
        rows = windows.centred_rows
        return (power(rows) * (rows.shape[-1] / windows.rate_hz))[..., None]


@dataclass(frozen=True)
class ArcLength:
    """Length of the line through the samples, with time in s and the signal in its unit.

    Source: Roberge et al., "Textures recognition through tactile exploration", eq. 2.
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return Σ √(Δt² + Δs²)."""
        lengths: Array = np.add.reduce(np.hypot(first_difference(windows.rows), 1.0 / windows.rate_hz), axis=-1)
        return lengths[..., None]


@dataclass(frozen=True)
class SpectralPeaks:
    """Frequency (Hz) and amplitude of the highest peaks of the Fourier transform.

    With 2048 points there are 1024 steps from 0 Hz to half the sampling rate, as in the paper (500 Hz there). Peaks
    that the spectrum lacks come last in either order; of equally high ones the lowest comes first.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.B.

    Examples
    --------
    >>> time_s = np.arange(2048) / 1024.0
    >>> tones = (np.sin(2 * np.pi * 50.0 * time_s) + 3 * np.sin(2 * np.pi * 200.0 * time_s))[:, None]
    >>> SpectralPeaks(peaks=2)(WindowBatch(tones, rate_hz=1024.0))[0].round(3).tolist()
    [200.0, 3.0, 50.0, 1.0]
    """

    per_channel: ClassVar[bool] = True

    peaks: int = param(
        5, 'Number of peaks; those that the spectrum lacks have frequency and amplitude 0.', low=1, high=64
    )
    gap_hz: float = param(
        10.0,
        'Smallest distance between two peaks; a larger one suppresses side peaks.',
        unit='Hz',
        low=0.0,
        high=1e6,
    )
    order: str = param('intensity', 'Order in which the peaks are returned.', choices=('intensity', 'frequency'))
    points: int = param(2048, 'FFT length in samples; a shorter window is zero-padded.', low=8, high=1 << 20)

    @property
    def names(self) -> tuple[str, ...]:
        """Frequency and amplitude of each peak."""
        return tuple(f'{number + 1}/{what}' for number in range(self.peaks) for what in ('frequency_hz', 'amplitude'))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return frequency and amplitude of each peak in turn."""
        amplitudes, step_hz = amplitudes_of(windows, self.points)
        bins, heights = highest_peaks(amplitudes, self.peaks, self.gap_hz / step_hz)
        values = np.stack((bins * step_hz, heights), axis=-1)
        if self.order == 'frequency':
            values = by_frequency(values)
        return values.reshape(*values.shape[:-2], -1)


def by_frequency(peaks: Array) -> Array:
    """Return peaks, the one of the lowest frequency first and those that are lacking last."""
    found = np.where(peaks[..., 1:] > 0, peaks[..., :1], np.inf)
    return np.take_along_axis(peaks, np.argsort(found, axis=-2, kind='stable'), axis=-2)


def highest_peaks(spectrum: Array, count: int, gap: float) -> tuple[Array, Array]:
    """Return bins and heights of the highest local maxima, highest first; 0 and 0 for those that are lacking.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.B.
    """
    left = np.zeros_like(spectrum)
    middle = spectrum[..., 1:-1]
    is_peak = (middle > spectrum[..., :-2]) & (middle >= spectrum[..., 2:])
    left[..., 1:-1] = np.where(is_peak, middle, 0.0)
    bins, heights = np.zeros((2, *spectrum.shape[:-1], count))
    index = np.arange(spectrum.shape[-1])
    for number in range(count):
        best = left.argmax(axis=-1)[..., None]
        height = np.take_along_axis(left, best, axis=-1)
        heights[..., number] = height[..., 0]
        bins[..., number] = np.where(height > 0, best, 0)[..., 0]
        left[np.abs(index - best) < max(gap, 1.0)] = 0.0
    return bins, heights


TIES = ('unclassified', 'nearest')


@cache
def _pairs(n_pairs: int) -> tuple[Array, Array]:
    """Return what a won pair adds to each label instead of a lost one, (n_pairs, n_labels), and what lost ones add."""
    first, second = np.triu_indices(round((1.0 + (1.0 + 8.0 * n_pairs) ** 0.5) / 2.0), k=1)
    labels = np.eye(second[-1] + 1)
    return labels[first] - labels[second], labels[second].sum(axis=0)


def pairs_won(decisions: Array | NDArray[np.float32], ties: str = TIES[0]) -> Array:
    """Return how many pairs each label wins, of decisions in the pairs (0, 1), (0, 2), …, (1, 2), ….

    Whole numbers without rounding: labels that tie are equal to the last bit, which means unclassified.
    """
    swing, lost = _pairs(decisions.shape[-1])
    won: Array = (decisions > 0) @ swing + lost
    if ties == 'nearest':
        clearness = decisions @ swing
        won = won + clearness / (3.0 * (np.abs(clearness) + 1.0))
    return won


@dataclass(frozen=True, eq=False)
class PairsPredictor:
    """Log softmax of the number of pairs won, (..., n_labels) of (..., n_features)."""

    decisions: Callable[[Array], Array]
    ties: str

    def __call__(self, X: Array) -> Array:
        """Return log softmax of the pairs won."""
        return log_softmax(pairs_won(self.decisions(X), self.ties))


# As MATLAB's trainlm: damping at the start, its steps and its end, and failures on what is held out.
FIRST_DAMPING, MORE, LESS, MAX_DAMPING = 1e-3, 10.0, 0.1, 1e10
PATIENCE = 6
SOLVED = 1e-7  # mean square error of targets of 0 and 1
SIGMOID, LINEAR = 'sigmoid', 'linear'
TRANSFERS: Mapping[str, Callable[[Array], Array]] = {SIGMOID: np.tanh, LINEAR: lambda given: given}
SLOPES: Mapping[str, Callable[[Array], Array]] = {
    SIGMOID: lambda active: 1.0 - active * active,
    LINEAR: np.ones_like,
}


@dataclass(frozen=True, eq=False)
class Network:
    """One hidden layer and one linear output: out · f(hidden · x + hidden_bias) + out_bias."""

    hidden: Array
    hidden_bias: Array
    out: Array
    out_bias: float
    transfer: str = SIGMOID

    @classmethod
    def random(cls, n_hidden: int, n_features: int, rng: np.random.Generator, transfer: str = SIGMOID) -> Network:
        """Return a network before its training, for inputs of unit variance."""
        hidden = rng.normal(size=(n_hidden, n_features)) / np.sqrt(n_features)
        bias = rng.uniform(-1.0, 1.0, n_hidden)
        return cls(hidden, bias, rng.normal(size=n_hidden) / np.sqrt(n_hidden), 0.5, transfer)

    def active(self, X: Array) -> Array:
        """Return what the hidden layer gives, (n, n_hidden) of (n, n_features)."""
        return TRANSFERS[self.transfer](X @ self.hidden.T + self.hidden_bias)

    def slope(self, active: Array) -> Array:
        """Return the derivative of the transfer function where it gives `active`, (n, n_hidden)."""
        return SLOPES[self.transfer](active)

    def __call__(self, X: Array) -> Array:
        """Return the output, (n,) of (n, n_features)."""
        return self.active(X) @ self.out + self.out_bias

    def jacobian(self, values: Array) -> tuple[Array, Array]:
        """Return the output, (n,), and its derivative by each weight, (n, n_weights), in the order of `moved`."""
        active = self.active(values)
        by_bias = self.slope(active) * self.out
        by_hidden = by_bias[:, :, None] * values[:, None, :]
        columns = (by_hidden.reshape(len(values), -1), by_bias, active, np.ones((len(values), 1)))
        return active @ self.out + self.out_bias, np.concatenate(columns, axis=1)

    def moved(self, step: Array) -> Network:
        """Return the network with a step, (n_weights,), added to its weights."""
        n_hidden = len(self.out)
        hidden, bias, out, out_bias = np.split(step, np.cumsum([self.hidden.size, n_hidden, n_hidden]))
        return Network(
            self.hidden + hidden.reshape(self.hidden.shape),
            self.hidden_bias + bias,
            self.out + out,
            self.out_bias + float(out_bias[0]),
            self.transfer,
        )


def fit_network(network: Network, values: Array, targets: Array, held: NDArray[np.bool_], iterations: int) -> Network:
    """Return the network after its training; of its states, the one with the least error on what is held out.

    Source: Hagan & Menhaj 1994; early stopping as in MATLAB's trainlm.
    """
    training, wanted = values[~held], targets[~held]
    held_rows = held if held.any() else ~held
    best, best_error = network, _error(network, values[held_rows], targets[held_rows])
    failures, damping = 0, FIRST_DAMPING
    for _ in range(iterations):
        stepped, damping = _step(network, training, wanted, damping)
        if stepped is None:
            break
        network = stepped
        error = _error(network, values[held_rows], targets[held_rows])
        if error < best_error:
            best, best_error, failures = network, error, 0
        else:
            failures += 1
        if failures >= PATIENCE or error < SOLVED:
            break
    return best


def _step(network: Network, values: Array, targets: Array, damping: float) -> tuple[Network | None, float]:
    """Return the network after one step that lessens the error, and the next damping; None if there is no such step."""
    n_weights = network.hidden.size + 2 * len(network.out) + 1
    linear = _by_examples if n_weights > len(values) else _by_weights
    output, curvature, slope_of, step_of = linear(network, values)
    residual = targets - output
    error = float(residual @ residual) / len(residual)
    slope = slope_of(residual)
    diagonal = np.diag_indices_from(curvature)
    undamped = curvature[diagonal]
    while damping <= MAX_DAMPING:
        curvature[diagonal] = undamped + damping
        solved: Array = np.asarray(np.linalg.solve(curvature, slope), dtype=np.float64)
        stepped = network.moved(step_of(solved))
        if _error(stepped, values, targets) < error:
            return stepped, max(damping * LESS, 1e-12)
        damping *= MORE
    return None, damping


# A network near its weights: with Jacobian J and residual r, a step is (JᵀJ + μ)⁻¹ Jᵀr = Jᵀ(JJᵀ + μ)⁻¹ r. Its output,
# JᵀJ or JJᵀ, what is solved for (of the residual), and the step (of what was solved).
Linear = tuple[Array, Array, Callable[[Array], Array], Callable[[Array], Array]]


def _by_weights(network: Network, values: Array) -> Linear:
    """Return the first form, for fewer weights than examples."""
    output, jacobian = network.jacobian(values)
    return output, jacobian.T @ jacobian, lambda residual: jacobian.T @ residual, lambda solved: solved


def _by_examples(network: Network, values: Array) -> Linear:
    """Return the second form, for fewer examples than weights; JJᵀ is made of its factors, without J."""
    active = network.active(values)
    by_bias = network.slope(active) * network.out
    curvature = (by_bias @ by_bias.T) * (values @ values.T + 1.0) + active @ active.T + 1.0

    def step(solved: Array) -> Array:
        weighted = by_bias * solved[:, None]
        parameters = ((weighted.T @ values).ravel(), weighted.sum(axis=0), solved @ active, solved.sum(keepdims=True))
        return np.concatenate(parameters)

    return active @ network.out + network.out_bias, curvature, lambda residual: residual, step


def _error(network: Network, values: Array, targets: Array) -> float:
    residual = targets - network(values)
    return float(residual @ residual) / len(residual)


@dataclass(frozen=True, eq=False)
class Networks:
    """Networks with one hidden layer and one linear output each, over the same standardised features."""

    mean: Array
    scale: Array
    hidden: Array
    hidden_bias: Array
    out: Array
    out_bias: Array
    transfer: str = SIGMOID

    def __post_init__(self) -> None:
        weights = self.hidden.reshape(-1, len(self.mean)) / self.scale
        object.__setattr__(self, '_weights', weights.T.copy())

    @classmethod
    def joined(cls, networks: Sequence[Network], mean: Array, scale: Array) -> Networks:
        """Return networks, all of the same shape, that were trained on standardised features."""
        hidden, bias, out = (
            np.stack([getattr(one, name) for one in networks]) for name in ('hidden', 'hidden_bias', 'out')
        )
        return cls(mean, scale, hidden, bias, out, np.array([one.out_bias for one in networks]), networks[0].transfer)

    def __call__(self, X: Array) -> Array:
        """Return the outputs, (..., n_networks) of (..., n_features)."""
        active = (X - self.mean) @ self._weights  # type: ignore[attr-defined]
        active += self.hidden_bias.reshape(-1)
        layers = TRANSFERS[self.transfer](active).reshape(*X.shape[:-1], *self.out.shape)
        outputs: Array = np.add.reduce(layers * self.out, axis=-1)
        return outputs + self.out_bias


NOTE = 'not calibrated: the pairs won are counted'
UNDECIDED = -1


def fitted_predictor(learner: Any, X: Array, y: Codes, groups: Codes) -> Predictor:
    """Return what a learner has learnt, without the form in which a model file stores it, which takes time."""
    if hasattr(learner, 'machine'):
        return PairsPredictor(partial(decisions_of, learner.machine(X, y, groups)), learner.ties)
    return cast(Predictor, learner.predictor(learner.fit(X, y, groups).parameters))


def decided_by_slide(scores: Array, n_slides: int, rule: EvidenceRule, hop_ratio: float) -> Codes:
    """Return the label of each slide by all its windows, (n_slides,) of (n_slides · n_windows, n_labels)."""
    n_labels = scores.shape[1]
    evidence = rule.window_evidence(log_softmax(scores)).reshape(n_slides, -1, n_labels).swapaxes(0, 1)
    means, counts = followed(rule, evidence.reshape(len(evidence), -1), min(hop_ratio, 1.0))
    posterior = rule.log_posterior(means[-1].reshape(n_slides, n_labels), counts[-1], 1.0)
    decided: Codes = posterior.argmax(axis=1)
    decided[(posterior == posterior.max(axis=1, keepdims=True)).sum(axis=1) > 1] = UNDECIDED
    return decided


def decisions_of(machine: Any, X: Array) -> Array:
    """Return the decisions of scikit-learn's machine for all pairs, (..., n_pairs), positive for the first label."""
    decisions = np.asarray(machine.decision_function(X.reshape(-1, X.shape[-1])), dtype=np.float64)
    if decisions.ndim == 1:  # of two labels, where scikit-learn turns the sign round
        decisions = -decisions[:, None]
    return decisions.reshape(*X.shape[:-1], -1)


def pairs_of_machine(parameters: Mapping[str, Any]) -> PairsPredictor:
    """Return the predictor of a stored machine for all pairs."""
    return PairsPredictor(partial(decisions_of, unpacked(parameters['packed'])), str(parameters['ties']))


@dataclass(frozen=True)
class SvmPairs:
    """RBF SVMs for all pairs with one box constraint and kernel scale; most pairs won.

    A pipeline of scikit-learn: `StandardScaler`, which is ours, and `SVC` with `exp(-|x - s|² / kernel_scale²)`,
    MATLAB's sense of the scale: gamma = 1 / kernel_scale².

    Source: Roberge et al., "Textures recognition through tactile exploration", sections III.C and IV.
    """

    box_constraint: float = param(
        10.0,
        'Penalty of a training error (box constraint C); a larger one fits the training data more closely.',
        low=1e-6,
        high=1e9,
    )
    kernel_scale: float = param(
        3.0,
        "Width of the RBF kernel (MATLAB's KernelScale); a larger one smooths the decision more.",
        low=1e-9,
        high=1e9,
    )
    ties: ClassVar[str] = TIES[0]

    def machine(self, X: Array, y: Codes, groups: Codes) -> Any:
        """Return the fitted pipeline."""
        from sklearn.pipeline import make_pipeline  # noqa: PLC0415  # scikit-learn takes a second to import
        from sklearn.preprocessing import StandardScaler  # noqa: PLC0415
        from sklearn.svm import SVC  # noqa: PLC0415

        svc = SVC(C=self.box_constraint, gamma=self.kernel_scale**-2, decision_function_shape='ovo')
        return make_pipeline(StandardScaler(), svc).fit(X, y)

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        return Fitted({'packed': packed(self.machine(X, y, groups), 'SVC'), 'ties': self.ties}, None, NOTE)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> PairsPredictor:
        """Return the predictor made from the stored parameters."""
        return pairs_of_machine(parameters)


ROUNDED_UP = 0.5  # an output above it is 1, which is the first label of the pair
# One of this many is held out of each network's training to stop it: MATLAB holds out 15 %.
HELD_OUT = 7


@dataclass(frozen=True)
class AnnPairs:
    """A network with a sigmoid hidden layer and a linear, rounded output for each pair; most pairs won.

    Trained by the Levenberg-Marquardt method with early stopping on every seventh slide, as MATLAB does by default.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.C.
    """

    hidden: int = param(
        10,
        'Number of neurons in the hidden layer; more neurons separate finer and cost computing time.',
        low=1,
        high=200,
    )
    iterations: int = param(30, 'Largest number of training iterations.', low=1, high=10_000)
    seed: int = param(0, 'Seed of the initial weights; equal seeds give equal models.', low=0)

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        mean, scale = standardisation(X)
        standard = (X - mean) / scale
        held = _held_out(y, groups)
        rng = np.random.default_rng(self.seed)
        n_labels = int(y.max()) + 1
        networks = []
        for first, second in combinations(range(n_labels), 2):
            rows = np.flatnonzero((y == first) | (y == second))
            start = Network.random(self.hidden, X.shape[1], rng)
            targets = (y[rows] == first).astype(np.float64)
            networks.append(fit_network(start, standard[rows], targets, held[rows], self.iterations))
        return Fitted({'networks': asdict(Networks.joined(networks, mean, scale))}, None, NOTE)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> PairsPredictor:
        """Return the predictor made from the stored parameters."""
        networks = Networks(**parameters['networks'])
        return PairsPredictor(lambda X: networks(X) - ROUNDED_UP, TIES[0])


def _held_out(y: Codes, groups: Codes) -> NDArray[np.bool_]:
    """Return which examples decide when to stop: every seventh slide of a label, or example if there are few slides."""
    held = np.zeros(len(y), dtype=bool)
    for code in np.unique(y):
        rows = np.flatnonzero(y == code)
        slides = np.unique(groups[rows], return_inverse=True)[1].reshape(-1)
        number = slides if slides.max() + 1 >= HELD_OUT else np.arange(len(rows))
        held[rows] = number % HELD_OUT == HELD_OUT - 1
    return held


TUNED_NOTE = 'not calibrated: the pairs won are counted; {} of {} pairs have separate variables'
KEYS = ('learner', 'pairs')
PAIR_KEYS = ('pair', 'inputs', 'learner')
# What decides a pair.
OF_PAIRS: Mapping[str, type[SvmPairs] | type[AnnPairs]] = {
    'texture_papers.roberge:SvmPairs': SvmPairs,
    'texture_papers.roberge:AnnPairs': AnnPairs,
}


@dataclass(frozen=True)
class TunedPair:
    """The variables of one pair of textures."""

    labels: tuple[str, str]
    inputs: tuple[str, ...]
    learner_name: str
    learner: Learner

    @classmethod
    def from_recipe(cls, entry: Any, where: str) -> TunedPair:
        """Build from one entry of the list `pairs` of a recipe."""
        if not isinstance(entry, Mapping):
            raise InvalidParameter(f'{where}: came {safe_repr(entry)}; a mapping with pair and learner is needed')
        check_keys(entry, PAIR_KEYS, where)
        labels, inputs = _texts(entry.get('pair'), 'pair', where), _texts(entry.get('inputs') or [], 'inputs', where)
        if len(labels) != 2 or labels[0] == labels[1]:
            raise InvalidParameter(f'{where}: pair is {list(labels)}; the labels of two textures are needed')
        learner = choose(OF_PAIRS, entry.get('learner', 'texture_papers.roberge:SvmPairs'), 'learner of pairs', where)
        return cls((labels[0], labels[1]), inputs, *learner)

    def as_recipe(self) -> dict[str, Any]:
        """Return the entry of a recipe."""
        of_all: dict[str, Any] = {'inputs': list(self.inputs)} if self.inputs else {}
        return {'pair': list(self.labels), **of_all, 'learner': {self.learner_name: entry_of(self.learner)}}


@dataclass(frozen=True)
class TunedPairs:
    """A machine or network for each pair of textures, each with separate features and parameters; most pairs won.

    The inputs of the recipe hold the features of all pairs; each pair is trained on, and sees, those of its inputs.
    A pair that is not listed has all features and the common learner.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.C: the learning is adapted
    to each pair of textures.
    """

    learner_name: str = 'texture_papers.roberge:SvmPairs'
    learner: Learner = field(default_factory=SvmPairs)
    pairs: tuple[TunedPair, ...] = ()
    names: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        listed = [frozenset(pair.labels) for pair in self.pairs]
        for labels in listed:
            if listed.count(labels) > 1:
                raise InvalidParameter(f'the pair {sorted(labels)} is listed twice; list it once')

    @classmethod
    def from_recipe(cls, values: Mapping[str, Any], where: str) -> TunedPairs:
        """Build from the section of a recipe."""
        if not isinstance(values, Mapping) or not isinstance(values.get('pairs') or [], list):
            raise InvalidParameter(f'{where}: came {safe_repr(values)}; a mapping with a list of pairs is needed')
        check_keys(values, KEYS, where)
        learner = choose(OF_PAIRS, values.get('learner', 'texture_papers.roberge:SvmPairs'), 'learner of pairs', where)
        entries = enumerate(values.get('pairs') or [], 1)
        pairs = tuple(TunedPair.from_recipe(entry, f'{where}, pair {number}') for number, entry in entries)
        try:
            return cls(*learner, pairs)
        except InvalidParameter as error:
            raise InvalidParameter(f'{where}: {error}') from error

    def as_recipe(self) -> dict[str, Any]:
        """Return the section of a recipe."""
        return {
            'learner': {self.learner_name: entry_of(self.learner)},
            'pairs': [pair.as_recipe() for pair in self.pairs],
        }

    def of_examples(self, names: Sequence[str], labels: Sequence[str]) -> TunedPairs:
        """Return the learner for examples with these features and textures."""
        bound = replace(self, names=tuple(names), labels=tuple(labels))
        for pair in self.pairs:
            bound._columns(pair)
        return bound

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        if self.pairs and (len(self.names), len(self.labels)) != (X.shape[1], int(y.max()) + 1):
            raise InvalidParameter(
                'the pairs of the recipe have separate variables, and the names of the features and textures are '
                "not known; train with `texture train`, or call the learner's `of_examples` first"
            )
        tuned = {frozenset(pair.labels): pair for pair in self.pairs}
        common = TunedPair(('', ' '), (), self.learner_name, self.learner)
        members: list[dict[str, Any]] = []
        n_tuned, pairs = 0, list(combinations(range(int(y.max()) + 1), 2))
        for number, (first, second) in enumerate(pairs):
            labels = frozenset(self.labels[code] for code in (first, second)) if self.pairs else frozenset()
            settings = tuned.get(labels, common)
            n_tuned += settings is not common
            columns = self._columns(settings) if settings.inputs else np.arange(X.shape[1])
            rows = np.flatnonzero((y == first) | (y == second))
            codes = (y[rows] == second).astype(np.intp)
            fitted = settings.learner.fit(X[np.ix_(rows, columns)], codes, groups[rows])
            member = {'number': number, 'columns': columns, 'learner': settings.learner_name}
            members.append({**member, 'parameters': fitted.parameters})
        parameters = {'n_pairs': len(pairs), 'members': members}
        return Fitted(parameters, None, TUNED_NOTE.format(n_tuned, len(pairs)))

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> PairsPredictor:
        """Return the predictor made from the stored parameters."""
        n_pairs, members = int(parameters['n_pairs']), parameters['members']
        if sorted(int(one['number']) for one in members) != list(range(n_pairs)):
            raise ModelMismatch(f'its {n_pairs} pairs are decided by {len(members)} learners, or some not once')
        # Sorted by their pairs, each with the features that it sees.
        fitted = [
            (one['columns'], OF_PAIRS[one['learner']].predictor(one['parameters']))
            for one in sorted(members, key=lambda one: int(one['number']))
        ]

        def decisions(X: Array) -> Array:
            return np.stack([predictor.decisions(X[..., columns])[..., 0] for columns, predictor in fitted], axis=-1)

        return PairsPredictor(decisions, TIES[0])

    def _columns(self, pair: TunedPair) -> Codes:
        """Return the numbers of the features that a pair sees."""
        prefixes = tuple(f'{topic}/' for topic in pair.inputs)
        columns = np.flatnonzero([not prefixes or name.startswith(prefixes) for name in self.names])
        for topic in prefixes:
            if not any(name.startswith(topic) for name in self.names):
                known = ', '.join(dict.fromkeys(name.split('/')[0] for name in self.names))
                raise InvalidParameter(
                    f"pair {list(pair.labels)} sees the input '{topic[:-1]}', which is not among the inputs of the "
                    f'recipe ({known}); name one of them'
                )
        return columns


def _texts(values: Any, what: str, where: str) -> tuple[str, ...]:
    if not isinstance(values, list | tuple) or not all(isinstance(value, str) for value in values):
        raise InvalidParameter(f'{where}: {what} is {safe_repr(values)}; a list of names is needed')
    return tuple(values)

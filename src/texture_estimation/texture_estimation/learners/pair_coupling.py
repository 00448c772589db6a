"""From decisions between two labels each to calibrated probabilities of all labels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.log_probabilities import log_loss, log_softmax

# exp(500) is far from overflow, and no calibrated margin comes near.
LARGEST = 500.0
# Of the fit of a sigmoid. A line that fell would turn the machine's answer round.
MAX_STEPS, MIN_SHARE, FLAT, RIDGE, MIN_SLOPE, TINY = 100, 1e-10, 1e-8, 1e-12, 1e-3, 1e-300


@dataclass(frozen=True, eq=False)
class PairCoupling:
    """Sigmoids of the pairwise decision values, coupled in closed form.

    With r_ij = 1 / (1 + exp(-(slope_ij f_ij + offset_ij))), the probability of label i among all is proportional to
    (1 / (Σ_j 1/r_ij - (n - 2)))^(1/temperature) = (1 / (1 + Σ_j exp(-(slope_ij f_ij + offset_ij))))^(1/temperature).

    Source: Platt 1999 for the sigmoids; Price, Knerr, Personnaz & Dreyfus 1995, eq. 5, for the coupling.

    Parameters
    ----------
    slopes, offsets : (n_pairs,)
        Pairs in the order (0, 1), (0, 2), …, (1, 2), …; a positive decision value speaks for the first.
    temperature
        Above 1: the probabilities are drawn together.

    Examples
    --------
    >>> coupling = PairCoupling(2, slopes=np.array([2.0]), offsets=np.array([0.0]), temperature=1.0)
    >>> np.exp(coupling(np.array([0.5]))).round(3).tolist()  # 1 / (1 + exp(-2 · 0.5))
    [0.731, 0.269]
    """

    n_labels: int
    slopes: Array
    offsets: Array
    temperature: float

    def __post_init__(self) -> None:
        pairs = np.array(list(combinations(range(self.n_labels), 2)))
        sides = np.zeros((2 * len(pairs), self.n_labels))
        sides[np.arange(len(pairs)), pairs[:, 0]] = 1.0
        sides[np.arange(len(pairs)) + len(pairs), pairs[:, 1]] = 1.0
        object.__setattr__(self, '_sides', sides)

    def __call__(self, decisions: Array) -> Array:
        """Return log-probabilities, (..., n_labels), of decision values, (..., n_pairs)."""
        return log_softmax(self.scores(decisions) / self.temperature)

    def scores(self, decisions: Array) -> Array:
        """Return -log(1 + Σ_j exp(-margin)), (..., n_labels).

        Parameters
        ----------
        decisions : (..., n_pairs)
            Positive for the first label of a pair.

        Returns
        -------
        (..., n_labels)
            At most 0.
        """
        margins = decisions * self.slopes + self.offsets
        n_pairs = margins.shape[-1]
        against = np.empty((*margins.shape[:-1], 2 * n_pairs))
        np.negative(margins, out=against[..., :n_pairs])
        against[..., n_pairs:] = margins
        np.minimum(against, LARGEST, out=against)
        odds = np.exp(against, out=against)
        scores: Array = -np.log1p(odds @ self._sides)  # type: ignore[attr-defined]
        return scores


def uncalibrated(n_labels: int) -> PairCoupling:
    """Return the coupling with middling sigmoids, for when nothing can be held out."""
    n_pairs = n_labels * (n_labels - 1) // 2
    return PairCoupling(n_labels, np.full(n_pairs, 2.0), np.zeros(n_pairs), 1.0)


def fit_coupling(decisions: Array, y: Codes, n_labels: int) -> PairCoupling:
    """Fit sigmoids and temperature to held-out decision values, (n, n_pairs), and label numbers, (n,).

    Parameters
    ----------
    decisions : (n, n_pairs)
        Decision values of held-out examples.
    y : (n,)
        Numbers of their labels.
    n_labels
        At least 2.

    Returns
    -------
    PairCoupling
        With a temperature that makes the labels most probable.
    """
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  # takes 0.3 s, and only training needs it

    pairs = combinations(range(n_labels), 2)
    sigmoids = np.array([_fit_sigmoid(decisions[:, number], y, *pair) for number, pair in enumerate(pairs)])
    coupling = PairCoupling(n_labels, sigmoids[:, 0], sigmoids[:, 1], 1.0)
    scores = coupling.scores(decisions)
    best = minimize_scalar(
        lambda log_t: log_loss(log_softmax(scores / np.exp(log_t)), y), bounds=(-2.0, 4.0), method='bounded'
    )
    return PairCoupling(n_labels, coupling.slopes, coupling.offsets, float(np.exp(best.x)))


def _fit_sigmoid(decisions: Array, y: Codes, first: int, second: int) -> Array:
    """Return slope and offset of the sigmoid that gives the probability of `first` against `second`.

    Newton's method with halved steps (Lin, Lin & Weng 2007).
    """
    chosen = (y == first) | (y == second)
    size = math.sqrt(max(float(np.square(decisions[chosen]).mean()), TINY))
    rows = np.stack([decisions[chosen] / size, np.ones(chosen.sum())])
    is_first = y[chosen] == first
    n_first, n_second = int(is_first.sum()), int((~is_first).sum())
    # Platt's targets: never quite 0 or 1, so that separable pairs keep a finite slope.
    targets = np.where(is_first, (n_first + 1.0) / (n_first + 2.0), 1.0 / (n_second + 2.0))

    line, loss = np.array([0.0, math.log((n_first + 1.0) / (n_second + 1.0))]), math.inf
    step, share = np.zeros(2), 1.0
    for _ in range(MAX_STEPS):
        margins = (line + share * step) @ rows
        now = float(np.logaddexp(0.0, margins).sum() - targets @ margins)
        if now > loss and share > MIN_SHARE:  # too far: the loss is convex, so a part of the step helps
            share /= 2.0
            continue
        line, loss, share = line + share * step, now, 1.0
        probability = 1.0 / (1.0 + np.exp(-np.clip(margins, -LARGEST, LARGEST)))
        slope = rows @ (probability - targets)
        if np.abs(slope).max() < FLAT:
            break
        bend = (rows * (probability * (1.0 - probability))) @ rows.T + RIDGE * np.eye(2)
        step = -np.linalg.solve(bend, slope)
    return np.array([max(line[0] / size, MIN_SLOPE), line[1]])

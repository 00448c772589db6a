# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Support vector machines with coupled pairs: trained by scikit-learn, stored and evaluated as plain arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any, ClassVar

import numpy as np

from texture_core.config import param
from texture_core.types import Array
from texture_estimation.learners.learner import (
    UNCALIBRATED,
    Codes,
    Fitted,
    Predictor,
    assign_folds,
    fit_temperature,
    group_means,
    held_out_scores,
    log_softmax,
    standardisation,
)

# --------------------
# From decisions between two labels each to calibrated probabilities of all labels.

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
        """Return -log(1 + Σ_j exp(-margin)), (..., n_labels)."""
        margins = decisions * self.slopes + self.offsets
        n_pairs = margins.shape[-1]
        against = np.empty((*margins.shape[:-1], 2 * n_pairs))
        np.negative(margins, out=against[..., :n_pairs])
        against[..., n_pairs:] = margins
        np.minimum(against, LARGEST, out=against)
        odds = np.exp(against, out=against)
        return -np.log1p(odds @ self._sides)  # type: ignore[attr-defined]


def fit_coupling(decisions: Array, y: Codes, n_labels: int) -> PairCoupling:
    """Fit sigmoids and temperature to held-out decision values, (n, n_pairs), and label numbers, (n,)."""
    pairs = combinations(range(n_labels), 2)
    sigmoids = np.array([_fit_sigmoid(decisions[:, number], y, *pair) for number, pair in enumerate(pairs)])
    coupling = PairCoupling(n_labels, sigmoids[:, 0], sigmoids[:, 1], 1.0)
    temperature = fit_temperature(coupling.scores(decisions), y)
    return PairCoupling(n_labels, coupling.slopes, coupling.offsets, temperature)


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


# --------------------
# Standardised RBF support vector machines, one against one, as plain arrays.

CACHE_MB = 500


@dataclass(frozen=True, eq=False)
class RbfMachines:
    """The decisions of scikit-learn's SVC on standardised features, without its overhead for single windows.

    The support vectors of each label are padded to the same number, so that every sum of all pairs is one product of
    arrays: in pair (i, j), label i's vectors carry coefficient row j - 1 and label j's carry row i.
    """

    mean: Array
    scale: Array
    vectors: Array
    squares: Array
    coefficients: Array
    intercepts: Array
    gamma: float
    projection: Array | None = None

    def __post_init__(self) -> None:
        first, second = np.triu_indices(self.n_labels, k=1)
        # Where in the (n_labels, n_labels - 1) sums the two halves of each pair stand.
        object.__setattr__(self, '_first', first * (self.n_labels - 1) + second - 1)
        object.__setattr__(self, '_second', second * (self.n_labels - 1) + first)

    @classmethod
    def fit(
        cls, X: Array, y: Codes, mean: Array, scale: Array, *, c: float, gamma: float, projection: Array | None = None
    ) -> RbfMachines:
        """Return the machines of all pairs of labels, trained by scikit-learn."""
        # Imported here: scikit-learn takes a second, and who only recognises does without it.
        from sklearn.svm import SVC  # noqa: PLC0415

        standard = ((X if projection is None else X @ projection) - mean) / scale
        svc = SVC(C=c, kernel='rbf', gamma=gamma, cache_size=CACHE_MB).fit(standard, y)
        counts = svc.n_support_
        n_labels, width = len(counts), int(counts.max())
        vectors = np.zeros((n_labels, width, X.shape[1]))
        coefficients = np.zeros((n_labels, n_labels - 1, width))
        # scikit-learn turns the sign round for two labels
        sign = -1.0 if n_labels == 2 else 1.0
        start = 0
        for label, count in enumerate(counts):
            vectors[label, :count] = svc.support_vectors_[start : start + count]
            coefficients[label, :, :count] = sign * svc.dual_coef_[:, start : start + count]
            start += count
        flat = vectors.reshape(-1, X.shape[1])
        squares, intercepts = gamma * (flat * flat).sum(axis=1), sign * np.asarray(svc.intercept_)
        return cls(mean, scale, 2.0 * gamma * flat, squares, coefficients, intercepts, gamma, projection)

    @property
    def n_labels(self) -> int:
        """Number of labels."""
        return len(self.coefficients)

    def __call__(self, X: Array) -> Array:
        """Return the decision value of each pair, (..., n_pairs) of (..., n_features); positive for its first label.

        Pairs come in the order (0, 1), (0, 2), …, (1, 2), ….
        """
        kernel = self._kernel(X)
        n_labels, rows, width = self.coefficients.shape
        parameters = self.coefficients @ kernel.reshape(*kernel.shape[:-1], n_labels, width, 1)
        sums = parameters.reshape(*kernel.shape[:-1], n_labels * rows)
        decisions: Array = sums.take(self._first, axis=-1)  # type: ignore[assignment,attr-defined]
        decisions += sums.take(self._second, axis=-1)  # type: ignore[attr-defined]
        decisions += self.intercepts
        return decisions

    def _kernel(self, X: Array) -> Array:
        """Return the kernel of each window with each support vector, (..., n_vectors)."""
        projected = X if self.projection is None else X @ self.projection
        standard = (projected - self.mean) / self.scale
        # |x - s|² = |x|² + |s|² - 2 x·s, one product with all support vectors
        squares = self.gamma * np.add.reduce(standard * standard, axis=-1, keepdims=True)
        exponents = self.vectors @ standard if standard.ndim == 1 else standard @ self.vectors.T
        exponents -= self.squares + squares
        return np.exp(exponents, out=exponents)


# --------------------
# Within-class whitening: shrink the directions in which slides of one texture differ among themselves.


def within_class_whitening(X: Array, y: Codes, groups: Codes, ridge: float, differences: Array | None = None) -> Array:
    """Return the matrix that whitens what is no difference between textures, to be multiplied from the right.

    Slides of one texture differ by force, speed and place. The covariance of their means about the mean of the texture
    says in which directions; a difference along these tells little. `differences` add what else is known to matter
    nothing, such as how the load moves when friction begins to shear a finger that was at rest: a slide in the other
    direction shears it the other way.

    Source: within-class covariance normalisation, Hatch, Kajarekar & Stolcke 2006.
    """
    slides, first, rows = np.unique(groups, return_index=True, return_inverse=True)
    means = group_means(X, rows)
    _, labels = np.unique(y[first], return_inverse=True)
    centres = group_means(means, labels)
    covariance = _mean_square(means - centres[labels])
    if differences is not None:
        own = differences[slides]
        covariance = covariance + _mean_square(own[np.isfinite(own).all(axis=1)])
    mean_power = float(np.trace(covariance)) / X.shape[1]
    if mean_power <= 0.0:
        return np.eye(X.shape[1])
    strengths, directions = np.linalg.eigh(covariance / mean_power)
    return np.asarray((directions / np.sqrt(np.maximum(strengths, 0.0) + ridge)) @ directions.T)


def _mean_square(deviations: Array) -> Array:
    """Return the mean outer product, (n_features, n_features)."""
    return deviations.T @ deviations / max(1, len(deviations))


# --------------------
# RBF support vector machine, one against one, with calibrated probabilities.


@dataclass(frozen=True)
class SvmRbf:
    """Standardised features, RBF kernel, one against one; probabilities calibrated on slides held out.

    Not scikit-learn's SVC(probability=True): its inner cross-validation mixes the windows of one slide.

    Examples
    --------
    >>> import numpy as np
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> fitted = SvmRbf().fit(values, codes, groups)
    >>> SvmRbf.predictor(fitted.parameters)(values).argmax(axis=1).tolist() == codes.tolist()
    True
    """

    extras: ClassVar[tuple[str, ...]] = ('differences', 'parts')

    c: float = param(
        10.0,
        'Penalty of a training error (box constraint C); a larger one fits the training data more closely.',
        low=1e-6,
        high=1e9,
    )
    gamma: float = param(
        0.0,
        'Gamma of the kernel exp(-gamma d²); 0: 1 / (n_features · variance). Larger is narrower.',
        low=0.0,
        high=1e9,
    )
    common_scale: bool = param(
        False, 'Whether all features share one scale, for features of one kind such as taxel means.'
    )
    folds: int = param(
        5,
        'Number of cross-validation folds for the calibration; more folds take longer to train.',
        low=2,
        high=50,
    )

    whitening: float = param(
        0.0,
        'Ridge of the whitening of what differs within a texture, relative to its mean variance: a smaller '
        'one leaves less of the directions in which slides of one texture differ; 0: no whitening.',
        low=0.0,
        high=1e6,
    )

    def fit(
        self, X: Array, y: Codes, groups: Codes, differences: Array | None = None, parts: Codes | None = None
    ) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,).

        Parameters
        ----------
        X : (n, n_features)
            Features of windows; finite.
        y : (n,)
            Number of the label of each, from 0, without gaps.
        groups : (n,)
            Number of the slide of each.
        differences : (n_groups, n_features) or None
            For the number of each slide a difference that is none of textures, for the whitening; NaN if not known.
        parts : (n_groups,) or None
            Part in which the slide of each number is held out; by slides if None.

        Returns
        -------
        Fitted
            Parameters, log-probabilities when held out, and a note on the calibration.
        """
        n_labels = int(y.max()) + 1
        n_pairs = n_labels * (n_labels - 1) // 2
        split = assign_folds(y, groups, self.folds, parts)
        machines = self._fit(X, y, groups, differences)
        if split is None:
            coupling = PairCoupling(n_labels, np.full(n_pairs, 2.0), np.zeros(n_pairs), 1.0)  # middling sigmoids
            held_out, note = None, UNCALIBRATED
        else:
            folds_of, note = split
            decisions = held_out_scores(
                lambda held: self._fit(X[~held], y[~held], groups[~held], differences),
                X, folds_of, n_pairs,
            )  # fmt: skip
            coupling = fit_coupling(decisions, y, n_labels)
            held_out = coupling(decisions)
        return Fitted(
            {'machines': asdict(machines), 'coupling': asdict(coupling)},
            held_out,
            note,
            temperature=coupling.temperature,
        )

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Predictor:
        """Return the predictor made from the stored parameters."""
        machines, coupling = RbfMachines(**parameters['machines']), PairCoupling(**parameters['coupling'])
        return lambda X: coupling(machines(X))

    def _fit(self, X: Array, y: Codes, groups: Codes, differences: Array | None) -> RbfMachines:
        projection = within_class_whitening(X, y, groups, self.whitening, differences) if self.whitening else None
        projected = X if projection is None else X @ projection
        mean, scale = standardisation(projected)
        if self.common_scale:
            scale = np.full(X.shape[1], float(np.sqrt(projected.var(axis=0).mean())) or 1.0)
        gamma = self.gamma or 1.0 / (X.shape[1] * max(float(((projected - mean) / scale).var()), 1e-12))
        return RbfMachines.fit(X, y, mean, scale, c=self.c, gamma=gamma, projection=projection)

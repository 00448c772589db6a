"""RBF support vector machines for all pairs, fitted to halves that share one matrix of distances."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.pair_votes import PairVotes
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.learners.svm_pairs import SvmPairs
from texture_estimation.search.halves import Mask
from texture_estimation.search.surrogates.surrogate import ScoresOfHalf

# A hundred times libsvm's: single decisions near the border differ, individuals rank alike, and a sixth of the time is
# saved where it takes longest.
TOLERANCE = 1e-1
CACHE_MB = 200
# Rows of the kernel computed in one go: they should fit the processor's cache.
ROWS = 64
Kernel = NDArray[np.float32]


def svm_pairs(learner: SvmPairs, X: Array, y: Codes, groups: Codes) -> ScoresOfHalf:
    """Return a scorer of one half split by the pairs won.

    The kernel is computed once for all halves. So the features are standardised by all examples, not by the half
    alone: their scale differs by about one per cent, and no label is used. `exact` does it without that.
    """
    kernel = kernel_of(X, learner.kernel_scale, standardise=learner.standardise)
    votes = PairVotes(int(y.max()) + 1)

    def scores(training: Mask) -> Array:
        decisions = pair_decisions(kernel, y, training, learner.box_constraint)
        return votes.counted(decisions, learner.ties)

    return scores


def kernel_of(values: Array, scale: float, *, standardise: bool = True) -> Kernel:
    """Return exp(-|x - y|² / scale²) of all examples, (n, n) of (n, n_features).

    In single precision, as libsvm's own cache holds it. With each example's square as two more columns, one product
    of matrices gives -|x - y|² / 2.

    Parameters
    ----------
    values : (n, n_features)
        Features of all examples.
    scale
        Width of the kernel, above 0.
    standardise
        Whether the features are standardised first.

    Returns
    -------
    (n, n) float32
        0 to 1.
    """
    mean, deviation = standardisation(values)
    standard = (values - mean) / deviation if standardise else values - mean
    squares = -0.5 * (standard * standard).sum(axis=1, keepdims=True)
    ones = np.ones_like(squares)
    left = np.concatenate([standard, squares, ones], axis=1) * (2.0 * scale**-2)
    right = np.concatenate([standard, ones, squares], axis=1).T
    kernel = np.empty((len(values), len(values)), dtype=np.float32)
    for start in range(0, len(values), ROWS):
        rows = slice(start, start + ROWS)
        np.exp(np.minimum(left[rows] @ right, 0.0).astype(np.float32), out=kernel[rows])
    return kernel


def pair_decisions(kernel: Kernel, y: Codes, training: Mask, box_constraint: float) -> NDArray[np.float32]:
    """Return the decision value of each pair for every example, (n, n_pairs); positive for the pair's first label.

    Parameters
    ----------
    kernel : (n, n)
        As `kernel_of` gives it.
    y : (n,)
        Number of the label of each example.
    training : (n,) bool
        Which examples are trained on.
    box_constraint
        Penalty of a training error.

    Returns
    -------
    (n, n_pairs) float32
        Pairs in the order (0, 1), (0, 2), …, (1, 2), ….
    """
    # a second, which who only looks up names need not wait for
    from sklearn import config_context  # noqa: PLC0415
    from sklearn.svm import SVC  # noqa: PLC0415

    rows = np.flatnonzero(training)
    known = kernel.take(rows, axis=0)
    svc = SVC(C=box_constraint, kernel='precomputed', tol=TOLERANCE, cache_size=CACHE_MB)
    with config_context(assume_finite=True, skip_parameter_validation=True):  # a tenth of the time
        svc.fit(known.take(rows, axis=1).astype(np.float64), y[rows])
    coefficients, intercepts = _pair_coefficients(svc)
    # Zeros for what is no support vector: leaving rows of the kernel out would take longer.
    every = np.zeros((len(rows), coefficients.shape[1]), dtype=np.float32)
    every[svc.support_] = coefficients
    decisions: NDArray[np.float32] = known.T @ every
    decisions += intercepts.astype(np.float32)
    return decisions


def _pair_coefficients(svc: Any) -> tuple[Array, Array]:
    """Return the coefficient of each support vector in each pair, (n_vectors, n_pairs), and the intercepts."""
    counts = svc.n_support_
    n_labels = len(counts)
    # scikit-learn turns the sign round for two labels
    sign = -1.0 if n_labels == 2 else 1.0
    ends = np.concatenate([[0], np.cumsum(counts)])
    first, second = np.triu_indices(n_labels, k=1)
    coefficients = np.zeros((int(ends[-1]), len(first)))
    for pair, (one, other) in enumerate(zip(first.tolist(), second.tolist(), strict=True)):
        coefficients[ends[one] : ends[one + 1], pair] = svc.dual_coef_[other - 1, ends[one] : ends[one + 1]]
        coefficients[ends[other] : ends[other + 1], pair] = svc.dual_coef_[one, ends[other] : ends[other + 1]]
    return sign * coefficients, sign * np.asarray(svc.intercept_)

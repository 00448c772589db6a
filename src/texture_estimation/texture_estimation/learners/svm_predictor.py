"""A standardised RBF support vector machine, one against one, as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.pair_coupling import PairCoupling


@dataclass(frozen=True, eq=False)
class SvmPredictor:
    """The decisions of scikit-learn's StandardScaler and SVC, without its overhead for single windows.

    The support vectors of each label are padded to the same number, so that every sum of all pairs is one product of
    arrays: in pair (i, j), label i's vectors carry coefficient row j - 1 and label j's carry row i.

    Parameters
    ----------
    mean, scale : (n_features,)
        Of the standardisation.
    vectors : (n_labels · width, n_features)
        Standardised support vectors, label by label, times 2 gamma.
    squares : (n_labels · width,)
        Square of the length of each support vector, times gamma.
    coefficients : (n_labels, n_labels - 1, width)
        0 for padding.
    intercepts : (n_pairs,)
    gamma
        Of the kernel exp(-gamma |x - s|²).
    coupling
        From decision values to probabilities.
    projection : (n_features, n_features) or None
        What features are multiplied with before the standardisation.

    Examples
    --------
    >>> from sklearn.preprocessing import StandardScaler
    >>> from sklearn.svm import SVC
    >>> from texture_estimation.learners.pair_coupling import uncalibrated
    >>> values, codes = np.random.default_rng(0).standard_normal((30, 2)), np.arange(30) % 3
    >>> scaler = StandardScaler().fit(values)
    >>> svc = SVC(gamma=0.5, decision_function_shape='ovo').fit(scaler.transform(values), codes)
    >>> predictor = export(scaler, svc, uncalibrated(3))
    >>> isinstance(predictor, SvmPredictor)
    True
    >>> np.allclose(predictor.decisions(values), svc.decision_function(scaler.transform(values)))
    True
    """

    mean: Array
    scale: Array
    vectors: Array
    squares: Array
    coefficients: Array
    intercepts: Array
    gamma: float
    coupling: PairCoupling
    projection: Array | None = None

    def __post_init__(self) -> None:
        n_labels = len(self.coefficients)
        first, second = np.triu_indices(n_labels, k=1)
        # Where in the (n_labels, n_labels - 1) sums the two halves of each pair stand.
        object.__setattr__(self, '_first', first * (n_labels - 1) + second - 1)
        object.__setattr__(self, '_second', second * (n_labels - 1) + first)

    def __call__(self, X: Array) -> Array:
        """Return the log-probability of each label, (..., n_labels) of (..., n_features)."""
        return self.coupling(self.decisions(X))

    def decisions(self, X: Array) -> Array:
        """Return the decision value of each pair, (..., n_pairs); positive for its first label.

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n_pairs)
            Pairs in the order (0, 1), (0, 2), …, (1, 2), ….
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


def export(scaler: Any, svc: Any, coupling: PairCoupling, projection: Array | None = None) -> SvmPredictor:
    """Return the exported predictor of a fitted StandardScaler and SVC(kernel='rbf').

    Parameters
    ----------
    scaler
        Fitted StandardScaler.
    svc
        Fitted SVC with an RBF kernel, one against one.
    coupling
        From decision values to probabilities.
    projection : (n_features, n_features) or None
        What the features were multiplied with before they were standardised.

    Returns
    -------
    SvmPredictor
        With the decisions of scikit-learn up to rounding.
    """
    counts = svc.n_support_
    n_labels, width = len(counts), int(counts.max())
    n_features = svc.support_vectors_.shape[1]
    vectors = np.zeros((n_labels, width, n_features))
    coefficients = np.zeros((n_labels, n_labels - 1, width))
    # scikit-learn turns the sign round for two labels
    sign = -1.0 if n_labels == 2 else 1.0
    start = 0
    for label, count in enumerate(counts):
        vectors[label, :count] = svc.support_vectors_[start : start + count]
        coefficients[label, :, :count] = sign * svc.dual_coef_[:, start : start + count]
        start += count
    flat = vectors.reshape(-1, n_features)
    gamma = float(svc.gamma)
    return SvmPredictor(
        mean=np.asarray(scaler.mean_),
        scale=np.asarray(scaler.scale_),
        vectors=2.0 * gamma * flat,
        squares=gamma * (flat * flat).sum(axis=1),
        coefficients=coefficients,
        intercepts=sign * np.asarray(svc.intercept_),
        gamma=gamma,
        coupling=coupling,
        projection=projection,
    )

"""The machines of all grades, fitted to halves that share one kernel."""

from __future__ import annotations

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.roughness.grade_votes import grade_membership, mean_of_votes
from texture_estimation.roughness.svm5 import Svm5
from texture_estimation.search.halves import Mask
from texture_estimation.search.surrogates.regressor_surrogate import GradesOfHalf
from texture_estimation.search.surrogates.svm_pairs import CACHE_MB, TOLERANCE, kernel_of


def svm5(regressor: Svm5, X: Array, y: Array, groups: Codes) -> GradesOfHalf:
    """Return a scorer with one SVM per grade, standardised over all examples as in `svm_pairs`."""
    from sklearn.svm import SVC  # noqa: PLC0415  # takes a second

    kernel = kernel_of(X, regressor.kernel_scale)
    members = grade_membership(y).T

    def graded(training: Mask) -> Array:
        rows = np.flatnonzero(training)
        known = kernel.take(rows, axis=0)
        among_known = known.take(rows, axis=1).astype(np.float64)
        weights = np.zeros((len(rows), len(members)), dtype=np.float32)
        # A grade that no texture has never fires.
        offsets = np.full(len(members), -1.0, dtype=np.float32)
        for number, member in enumerate(members[:, rows]):
            if member.all():
                offsets[number] = 1.0
            elif member.any():
                svc = SVC(C=regressor.c, kernel='precomputed', tol=TOLERANCE, cache_size=CACHE_MB).fit(
                    among_known, member
                )
                weights[svc.support_, number] = svc.dual_coef_[0]
                offsets[number] = svc.intercept_[0]
        return mean_of_votes(known.T @ weights + offsets > 0)

    return graded

"""One RBF support vector machine for each pair of textures; the texture that wins most pairs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.learners.pair_coupling import uncalibrated
from texture_estimation.learners.pair_votes import TIES, PairVotes
from texture_estimation.learners.svm_predictor import SvmPredictor, export
from texture_estimation.log_probabilities import log_softmax

NOTE = 'not calibrated: the pairs won are counted'
CACHE_MB = 500


@dataclass(frozen=True)
class SvmPairs:
    """RBF machines for all pairs with one box constraint and kernel scale; most pairs won.

    The kernel is exp(-|x - s|² / kernel_scale²), MATLAB's sense of the scale: gamma = 1 / kernel_scale².

    Source: Roberge et al., "Textures recognition through tactile exploration", sections III.C and IV.

    Examples
    --------
    >>> import numpy as np
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> fitted = SvmPairs().fit(values, codes, groups)
    >>> predictor = SvmPairs.predictor(fitted.parameters)
    >>> isinstance(predictor, SvmPairsPredictor), bool((predictor(values).argmax(axis=1) == codes).all())
    (True, True)
    """

    box_constraint: float = param(
        10.0,
        'Sets the penalty of a training error (box constraint C); a larger one fits the training data more closely.',
        low=1e-6,
        high=1e9,
    )
    kernel_scale: float = param(
        3.0,
        "Sets the width of the RBF kernel (MATLAB's KernelScale); a larger one smooths the decision more.",
        low=1e-9,
        high=1e9,
    )
    standardise: bool = param(True, 'Whether the features are standardised to zero mean and unit variance first.')
    ties: str = param(
        'unclassified',
        "How ties are broken: 'unclassified' returns no label, 'nearest' the one with larger margins.",
        choices=TIES,
    )

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        # Imported here: scikit-learn takes a second, and a node that only looks up names need not wait for it.
        from sklearn.preprocessing import StandardScaler  # noqa: PLC0415
        from sklearn.svm import SVC  # noqa: PLC0415

        scaler = StandardScaler().fit(X)
        if not self.standardise:
            scaler.mean_, scaler.scale_ = np.zeros(X.shape[1]), np.ones(X.shape[1])
        svc = SVC(C=self.box_constraint, kernel='rbf', gamma=self.kernel_scale**-2, cache_size=CACHE_MB)
        parameters = {'scaler': scaler, 'svc': svc.fit(scaler.transform(X), y), 'ties': self.ties}
        return Fitted(parameters, None, NOTE)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> SvmPairsPredictor:
        """Return the predictor made from the stored parameters."""
        n_labels = len(parameters['svc'].n_support_)
        svm = export(parameters['scaler'], parameters['svc'], uncalibrated(n_labels))
        return SvmPairsPredictor(svm, PairVotes(n_labels), str(parameters['ties']))


@dataclass(frozen=True, eq=False)
class SvmPairsPredictor:
    """The machines of all pairs, evaluated together."""

    svm: SvmPredictor
    votes: PairVotes
    ties: str

    def __call__(self, X: Array) -> Array:
        """Return log softmax of the number of pairs won, (..., n_labels) of (..., n_features)."""
        return log_softmax(self.votes.counted(self.svm.decisions(X), self.ties))

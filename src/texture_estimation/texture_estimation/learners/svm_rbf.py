"""RBF support vector machine, one against one, with calibrated probabilities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.folds import assign_folds
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.learners.pair_coupling import PairCoupling, fit_coupling, uncalibrated
from texture_estimation.learners.svm_predictor import SvmPredictor, export
from texture_estimation.learners.within_class_whitening import within_class_whitening

CACHE_MB = 500


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

    extras: ClassVar[tuple[str, ...]] = ('differences',)

    c: float = param(
        10.0,
        'Sets the penalty of a training error (box constraint C); a larger one fits the training data more closely.',
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
        False, 'Sets whether all features share one scale, for features of one kind such as taxel means.'
    )
    folds: int = param(
        5,
        'Sets the number of cross-validation folds for the calibration; more folds take longer to train.',
        low=2,
        high=50,
    )

    whitening: float = param(
        0.0,
        'Sets the ridge of the whitening of what differs within a texture, relative to its mean variance: a smaller '
        'one leaves less of the directions in which slides of one texture differ; 0: no whitening.',
        low=0.0,
        high=1e6,
    )

    def fit(self, X: Array, y: Codes, groups: Codes, differences: Array | None = None) -> Fitted:
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

        Returns
        -------
        Fitted
            Parameters, log-probabilities when held out, and a note on the calibration.
        """
        coupling, held_out, note = self._calibrate(X, y, groups, differences)
        projection = self._projection(X, y, groups, differences)
        scaler, svc = self._fit_svc(_projected(X, projection), y)
        parameters = {
            **({} if projection is None else {'projection': projection}),
            'scaler': scaler,
            'svc': svc,
            'slopes': coupling.slopes,
            'offsets': coupling.offsets,
            'temperature': coupling.temperature,
        }
        return Fitted(parameters, held_out, note)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> SvmPredictor:
        """Return the predictor made from the stored parameters."""
        coupling = PairCoupling(
            len(parameters['svc'].n_support_),
            parameters['slopes'],
            parameters['offsets'],
            float(parameters['temperature']),
        )
        return export(parameters['scaler'], parameters['svc'], coupling, parameters.get('projection'))

    def _calibrate(
        self, X: Array, y: Codes, groups: Codes, differences: Array | None
    ) -> tuple[PairCoupling, Array | None, str]:
        n_labels = int(y.max()) + 1
        split = assign_folds(y, groups, self.folds)
        if split is None:
            return uncalibrated(n_labels), None, 'not calibrated, as a label has a single window'
        folds_of, note = split
        decisions = self._held_out_decisions(X, y, groups, differences, folds_of)
        coupling = fit_coupling(decisions, y, n_labels)
        return coupling, coupling(decisions), note

    def _held_out_decisions(
        self, X: Array, y: Codes, groups: Codes, differences: Array | None, folds_of: Codes
    ) -> Array:
        """Return the decision values of each window, (n, n_pairs), by a fit without the fold that it is in."""
        n_labels = int(y.max()) + 1
        decisions = np.empty((len(y), n_labels * (n_labels - 1) // 2))
        for part in np.unique(folds_of):
            held = folds_of == part
            projection = self._projection(X[~held], y[~held], groups[~held], differences)
            fitted = self._fit_svc(_projected(X[~held], projection), y[~held])
            decisions[held] = export(*fitted, uncalibrated(n_labels), projection).decisions(X[held])
        return decisions

    def _projection(self, X: Array, y: Codes, groups: Codes, differences: Array | None) -> Array | None:
        return within_class_whitening(X, y, groups, self.whitening, differences) if self.whitening else None

    def _fit_svc(self, X: Array, y: Codes) -> tuple[Any, Any]:
        # Imported here: scikit-learn takes a second, and a node that only looks up names need not wait for it.
        from sklearn.preprocessing import StandardScaler  # noqa: PLC0415
        from sklearn.svm import SVC  # noqa: PLC0415

        scaler = StandardScaler().fit(X)
        if self.common_scale:
            scaler.scale_ = np.full(X.shape[1], float(np.sqrt(scaler.var_.mean())) or 1.0)
        gamma = self.gamma or 1.0 / (X.shape[1] * max(float(scaler.transform(X).var()), 1e-12))
        svc = SVC(C=self.c, kernel='rbf', gamma=gamma, cache_size=CACHE_MB).fit(scaler.transform(X), y)
        return scaler, svc


def _projected(X: Array, projection: Array | None) -> Array:
    return X if projection is None else X @ projection

"""The regressors that a roughness recipe can name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_estimation.roughness.ann1 import Ann1
from texture_estimation.roughness.ann5 import Ann5
from texture_estimation.roughness.gaussian_process import GaussianProcess
from texture_estimation.roughness.regressor import RoughnessRegressor
from texture_estimation.roughness.svm5 import Svm5

REGRESSORS: Mapping[str, type[RoughnessRegressor]] = {
    'gaussian_process': GaussianProcess,  # ours
    'ann1': Ann1,  # Rispal et al.
    'ann5': Ann5,  # Rispal et al.
    'svm5': Svm5,  # Rispal et al.
}

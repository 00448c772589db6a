"""The regressors that a roughness recipe can name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_estimation.roughness.gaussian_process import GaussianProcess
from texture_estimation.roughness.regressor import RoughnessRegressor

REGRESSORS: Mapping[str, type[RoughnessRegressor]] = {
    'gaussian_process': GaussianProcess,  # ours
}

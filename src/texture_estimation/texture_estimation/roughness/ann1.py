"""One neural network whose output is the grade."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.levenberg_marquardt import TRANSFERS
from texture_estimation.roughness.networks import RegressionNetworks, fit_networks
from texture_estimation.roughness.regressor import ROUGH, SMOOTH


@dataclass(frozen=True)
class Ann1:
    """A network with a hidden layer and one linear output, the grade.

    The paper's text says that the hidden layer is linear, which leaves a linear model whatever its number of neurons;
    `transfer` gives either.

    Source: Rispal et al., "Texture roughness estimation using dynamic tactile sensing", section IV.C.

    Examples
    --------
    >>> import numpy as np
    >>> grades, textures = np.repeat([1.0, 3.0, 5.0], 20), np.repeat(np.arange(3), 20)
    >>> values = grades[:, None] + 0.1 * np.random.default_rng(0).standard_normal((60, 1))
    >>> predictor = Ann1.predictor(Ann1().fit(values, grades, textures))
    >>> isinstance(predictor, NetworkRegressorPredictor), bool(np.nanmean(np.abs(predictor(values)[0] - grades)) < 0.5)
    (True, True)
    """

    hidden: int = param(
        10,
        'Sets the number of neurons in the hidden layer; more neurons separate finer and cost computing time.',
        low=1,
        high=200,
    )
    iterations: int = param(
        50, 'Sets the largest number of training iterations; more take longer to train.', low=1, high=10_000
    )
    seed: int = param(0, 'Sets the seed of the initial weights; equal seeds give equal models.', low=0)
    transfer: str = param(
        'sigmoid',
        "Sets the transfer function of the hidden layer: 'sigmoid', or 'linear' as in the paper's text.",
        choices=tuple(TRANSFERS),
    )

    def fit(self, X: Array, y: Array, groups: Codes) -> Mapping[str, Any]:
        """Learn from features `X` (n, n_features), grades `y` (n,) and numbers of the textures, `groups` (n,)."""
        return fit_networks(X, [y], groups, **asdict(self))

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> NetworkRegressorPredictor:
        """Return the predictor made from the stored parameters."""
        return NetworkRegressorPredictor(RegressionNetworks(**parameters))


@dataclass(frozen=True, eq=False)
class NetworkRegressorPredictor:
    """The grade is the output, within 1 and 5."""

    networks: RegressionNetworks

    def __call__(self, X: Array) -> tuple[Array, Array]:
        """Return grade and standard deviation, the latter not known."""
        grade = np.clip(self.networks(X)[..., 0], SMOOTH, ROUGH)
        return grade, np.zeros_like(grade)

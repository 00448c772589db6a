"""Five neural networks, one for each grade."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.levenberg_marquardt import TRANSFERS
from texture_estimation.roughness.grade_votes import grade_membership, mean_of_votes
from texture_estimation.roughness.networks import RegressionNetworks, fit_networks

VOTE_THRESHOLD = 0.5  # the networks are trained 0 and 1, and their output is rounded


@dataclass(frozen=True)
class Ann5:
    """A network for each grade that says yes or no; the grade is the mean of those that fire, none if none does.

    Source: Rispal et al., "Texture roughness estimation using dynamic tactile sensing", section IV.C.

    Examples
    --------
    >>> import numpy as np
    >>> grades, textures = np.repeat([1.0, 3.0, 5.0], 20), np.repeat(np.arange(3), 20)
    >>> values = grades[:, None] + 0.1 * np.random.default_rng(0).standard_normal((60, 1))
    >>> predictor = Ann5.predictor(Ann5().fit(values, grades, textures))
    >>> isinstance(predictor, VotingNetworksPredictor), bool(np.nanmean(np.abs(predictor(values)[0] - grades)) < 0.5)
    (True, True)
    """

    hidden: int = param(
        10,
        'Sets the number of neurons in the hidden layer of each network; more neurons fit finer and cost '
        'computing time.',
        low=1,
        high=200,
    )
    iterations: int = param(
        30, 'Sets the largest number of training iterations; more take longer to train.', low=1, high=10_000
    )
    seed: int = param(0, 'Sets the seed of the initial weights; equal seeds give equal models.', low=0)
    transfer: str = param(
        'sigmoid',
        "Sets the transfer function of the hidden layer: 'sigmoid', or 'linear' as in the paper's text.",
        choices=tuple(TRANSFERS),
    )

    def fit(self, X: Array, y: Array, groups: Codes) -> Mapping[str, Any]:
        """Learn from features `X` (n, n_features), grades `y` (n,) and numbers of the textures, `groups` (n,)."""
        targets = grade_membership(y).T.astype(np.float64)
        return fit_networks(X, list(targets), groups, **asdict(self))

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> VotingNetworksPredictor:
        """Return the predictor made from the stored parameters."""
        return VotingNetworksPredictor(RegressionNetworks(**parameters))


@dataclass(frozen=True, eq=False)
class VotingNetworksPredictor:
    """The mean of the grades whose network fires."""

    networks: RegressionNetworks

    def __call__(self, X: Array) -> tuple[Array, Array]:
        """Return grade and standard deviation, the latter not known."""
        grade = mean_of_votes(self.networks(X) >= VOTE_THRESHOLD)
        return grade, np.zeros_like(grade)

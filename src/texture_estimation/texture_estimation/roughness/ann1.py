"""One neural network whose output is the grade."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes
from texture_estimation.roughness.head import ROUGH, SMOOTH
from texture_estimation.roughness.networks import Networks, fit_networks


@dataclass(frozen=True)
class Ann1:
    """A network with a hidden layer and one linear output, the grade.

    The hidden layer is sigmoid: the paper's text calls it linear, which would leave a linear model whatever the number
    of neurons it varies.

    Source: Rispal et al., "Texture roughness estimation using dynamic tactile sensing", section IV.C.
    """

    hidden: int = param(10, 'Neurons in the hidden layer.', low=1, high=200)
    iterations: int = param(50, 'Steps of the training at most.', low=1, high=10_000)
    seed: int = param(0, 'Of the weights before the training.', low=0)

    def fit(self, values: Array, grades: Array, textures: Codes) -> Mapping[str, Any]:
        """Learn from values (n, n_features), grades (n,) and numbers of the textures (n,)."""
        return fit_networks(values, [grades], textures, **asdict(self))

    @staticmethod
    def array_form(parts: Mapping[str, Any]) -> NetworkGrader:
        """Return what grades, from the stored parts."""
        return NetworkGrader(Networks(**parts))


@dataclass(frozen=True, eq=False)
class NetworkGrader:
    """The grade is the output, within 1 and 5."""

    networks: Networks

    def __call__(self, values: Array) -> tuple[Array, Array]:
        """Return grade and standard deviation, the latter not known."""
        grade = np.clip(self.networks(values)[..., 0], SMOOTH, ROUGH)
        return grade, np.zeros_like(grade)

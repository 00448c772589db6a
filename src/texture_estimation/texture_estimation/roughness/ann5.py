"""Five neural networks, one for each grade."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes
from texture_estimation.roughness.fired import belongs, mean_of_fired
from texture_estimation.roughness.networks import Networks, fit_networks

FIRES_FROM = 0.5  # the networks are taught 0 and 1, and their output is rounded


@dataclass(frozen=True)
class Ann5:
    """A network for each grade that says yes or no; the grade is the mean of those that fire, none if none does.

    Source: Rispal et al., "Texture roughness estimation using dynamic tactile sensing", section IV.C.
    """

    hidden: int = param(10, 'Neurons in the hidden layer of each network.', low=1, high=200)
    iterations: int = param(30, 'Steps of the training at most.', low=1, high=10_000)
    seed: int = param(0, 'Of the weights before the training.', low=0)

    def fit(self, values: Array, grades: Array, textures: Codes) -> Mapping[str, Any]:
        """Learn from values (n, n_features), grades (n,) and numbers of the textures (n,)."""
        targets = belongs(grades).T.astype(np.float64)
        return fit_networks(values, list(targets), textures, **asdict(self))

    @staticmethod
    def array_form(parts: Mapping[str, Any]) -> FiringNetworks:
        """Return what grades, from the stored parts."""
        return FiringNetworks(Networks(**parts))


@dataclass(frozen=True, eq=False)
class FiringNetworks:
    """The mean of the grades whose network fires."""

    networks: Networks

    def __call__(self, values: Array) -> tuple[Array, Array]:
        """Return grade and standard deviation, the latter not known."""
        grade = mean_of_fired(self.networks(values) >= FIRES_FROM)
        return grade, np.zeros_like(grade)

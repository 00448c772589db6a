"""Quick stand-ins for the networks that grade: few examples of each texture, few steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.roughness.ann1 import Ann1
from texture_estimation.roughness.ann5 import VOTE_THRESHOLD, Ann5
from texture_estimation.roughness.grade_votes import grade_membership, mean_of_votes
from texture_estimation.roughness.regressor import ROUGH, SMOOTH
from texture_estimation.search.halves import Mask
from texture_estimation.search.surrogates.networks import SurrogateNetworks, sample_rows
from texture_estimation.search.surrogates.regressor_surrogate import GradesOfHalf

# Examples of each texture that a network is trained on.
EXAMPLES = 16


def ann1(regressor: Ann1, X: Array, y: Array, groups: Codes) -> GradesOfHalf:
    """Return a scorer of one half split by one network whose output is the grade."""
    return _surrogate(regressor, X, y[None], groups, lambda outputs: np.clip(outputs[:, 0], SMOOTH, ROUGH))


def ann5(regressor: Ann5, X: Array, y: Array, groups: Codes) -> GradesOfHalf:
    """Return a scorer of one half split by a network for each grade."""
    wanted = grade_membership(y).T.astype(np.float64)
    return _surrogate(regressor, X, wanted, groups, lambda outputs: mean_of_votes(outputs >= VOTE_THRESHOLD))


def _surrogate(
    regressor: Ann1 | Ann5, values: Array, targets: Array, groups: Codes, grade: Callable[[Array], Array]
) -> GradesOfHalf:
    mean, scale = standardisation(values)
    standard = np.ascontiguousarray((values - mean) / scale)

    def graded(training: Mask) -> Array:
        rng = np.random.default_rng(regressor.seed)
        rows = sample_rows(groups, training, EXAMPLES, rng).ravel()
        networks = SurrogateNetworks.fitted(
            standard[None, rows], targets[:, rows], regressor.hidden, rng, regressor.transfer
        )
        return grade(networks.outputs(standard))

    return graded

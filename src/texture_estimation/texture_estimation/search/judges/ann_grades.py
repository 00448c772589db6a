"""Quick stand-ins for the networks that grade: few examples of each texture, few steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.roughness.ann1 import Ann1
from texture_estimation.roughness.ann5 import FIRES_FROM, Ann5
from texture_estimation.roughness.fired import belongs, mean_of_fired
from texture_estimation.roughness.head import ROUGH, SMOOTH
from texture_estimation.search.halves import Mask
from texture_estimation.search.judges.grade_judge import GradesOfHalf
from texture_estimation.search.judges.networks import Networks, drawn

# Examples of each texture that a network learns from.
EXAMPLES = 16


def ann1(head: Ann1, values: Array, grades: Array, textures: Codes) -> GradesOfHalf:
    """Return what judges a half by one network whose output is the grade."""
    return _judge(head, values, grades[None], textures, lambda outputs: np.clip(outputs[:, 0], SMOOTH, ROUGH))


def ann5(head: Ann5, values: Array, grades: Array, textures: Codes) -> GradesOfHalf:
    """Return what judges a half by a network for each grade."""
    wanted = belongs(grades).T.astype(np.float64)
    return _judge(head, values, wanted, textures, lambda outputs: mean_of_fired(outputs >= FIRES_FROM))


def _judge(
    head: Ann1 | Ann5, values: Array, targets: Array, textures: Codes, grade: Callable[[Array], Array]
) -> GradesOfHalf:
    mean, scale = standardisation(values)
    standard = np.ascontiguousarray((values - mean) / scale)

    def graded(learnt: Mask) -> Array:
        rng = np.random.default_rng(head.seed)
        rows = drawn(textures, learnt, EXAMPLES, rng).ravel()
        networks = Networks.fitted(standard[None, rows], targets[:, rows], head.hidden, rng)
        return grade(networks.outputs(standard))

    return graded

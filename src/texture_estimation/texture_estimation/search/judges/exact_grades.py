"""The head itself, fitted to each half as `train` would."""

from __future__ import annotations

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.roughness.head import Head
from texture_estimation.search.halves import Mask
from texture_estimation.search.judges.grade_judge import GradesOfHalf


def exact_grades(head: Head, values: Array, grades: Array, textures: Codes) -> GradesOfHalf:
    """Return what fits the head to a half, standardisation included, and lets its array form grade."""

    def graded(learnt: Mask) -> Array:
        parts = head.fit(values[learnt], grades[learnt], textures[learnt])
        return head.array_form(parts)(values)[0]

    return graded

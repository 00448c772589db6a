"""Which surrogate replaces a learner or a regressor in a search."""

from __future__ import annotations

from typing import Any

from texture_estimation.search.surrogates.exact import exact
from texture_estimation.search.surrogates.exact_regressor import exact_grades
from texture_estimation.search.surrogates.regressor_surrogate import RegressorSurrogate
from texture_estimation.search.surrogates.surrogate import Surrogate


def surrogate_of(learner: Any, *, quick: bool = True) -> Surrogate:
    """Return the method `surrogate` of a learner if it has one and it is wanted, else what fits the learner itself."""
    found: Surrogate = getattr(type(learner), 'surrogate', exact) if quick else exact
    return found


def regressor_surrogate_of(regressor: Any, *, quick: bool = True) -> RegressorSurrogate:
    """Return the method `surrogate` of a regressor if it has one and it is wanted, else what fits it itself."""
    found: RegressorSurrogate = getattr(type(regressor), 'surrogate', exact_grades) if quick else exact_grades
    return found

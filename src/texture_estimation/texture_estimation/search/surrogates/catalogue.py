"""Which surrogate replaces a learner or a regressor in a search."""

from __future__ import annotations

from collections.abc import Mapping

from texture_estimation.search.surrogates.ann_pairs import ann_pairs
from texture_estimation.search.surrogates.ann_regressors import ann1, ann5
from texture_estimation.search.surrogates.exact import exact
from texture_estimation.search.surrogates.exact_regressor import exact_grades
from texture_estimation.search.surrogates.regressor_surrogate import RegressorSurrogate
from texture_estimation.search.surrogates.surrogate import Surrogate
from texture_estimation.search.surrogates.svm_pairs import svm_pairs
from texture_estimation.search.surrogates.svm_regressors import svm5

SURROGATES: Mapping[str, Surrogate] = {
    'svm_pairs': svm_pairs,
    'ann_pairs': ann_pairs,
}
REGRESSOR_SURROGATES: Mapping[str, RegressorSurrogate] = {
    'ann1': ann1,
    'ann5': ann5,
    'svm5': svm5,
}


def surrogate_of(learner_name: str, *, quick: bool = True) -> Surrogate:
    """Return the surrogate of a learner if there is one and it is wanted, else the learner itself."""
    return SURROGATES.get(learner_name, exact) if quick else exact


def regressor_surrogate_of(regressor_name: str, *, quick: bool = True) -> RegressorSurrogate:
    """Return the surrogate of a regressor if there is one and it is wanted, else the regressor itself."""
    return REGRESSOR_SURROGATES.get(regressor_name, exact_grades) if quick else exact_grades

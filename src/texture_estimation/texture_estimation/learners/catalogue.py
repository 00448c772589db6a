"""The learners that a recipe can name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_estimation.learners.learner import Learner
from texture_estimation.learners.svm_rbf import SvmRbf

LEARNERS: Mapping[str, type[Learner]] = {
    'svm_rbf': SvmRbf,  # Cortes & Vapnik 1995, one against one
}

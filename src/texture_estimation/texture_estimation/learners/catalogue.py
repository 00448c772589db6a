# SPDX-License-Identifier: Apache-2.0
"""The learners that a recipe can name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_estimation.learners.discriminant import Discriminant, ForceDiscriminant
from texture_estimation.learners.learner import Learner
from texture_estimation.learners.mlp import Mlp, OnsetMlp
from texture_estimation.learners.sklearn_learner import SklearnLearner
from texture_estimation.learners.svm import SvmRbf

LEARNERS: Mapping[str, type[Learner]] = {
    'mlp': Mlp,  # one hidden layer, softmax, calibrated
    'onset_mlp': OnsetMlp,  # and linear discriminant analysis of first windows
    'discriminant': Discriminant,  # Fisher 1936, shrunk as Friedman 1989, calibrated
    'force_discriminant': ForceDiscriminant,  # one for each range of forces
    'svm_rbf': SvmRbf,  # Cortes & Vapnik 1995, one against one, calibrated
    'sklearn': SklearnLearner,  # any classifier of scikit-learn
}

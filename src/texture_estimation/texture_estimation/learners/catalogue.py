"""The learners that a recipe can name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_estimation.learners.ann_pairs import AnnPairs
from texture_estimation.learners.em_mixture import EmMixture
from texture_estimation.learners.learner import Learner
from texture_estimation.learners.mlp import Mlp
from texture_estimation.learners.naive_bayes import NaiveBayes
from texture_estimation.learners.onset_mlp import OnsetMlp
from texture_estimation.learners.passive_aggressive import PassiveAggressive
from texture_estimation.learners.sklearn_learner import SklearnLearner
from texture_estimation.learners.svm_linear import SvmLinear
from texture_estimation.learners.svm_max_wins import SvmMaxWins
from texture_estimation.learners.svm_pairs import SvmPairs
from texture_estimation.learners.svm_rbf import SvmRbf
from texture_estimation.learners.tuned_pairs import TunedPairs

LEARNERS: Mapping[str, type[Learner]] = {
    'mlp': Mlp,  # one hidden layer, softmax, calibrated
    'onset_mlp': OnsetMlp,  # and linear discriminant analysis of first windows
    'svm_rbf': SvmRbf,  # Cortes & Vapnik 1995, one against one, calibrated
    'ann_pairs': AnnPairs,  # Roberge et al.
    'svm_pairs': SvmPairs,  # Roberge et al.
    'tuned_pairs': TunedPairs,  # Roberge et al.: a set of variables for each pair
    'naive_bayes': NaiveBayes,  # Jamali & Sammut 2010
    'svm_linear': SvmLinear,  # Kaboli et al. 2015
    'passive_aggressive': PassiveAggressive,  # Crammer et al. 2006; Kaboli et al. 2015
    'em_mixture': EmMixture,  # Kaboli et al. 2015
    'svm_max_wins': SvmMaxWins,  # Hu et al. 2014
    'sklearn': SklearnLearner,  # any classifier of scikit-learn
}

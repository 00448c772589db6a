"""Which judge stands for a learner in a search."""

from __future__ import annotations

from collections.abc import Mapping

from texture_estimation.genetic.judges.ann_pairs import ann_pairs
from texture_estimation.genetic.judges.exact import exact
from texture_estimation.genetic.judges.judge import Judge
from texture_estimation.genetic.judges.svm_pairs import svm_pairs

JUDGES: Mapping[str, Judge] = {
    'svm_pairs': svm_pairs,
    'ann_pairs': ann_pairs,
}


def judge_of(learner_name: str, *, quick: bool = True) -> Judge:
    """Return the quick judge of a learner if it has one and it is wanted, else the learner itself."""
    return JUDGES.get(learner_name, exact) if quick else exact

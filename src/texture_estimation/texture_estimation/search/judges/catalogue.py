"""Which judge stands for a learner, or for a head that grades, in a search."""

from __future__ import annotations

from collections.abc import Mapping

from texture_estimation.search.judges.ann_grades import ann1, ann5
from texture_estimation.search.judges.ann_pairs import ann_pairs
from texture_estimation.search.judges.exact import exact
from texture_estimation.search.judges.exact_grades import exact_grades
from texture_estimation.search.judges.grade_judge import GradeJudge
from texture_estimation.search.judges.judge import Judge
from texture_estimation.search.judges.svm_grades import svm5
from texture_estimation.search.judges.svm_pairs import svm_pairs

JUDGES: Mapping[str, Judge] = {
    'svm_pairs': svm_pairs,
    'ann_pairs': ann_pairs,
}
GRADE_JUDGES: Mapping[str, GradeJudge] = {
    'ann1': ann1,
    'ann5': ann5,
    'svm5': svm5,
}


def judge_of(learner_name: str, *, quick: bool = True) -> Judge:
    """Return the quick judge of a learner if it has one and it is wanted, else the learner itself."""
    return JUDGES.get(learner_name, exact) if quick else exact


def grade_judge_of(head_name: str, *, quick: bool = True) -> GradeJudge:
    """Return the quick judge of a head if it has one and it is wanted, else the head itself."""
    return GRADE_JUDGES.get(head_name, exact_grades) if quick else exact_grades

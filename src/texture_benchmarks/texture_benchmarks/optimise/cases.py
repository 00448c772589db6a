"""The searches, and the data that they search on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from texture_estimation.recipe import load_recipe
from texture_estimation.roughness.grades import read_grades
from texture_estimation.roughness.roughness_recipe import load_roughness_recipe
from texture_estimation.search.classification_task import ClassificationTask
from texture_estimation.search.generation import SearchParams
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.roughness_task import RoughnessTask
from texture_estimation.search.search_task import SearchTask

GRADES = 'ets_roughness'
USUAL = SearchParams()


@dataclass(frozen=True)
class Data:
    """Slides over the surfaces of a scene: so many of each, with each speed and force."""

    scene: str
    speeds_m_s: tuple[float, ...]
    forces_n: tuple[float, ...]
    scan_s: float
    count: int


@dataclass(frozen=True)
class SearchCase:
    """One search: a recipe, its space, the data, and how long it may take on two cores."""

    recipe: str
    space: str
    data: str
    limit_s: float | None
    params: SearchParams = USUAL


DATA: Mapping[str, Data] = {
    'linear': Data('ets_linear', (0.10, 0.15, 0.20), (1.0, 2.5, 5.0), 0.5, 50),
    'fine': Data('ets_fine', (0.125,), (2.0,), 0.8, 200),
    'roughness': Data('roughness', (0.15,), (2.5,), 0.5, 200),
}
FRONT = SearchParams(objective='front')
CASES: Mapping[str, SearchCase] = {
    'linear, SVM': SearchCase('ets-linear-svm', 'ets-svm', 'linear', 60.0),
    'linear, ANN': SearchCase('ets-linear-ann', 'ets-ann', 'linear', 60.0),
    'linear, SVM, without racing': SearchCase('ets-linear-svm', 'ets-svm', 'linear', None, SearchParams(race=False)),
    'linear, SVM, front': SearchCase('ets-linear-svm', 'ets-svm-points', 'linear', None, FRONT),
    'linear, ANN, front': SearchCase('ets-linear-ann', 'ets-ann-points', 'linear', None, FRONT),
    'ten textures, SVM': SearchCase('ets-fine-svm', 'ets-fine-svm', 'fine', 300.0),
    'ten textures, ANN': SearchCase('ets-fine-ann', 'ets-fine-ann', 'fine', 300.0),
    'roughness, SVM5': SearchCase('ets-roughness-svm5', 'ets-roughness-svm5', 'roughness', 900.0),
    'roughness, ANN5': SearchCase(
        'ets-roughness-ann5', 'ets-roughness-ann5', 'roughness', 900.0, SearchParams(finalists=1)
    ),
    'roughness, ANN1': SearchCase('ets-roughness-ann1', 'ets-roughness-ann1', 'roughness', 900.0),
}
LINEAR = ('linear, SVM', 'linear, ANN')  # the papers' own
COMPARISONS = (*LINEAR, 'ten textures, ANN')


def space_and_task(case: SearchCase) -> tuple[RecipeSpace[Any], SearchTask[Any]]:
    """Return what a case varies, and how an individual is tried."""
    if case.data == 'roughness':
        return RecipeSpace.load(case.space, load_roughness_recipe(case.recipe)), RoughnessTask(read_grades(GRADES))
    return RecipeSpace.load(case.space, load_recipe(case.recipe)), ClassificationTask()

"""The paper's search for the parameters of its regressors, on the training textures."""

from __future__ import annotations

from typing import Any

from texture_benchmarks.papers import tuning
from texture_benchmarks.papers.tuning import TunedRecipe
from texture_estimation.roughness.grades import Grades
from texture_estimation.roughness.roughness_recipe import RoughnessRecipe
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.roughness_task import RoughnessTask
from texture_estimation.search.slide_arrays import SlideArrays

TARGET_S = 15 * 60.0


class TunedRegressor(TunedRecipe[RoughnessRecipe]):
    """A recipe of a regressor that was searched for, and what it took."""

    def figures(self) -> dict[str, Any]:
        """Return what the search took, and the errors of the best; its score falls by a quarter for each grade off."""
        figures = super().figures()
        errors = {f'{name}_error': 4.0 * (1.0 - figures.pop(name)) for name in ('learning', 'test')}
        return {**figures, **errors}


def tune(recipe: RoughnessRecipe, scans: SlideArrays, grades: Grades, seed: int, *, quick: bool) -> TunedRegressor:
    """Return the best recipe of the search space that is named like this one.

    As in the paper, each half holds windows of every texture: the search does not see how a new texture fares.

    Parameters
    ----------
    recipe
        Recipe whose search space is searched.
    scans
        Slides that the search may use.
    grades
        Grade of each texture.
    seed
        Seed of the search.
    quick
        Whether a short search will do.

    Returns
    -------
    TunedRegressor
    """
    found = tuning.tune(RecipeSpace.load(recipe.name, recipe), scans, RoughnessTask(grades), seed, quick=quick)
    return TunedRegressor(found.found, found.seconds, found.cpu_seconds, found.scans)

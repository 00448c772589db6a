"""The paper's search for the parameters of its heads, on the textures that are learnt."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from texture_core.errors import InvalidParameter
from texture_estimation.genetic.division import Division
from texture_estimation.genetic.grading import Grading
from texture_estimation.genetic.optimise import Optimised, optimise
from texture_estimation.genetic.recipe_space import RecipeSpace
from texture_estimation.genetic.scans import Scans
from texture_estimation.genetic.search import SearchParams
from texture_estimation.genetic.spread import over_cores
from texture_estimation.roughness.grades import Grades
from texture_estimation.roughness.recipe import RoughnessRecipe

FULL = SearchParams()  # 20 individuals, 30 generations, 20 halves: the paper's
QUICK = SearchParams(population=4, generations=2, halves=2, finalists=1)
TARGET_S = 15 * 60.0


@dataclass(frozen=True, eq=False)
class Tuned:
    """A recipe that was searched for, and what it took."""

    found: Optimised[RoughnessRecipe]
    seconds: float
    cpu_seconds: float
    scans: int

    @property
    def recipe(self) -> RoughnessRecipe:
        """The best."""
        return self.found.best.recipe

    def figures(self) -> dict[str, Any]:
        """Return what the search took and how good it thinks the best is."""
        record, history = self.found.best.record, self.found.found.history
        return {
            'seconds': round(self.seconds, 1),
            'cpu_seconds': round(self.cpu_seconds, 1),  # of all cores: what a busy machine would have needed alone
            'scans': self.scans,
            'generations': len(history),
            'individuals_tried': history[-1].judged,
            'halves_judged': history[-1].halves,
            # the score falls by a quarter for each grade off
            'learning_error': 4.0 * (1.0 - float(record.learning.mean())),
            'test_error': 4.0 * (1.0 - float(record.test.mean())),
        }

    def write(self, path: Path) -> Path:
        """Write the recipe as a file that training reads; return its path."""
        text = yaml.safe_dump(self.recipe.as_mapping(), sort_keys=False, allow_unicode=True, width=120)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding='utf-8')
        except OSError as error:
            raise InvalidParameter(f"'{path}' cannot be written: {error.strerror}; name another folder") from error
        return path


def tune(recipe: RoughnessRecipe, scans: Scans, grades: Grades, seed: int, *, quick: bool) -> Tuned:
    """Return the best recipe of the search space that is named like this one.

    As in the paper, each half holds windows of every texture: the search is not told how a texture never felt fares.
    """
    params = QUICK if quick else FULL
    began, cpu_began = time.perf_counter(), time.process_time()
    with over_cores() as spread:
        found = optimise(
            RecipeSpace.load(recipe.name, recipe), Division(scans, params.halves, seed), params, Grading(grades),
            spread=spread,
        )  # fmt: skip
    return Tuned(found, time.perf_counter() - began, time.process_time() - cpu_began, len(scans.labels))

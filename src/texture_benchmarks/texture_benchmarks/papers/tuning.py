"""The papers' genetic searches for the parameters of their recipes."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic

import yaml

from texture_core.errors import InvalidParameter
from texture_estimation.search.generation import SearchParams
from texture_estimation.search.optimise import SearchResult, optimise
from texture_estimation.search.parallel import threaded_map
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.search_slides import SearchSlides
from texture_estimation.search.search_task import R, SearchTask
from texture_estimation.search.slide_arrays import SlideArrays

FULL = SearchParams()  # 20 individuals, 30 generations, 20 halves: the paper's
QUICK = SearchParams(population=4, generations=2, halves=2, finalists=1)


@dataclass(frozen=True, eq=False)
class TunedRecipe(Generic[R]):
    """A recipe that was searched for, and what it took."""

    found: SearchResult[R]
    seconds: float
    cpu_seconds: float
    scans: int

    @property
    def recipe(self) -> R:
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
            'individuals_tried': history[-1].evaluated,
            'halves_evaluated': history[-1].halves,
            'learning': float(record.learning.mean()),
            'test': float(record.test.mean()),
        }

    def write(self, path: Path) -> Path:
        """Write the recipe as a file that training reads; return its path.

        Raises
        ------
        InvalidParameter
            If the file cannot be written.
        """
        text = yaml.safe_dump(self.recipe.as_mapping(), sort_keys=False, allow_unicode=True, width=120)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding='utf-8')
        except OSError as error:
            raise InvalidParameter(f"'{path}' cannot be written: {error.strerror}; name another folder") from error
        return path


def tune(space: RecipeSpace[R], scans: SlideArrays, task: SearchTask[R], seed: int, *, quick: bool) -> TunedRecipe[R]:
    """Return the best recipe of a space on these scans, and what it took to find it.

    Parameters
    ----------
    space
        The recipe, and what of it is varied.
    scans
        Slides that the search may use.
    task
        Classification or roughness.
    seed
        Seed of the search.
    quick
        Whether a short search will do.

    Returns
    -------
    TunedRecipe
    """
    params = replace(QUICK if quick else FULL, seed=seed)
    began, cpu_began = time.perf_counter(), time.process_time()
    with threaded_map() as parallel_map:
        found = optimise(space, SearchSlides(scans, params.halves, seed), params, task, parallel_map=parallel_map)
    return TunedRecipe(found, time.perf_counter() - began, time.process_time() - cpu_began, len(scans.labels))

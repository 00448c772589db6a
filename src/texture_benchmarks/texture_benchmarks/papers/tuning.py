"""The papers' genetic searches for the parameters of their recipes."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic

import yaml

from texture_core.errors import InvalidParameter
from texture_estimation.search.division import Division
from texture_estimation.search.genetic_search import SearchParams
from texture_estimation.search.optimise import Optimised, optimise
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.scans import Scans
from texture_estimation.search.spread import over_cores
from texture_estimation.search.task import R, Task

FULL = SearchParams()  # 20 individuals, 30 generations, 20 halves: the paper's
QUICK = SearchParams(population=4, generations=2, halves=2, finalists=1)


@dataclass(frozen=True, eq=False)
class Tuned(Generic[R]):
    """A recipe that was searched for, and what it took."""

    found: Optimised[R]
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
            'individuals_tried': history[-1].judged,
            'halves_judged': history[-1].halves,
            'learning': float(record.learning.mean()),
            'test': float(record.test.mean()),
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


def tune(space: RecipeSpace[R], scans: Scans, task: Task[R], seed: int, *, quick: bool) -> Tuned[R]:
    """Return the best recipe of a space on these scans, and what it took to find it."""
    params = replace(QUICK if quick else FULL, seed=seed)
    began, cpu_began = time.perf_counter(), time.process_time()
    with over_cores() as spread:
        found = optimise(space, Division(scans, params.halves, seed), params, task, spread=spread)
    return Tuned(found, time.perf_counter() - began, time.process_time() - cpu_began, len(scans.labels))

"""Find the best recipe of a space on labelled slides."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Generic

from texture_core.arrays import Array
from texture_core.errors import InvalidParameter
from texture_estimation.search.division import Division
from texture_estimation.search.feature_cache import FeatureCache
from texture_estimation.search.fitness import fitness
from texture_estimation.search.genetic_search import Found, Generation, Scored, SearchParams, search
from texture_estimation.search.memory import Memory
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.spread import Spread, in_turn
from texture_estimation.search.task import R, Task
from texture_estimation.search.trial import Record, Trial
from texture_estimation.search.variables import Individual


@dataclass(frozen=True, eq=False)
class Finalist(Generic[R]):
    """A recipe judged by its own learner on every half.

    Parameters
    ----------
    recipe
        As a file would hold it.
    searched
        Score and cost in the search.
    record
        Learning and test accuracy on each half, by the learner itself.
    """

    recipe: R
    searched: Scored
    record: Record

    @property
    def fitness(self) -> float:
        """Mean of learning and test accuracy over all halves."""
        return fitness(self.record.learning, self.record.test)


@dataclass(frozen=True, eq=False)
class Optimised(Generic[R]):
    """What was found.

    Parameters
    ----------
    best
        The finalist with the highest fitness.
    finalists
        The best of the search, or the whole front of accuracy and cost; best first.
    found
        What the search says of its last generation.
    memory
        All scores.
    """

    best: Finalist[R]
    finalists: tuple[Finalist[R], ...]
    found: Found
    memory: Memory


def optimise(
    space: RecipeSpace[R],
    division: Division,
    params: SearchParams,
    task: Task[R],
    *,
    features: FeatureCache | None = None,
    spread: Spread = in_turn,
    checkpoint: str | Path | None = None,
    resume: str | Path | None = None,
    tell: Callable[[Generation], None] = lambda _: None,
) -> Optimised[R]:
    """Search the space with quick judges, then judge the best again with the learner itself.

    Parameters
    ----------
    space
        The recipe, and what of it is varied. The recipe itself takes part in the first generation.
    division
        Slides and their halves; with as many halves as `params` has, and its seed.
    params
        Population, generations and so on.
    task
        `TellingApart()`, or `Grading(grades)`.
    features
        Of earlier searches on the same slides, all surfaces included.
    spread
        Over cores or a cluster.
    checkpoint, resume
        File that is written after each generation, and file that is read first.
    tell
        Called after each generation.

    Raises
    ------
    InvalidParameter
        If the division has other halves than `params`.
    TextureError
        If slides, features or checkpoint cannot be used.
    """
    if (division.n_halves, division.seed) != (params.halves, params.seed):
        raise InvalidParameter(
            f'the slides are divided into {division.n_halves} halves with seed {division.seed}, the search asks for '
            f'{params.halves} with seed {params.seed}; give both the same'
        )
    plan = _Plan(space, division, task, features or FeatureCache(division.cut), spread)
    memory = Memory(plan.identity)
    if resume:
        memory.load(resume)

    def after_generation(generation: Generation) -> None:
        if checkpoint:
            memory.save(checkpoint)
        tell(generation)

    found = search(
        space.variables,
        plan.trials,
        params,
        memory,
        start=[space.of_base()],
        cost=plan.cost if params.objective == 'front' else lambda _: 0.0,
        spread=spread,
        tell=after_generation,
    )
    chosen = found.front if params.objective == 'front' else found.ranked[: params.finalists]
    finalists = plan.judged_exactly(chosen)
    return Optimised(finalists[0], finalists, found, memory)


class _Plan(Generic[R]):
    """Trials, costs and exact judgements of individuals."""

    def __init__(
        self, space: RecipeSpace[R], division: Division, task: Task[R], features: FeatureCache, spread: Spread
    ) -> None:
        self._space, self._division, self._task, self._features = space, division, task, features
        self._spread = spread
        self.cost = lru_cache(maxsize=None)(self._cost)

    @property
    def identity(self) -> dict[str, Any]:
        """What the scores of this search belong to."""
        examples = self._division.examples(self._space.base.training_windows)
        recipe = json.dumps(self._space.base.as_mapping(), sort_keys=True)
        return {
            'recipe': _digest(recipe),
            'task': _digest(repr(self._task)),
            'variables': {name: repr(axis) for name, axis in self._space.axes.items()},
            'slides': examples.digest,
            'surfaces': list(examples.names),
            'halves': self._division.n_halves,
            'seed': self._division.seed,
        }

    def trials(self, individuals: Sequence[Individual], *, quick: bool = True) -> list[Trial]:
        """Return the trials of individuals."""
        recipes = [self._space.recipe(individual) for individual in individuals]
        described = self._features.many([self._task.described(recipe) for recipe in recipes], self._spread)
        return [
            self._trial(recipe, values[self._division.rows(recipe.training_windows)], quick)
            for recipe, values in zip(recipes, described, strict=True)
        ]

    def judged_exactly(self, chosen: Sequence[Scored]) -> tuple[Finalist[R], ...]:
        """Return the recipes with the scores of their learners on all halves, best first."""
        trials = self.trials([one.individual for one in chosen], quick=False)
        n_halves = self._division.n_halves
        cases = [(trial, number) for trial in trials for number in range(n_halves)]
        scores = self._spread(_one_half, cases)
        finalists = []
        for place, one in enumerate(chosen):
            mine = scores[place * n_halves : (place + 1) * n_halves]
            recipe = self._space.recipe(one.individual)
            finalists.append(Finalist(recipe, one, Record.of(mine)))
        return tuple(sorted(finalists, key=lambda finalist: -finalist.fitness))

    def _trial(self, recipe: R, values: Array, quick: bool) -> Trial:
        windows = recipe.training_windows
        examples, halves = self._division.examples(windows), self._division.halves(windows)
        return self._task.trial(recipe, values, examples, halves, quick=quick)

    def _cost(self, individual: Individual) -> float:
        recipe = self._space.recipe(individual)
        examples = self._division.examples(recipe.training_windows)
        n_samples = sum(item.samples[0].size for item in examples.inputs.values())
        n_values = self._features.values(self._task.described(recipe)).shape[1]
        return self._task.cost(recipe, n_samples, n_values, examples)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def _one_half(case: tuple[Trial, int]) -> tuple[float, float]:
    trial, number = case
    return trial.start()(number)

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
from texture_estimation.search.feature_cache import FeatureCache
from texture_estimation.search.fitness import fitness
from texture_estimation.search.generation import Generation, ScoredIndividual, SearchParams
from texture_estimation.search.genetic_search import SearchOutcome, search
from texture_estimation.search.parallel import ParallelMap, serial_map
from texture_estimation.search.racing import FitnessFunction, HalfScores
from texture_estimation.search.recipe_space import RecipeSpace
from texture_estimation.search.score_cache import ScoreCache
from texture_estimation.search.search_slides import SearchSlides
from texture_estimation.search.search_task import R, SearchTask
from texture_estimation.search.variables import Individual


@dataclass(frozen=True, eq=False)
class Finalist(Generic[R]):
    """A recipe evaluated by its own learner on every half.

    Parameters
    ----------
    recipe
        As a file would hold it.
    searched
        Score and cost in the search.
    record
        Learning and test accuracy on each half, by the learner itself.

    Examples
    --------
    >>> from texture_estimation.search.genetic_search import ScoredIndividual
    >>> finalist = Finalist('a recipe', ScoredIndividual((3,), 0.9, 0.0, 2), HalfScores.of([(1.0, 0.8), (1.0, 0.6)]))
    >>> round(finalist.fitness, 3)
    0.85
    """

    recipe: R
    searched: ScoredIndividual
    record: HalfScores

    @property
    def fitness(self) -> float:
        """Mean of learning and test accuracy over all halves."""
        return fitness(self.record.learning, self.record.test)


@dataclass(frozen=True, eq=False)
class SearchResult(Generic[R]):
    """What was found.

    Parameters
    ----------
    best
        The finalist with the highest fitness.
    finalists
        The best of the search, or the whole front of accuracy and cost; best first.
    found
        What the search says of its last generation.
    score_cache
        All scores.

    Examples
    --------
    >>> from texture_estimation.search.genetic_search import ScoredIndividual
    >>> one = ScoredIndividual((3,), 0.9, 0.0, 1)
    >>> finalist = Finalist('a recipe', one, HalfScores.of([(1.0, 0.8)]))
    >>> SearchResult(finalist, (finalist,), SearchOutcome((one,), (one,), ()), ScoreCache({})).best.recipe
    'a recipe'
    """

    best: Finalist[R]
    finalists: tuple[Finalist[R], ...]
    found: SearchOutcome
    score_cache: ScoreCache


def optimise(
    space: RecipeSpace[R],
    search_slides: SearchSlides,
    params: SearchParams,
    task: SearchTask[R],
    *,
    features: FeatureCache | None = None,
    parallel_map: ParallelMap = serial_map,
    checkpoint: str | Path | None = None,
    resume: str | Path | None = None,
    tell: Callable[[Generation], None] = lambda _: None,
) -> SearchResult[R]:
    """Search the space with quick surrogate, then evaluate the best again with the learner itself.

    Parameters
    ----------
    space
        The recipe, and what of it is varied. The recipe itself takes part in the first generation.
    search_slides
        Slides and their halves; with as many halves as `params` has, and its seed.
    params
        Population, generations and so on.
    task
        `ClassificationTask()`, or `RoughnessTask(grades)`.
    features
        Of earlier searches on the same slides, all surfaces included.
    parallel_map
        Over cores or a cluster.
    checkpoint, resume
        File that is written after each generation, and file that is read first.
    tell
        Called after each generation.

    Returns
    -------
    SearchResult
        The best recipes, each evaluated by its own learner.

    Raises
    ------
    InvalidParameter
        If the split has other halves than `params`.
    TextureError
        If slides, features or checkpoint cannot be used.
    """
    if (search_slides.n_halves, search_slides.seed) != (params.halves, params.seed):
        raise InvalidParameter(
            f'the slides have {search_slides.n_halves} half splits with seed {search_slides.seed}, the search asks for '
            f'{params.halves} with seed {params.seed}; give both the same'
        )
    plan = _Plan(space, search_slides, task, features or FeatureCache(search_slides.cut), parallel_map)
    score_cache = ScoreCache(plan.identity)
    if resume:
        score_cache.load(resume)

    def after_generation(generation: Generation) -> None:
        if checkpoint:
            score_cache.save(checkpoint)
        tell(generation)

    found = search(
        space.variables,
        plan.fitness_functions,
        params,
        score_cache,
        start=[space.of_base()],
        cost=plan.cost if params.objective == 'front' else lambda _: 0.0,
        parallel_map=parallel_map,
        tell=after_generation,
    )
    chosen = found.front if params.objective == 'front' else found.ranked[: params.finalists]
    finalists = plan.evaluated_exactly(chosen)
    return SearchResult(finalists[0], finalists, found, score_cache)


class _Plan(Generic[R]):
    """Trials, costs and exact predictions of individuals."""

    def __init__(
        self,
        space: RecipeSpace[R],
        search_slides: SearchSlides,
        task: SearchTask[R],
        features: FeatureCache,
        parallel_map: ParallelMap,
    ) -> None:
        self._space, self._split, self._task, self._features = space, search_slides, task, features
        self._parallel_map = parallel_map
        self.cost = lru_cache(maxsize=None)(self._cost)

    @property
    def identity(self) -> dict[str, Any]:
        """What the scores of this search belong to."""
        examples = self._split.examples(self._space.base.training_windows)
        recipe = json.dumps(self._space.base.as_mapping(), sort_keys=True)
        return {
            'recipe': _digest(recipe),
            'task': _digest(repr(self._task)),
            'variables': {name: repr(axis) for name, axis in self._space.axes.items()},
            'slides': examples.digest,
            'surfaces': list(examples.names),
            'halves': self._split.n_halves,
            'seed': self._split.seed,
        }

    def fitness_functions(self, individuals: Sequence[Individual], *, quick: bool = True) -> list[FitnessFunction]:
        """Return the trials of individuals."""
        recipes = [self._space.recipe(individual) for individual in individuals]
        extracted = self._features.many([self._task.feature_set_of(recipe) for recipe in recipes], self._parallel_map)
        return [
            self._fitness_function(recipe, values[self._split.rows(recipe.training_windows)], quick)
            for recipe, values in zip(recipes, extracted, strict=True)
        ]

    def evaluated_exactly(self, chosen: Sequence[ScoredIndividual]) -> tuple[Finalist[R], ...]:
        """Return the recipes with the scores of their learners on all halves, best first."""
        fitness_functions = self.fitness_functions([one.individual for one in chosen], quick=False)
        n_halves = self._split.n_halves
        cases = [(fitness_function, number) for fitness_function in fitness_functions for number in range(n_halves)]
        scores = self._parallel_map(_one_half, cases)
        finalists = []
        for place, one in enumerate(chosen):
            mine = scores[place * n_halves : (place + 1) * n_halves]
            recipe = self._space.recipe(one.individual)
            finalists.append(Finalist(recipe, one, HalfScores.of(mine)))
        return tuple(sorted(finalists, key=lambda finalist: -finalist.fitness))

    def _fitness_function(self, recipe: R, values: Array, quick: bool) -> FitnessFunction:
        windows = recipe.training_windows
        examples, halves = self._split.examples(windows), self._split.halves(windows)
        return self._task.fitness_function(recipe, values, examples, halves, quick=quick)

    def _cost(self, individual: Individual) -> float:
        recipe = self._space.recipe(individual)
        examples = self._split.examples(recipe.training_windows)
        n_samples = sum(item.samples[0].size for item in examples.inputs.values())
        n_values = self._features.values(self._task.feature_set_of(recipe)).shape[1]
        return self._task.cost(recipe, n_samples, n_values, examples)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def _one_half(case: tuple[FitnessFunction, int]) -> tuple[float, float]:
    fitness_function, number = case
    return fitness_function.start()(number)

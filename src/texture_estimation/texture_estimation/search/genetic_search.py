"""The genetic search: which individuals are tried, generation by generation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_estimation.search.algorithm import algorithm_for
from texture_estimation.search.generation import Generation, ScoredIndividual, SearchParams, rank
from texture_estimation.search.parallel import ParallelMap, serial_map
from texture_estimation.search.racing import EMPTY, FitnessFunction, HalfScores, race, raced_fitness
from texture_estimation.search.score_cache import ScoreCache
from texture_estimation.search.variables import Individual, SearchSpace

# Halves on which the first generation finds its leader.
FIRST_LOOK = 4


@dataclass(frozen=True)
class SearchOutcome:
    """What a search found.

    Parameters
    ----------
    ranked
        The last population, best first.
    front
        Those of it that no other beats in both accuracy and cost, cheapest first.
    history
        One entry a generation.

    Examples
    --------
    >>> SearchOutcome(ranked=(), front=(), history=()).history
    ()
    """

    ranked: tuple[ScoredIndividual, ...]
    front: tuple[ScoredIndividual, ...]
    history: tuple[Generation, ...]


def search(
    space: SearchSpace,
    fitness_functions: Callable[[Sequence[Individual]], Sequence[FitnessFunction]],
    params: SearchParams,
    score_cache: ScoreCache,
    *,
    start: Sequence[Individual] = (),
    cost: Callable[[Individual], float] = lambda _: 0.0,
    parallel_map: ParallelMap = serial_map,
    tell: Callable[[Generation], None] = lambda _: None,
) -> SearchOutcome:
    """Return the best individuals of a space.

    Parameters
    ----------
    space
        What is varied.
    fitness_functions
        Makes the trials of individuals; called once a generation with those that need to be evaluated.
    params
        Population, generations, halves, seed and objective.
    score_cache
        Remembers scores; filled from a checkpoint, the search goes on where that one ended.
    start
        Individuals that belong to the first generation; the others are drawn.
    cost
        Second objective of 'front', such as operations a window.
    parallel_map
        Over what the trials are spread.
    tell
        Called after each generation.

    Returns
    -------
    SearchOutcome
        The best individuals, and what each generation was like.
    """
    n_objectives = 2 if params.objective == 'front' else 1
    algorithm = algorithm_for(space, params.population, n_objectives, params.seed, start)
    racer = _Racer(fitness_functions, params, score_cache, cost, parallel_map)
    history: list[Generation] = []
    members: dict[Individual, ScoredIndividual] = {}
    for number in range(1, params.generations + 1):
        offspring = algorithm.ask()
        if offspring is None:  # nothing new is left in a small space
            break
        tried = [space.decode(point) for point in offspring.get('X')]
        scored = racer.score(tried, list(members.values()))
        offspring.set('F', np.array([_objectives(one, params) for one in scored]))
        algorithm.tell(infills=offspring)
        known = {**members, **{one.individual: one for one in scored}}
        members = {key: known[key] for key in (space.decode(point) for point in algorithm.pop.get('X'))}
        best = max(members.values(), key=rank)
        history.append(
            Generation(number, params.generations, best, len(score_cache.records), score_cache.hits, racer.halves)
        )
        tell(history[-1])
    ranked = tuple(sorted(members.values(), key=rank, reverse=True))
    return SearchOutcome(ranked, _front(ranked), tuple(history))


class _Racer:
    """Score individuals, each against one that it must beat to survive."""

    def __init__(
        self,
        fitness_functions: Callable[[Sequence[Individual]], Sequence[FitnessFunction]],
        params: SearchParams,
        score_cache: ScoreCache,
        cost: Callable[[Individual], float],
        parallel_map: ParallelMap,
    ) -> None:
        self._fitness_functions, self._params, self._score_cache = fitness_functions, params, score_cache
        self._cost, self._parallel_map = cost, parallel_map
        self.halves = 0

    def score(self, individuals: Sequence[Individual], parents: Sequence[ScoredIndividual]) -> list[ScoredIndividual]:
        """Return the scores of one generation."""
        self._score_cache.hits += sum(one in self._score_cache.records for one in individuals)
        costs = [self._cost(one) for one in individuals]
        leaders = parents or (self._first_leaders(individuals, costs) if self._params.race else [])
        incumbents = [self._incumbent(leaders, cost) for cost in costs]
        self._race(individuals, incumbents, self._params.halves)
        scored = []
        for one, incumbent, cost in zip(individuals, incumbents, costs, strict=True):
            value, halves = raced_fitness(self._score_cache.records[one], incumbent, self._params.halves)
            scored.append(ScoredIndividual(one, value, cost, halves))
        return scored

    def _first_leaders(self, individuals: Sequence[Individual], costs: Sequence[float]) -> list[ScoredIndividual]:
        """Return the one that does best on a few halves, when there are no parents, evaluated on all."""
        few = min(FIRST_LOOK, self._params.halves)
        self._race(individuals, [None] * len(individuals), few)
        glimpses = [float(self._score_cache.records[one].means[:few].mean()) for one in individuals]
        best = max(range(len(individuals)), key=lambda index: (glimpses[index], -costs[index], -index))
        self._race([individuals[best]], [None], self._params.halves)
        record = self._score_cache.records[individuals[best]]
        return [ScoredIndividual(individuals[best], float(record.means.mean()), costs[best], self._params.halves)]

    def _race(self, individuals: Sequence[Individual], incumbents: Sequence[Array | None], n_halves: int) -> None:
        """Have the memory hold what a verdict on each needs."""
        score_cache = self._score_cache
        known = [score_cache.get(one) for one in individuals]
        open_cases = [index for index, record in enumerate(known) if not _settled(record, incumbents[index], n_halves)]
        fitness_functions = self._fitness_functions([individuals[index] for index in open_cases]) if open_cases else ()
        cases = [
            (fitness_function, known[index], incumbents[index], n_halves)
            for index, fitness_function in zip(open_cases, fitness_functions, strict=True)
        ]
        for index, record in zip(open_cases, self._parallel_map(_race, cases), strict=True):
            self.halves += record.halves - known[index].halves
            score_cache.store(individuals[index], record)

    def _incumbent(self, leaders: Sequence[ScoredIndividual], cost: float) -> Array | None:
        """Return the mean scores on each half of the best of those that cost no more; None without any.

        Whoever is clearly worse than the best need not be known exactly: it is ranked by its estimate.
        """
        n_halves = self._params.halves
        if not self._params.race:
            return None
        fair = [one for one in leaders if one.cost <= cost and one.halves == n_halves]
        if not fair:
            return None
        return self._score_cache.records[max(fair, key=rank).individual].means[:n_halves]


def _race(case: tuple[FitnessFunction, HalfScores, Array | None, int]) -> HalfScores:
    return race(*case)


def _settled(known: HalfScores, incumbent: Array | None, n_halves: int) -> bool:
    """Tell whether what is remembered is enough for a verdict."""
    if known is EMPTY:
        return False
    return known.halves >= n_halves or (
        incumbent is not None and raced_fitness(known, incumbent, known.halves + 1)[1] <= known.halves
    )


def _objectives(one: ScoredIndividual, params: SearchParams) -> list[float]:
    return [-one.fitness, one.cost] if params.objective == 'front' else [-one.fitness]


def _front(scored: Sequence[ScoredIndividual]) -> tuple[ScoredIndividual, ...]:
    """Return those that none beats in accuracy at the same cost or less, cheapest first."""
    front: list[ScoredIndividual] = []
    for one in sorted(scored, key=lambda s: (s.cost, -s.fitness)):
        if not front or one.fitness > front[-1].fitness:
            front.append(one)
    return tuple(front)

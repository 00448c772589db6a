"""The genetic search: which individuals are tried, generation by generation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.search.algorithm import algorithm_for
from texture_estimation.search.memory import Memory
from texture_estimation.search.spread import Spread, in_turn
from texture_estimation.search.trial import EMPTY, Record, Trial, judge, verdict
from texture_estimation.search.variables import Individual, SearchSpace

OBJECTIVES = ('accuracy', 'front')
# Halves on which the first generation finds its leader.
FIRST_LOOK = 4


@dataclass(frozen=True)
class SearchParams:
    """How long and for what is searched; the defaults are those of Roberge et al."""

    population: int = param(20, 'Individuals of a generation.', low=4, high=1000)
    generations: int = param(30, 'Generations, the first included.', low=1, high=10_000)
    halves: int = param(20, 'Random halves on which each individual is judged.', low=2, high=1000)
    seed: int = param(0, 'Of the halves and of the search.', low=0)
    objective: str = param(
        'accuracy', 'accuracy alone, or the front of accuracy and computing time (NSGA-II).', choices=OBJECTIVES
    )
    finalists: int = param(3, 'Best individuals that are judged again by the learner itself.', low=1, high=1000)
    race: bool = param(True, 'Give up an individual once it is clearly worse than the best; else do all its halves.')


@dataclass(frozen=True)
class Scored:
    """An individual with its fitness (larger is better), its cost and the number of halves behind the fitness."""

    individual: Individual
    fitness: float
    cost: float
    halves: int


@dataclass(frozen=True)
class Generation:
    """What is told after each generation.

    Parameters
    ----------
    number, of
        Of the generation, and how many there will be.
    best
        Of the individuals alive.
    judged
        Different individuals met so far.
    remembered
        How often one was met again.
    halves
        Judged so far: `judged` times the number of halves, had none been given up early.
    """

    number: int
    of: int
    best: Scored
    judged: int
    remembered: int
    halves: int


@dataclass(frozen=True)
class Found:
    """What a search found.

    Parameters
    ----------
    ranked
        The last population, best first.
    front
        Those of it that no other beats in both accuracy and cost, cheapest first.
    history
        One entry a generation.
    """

    ranked: tuple[Scored, ...]
    front: tuple[Scored, ...]
    history: tuple[Generation, ...]


def search(
    space: SearchSpace,
    trials: Callable[[Sequence[Individual]], Sequence[Trial]],
    params: SearchParams,
    memory: Memory,
    *,
    start: Sequence[Individual] = (),
    cost: Callable[[Individual], float] = lambda _: 0.0,
    spread: Spread = in_turn,
    tell: Callable[[Generation], None] = lambda _: None,
) -> Found:
    """Return the best individuals of a space.

    Parameters
    ----------
    space
        What is varied.
    trials
        Makes the trials of individuals; called once a generation with those that need to be judged.
    params
        Population, generations, halves, seed and objective.
    memory
        Remembers scores; filled from a checkpoint, the search goes on where that one ended.
    start
        Individuals that belong to the first generation; the others are drawn.
    cost
        Second objective of 'front', such as operations a window.
    spread
        Over what the trials are spread.
    tell
        Called after each generation.
    """
    n_objectives = 2 if params.objective == 'front' else 1
    algorithm = algorithm_for(space, params.population, n_objectives, params.seed, start)
    jury = _Jury(trials, params, memory, cost, spread)
    history: list[Generation] = []
    members: dict[Individual, Scored] = {}
    for number in range(1, params.generations + 1):
        offspring = algorithm.ask()
        if offspring is None:  # nothing new is left in a small space
            break
        tried = [space.decode(point) for point in offspring.get('X')]
        scored = jury.score(tried, list(members.values()))
        offspring.set('F', np.array([_objectives(one, params) for one in scored]))
        algorithm.tell(infills=offspring)
        known = {**members, **{one.individual: one for one in scored}}
        members = {key: known[key] for key in (space.decode(point) for point in algorithm.pop.get('X'))}
        best = max(members.values(), key=_rank)
        history.append(Generation(number, params.generations, best, len(memory.records), memory.hits, jury.halves))
        tell(history[-1])
    ranked = tuple(sorted(members.values(), key=_rank, reverse=True))
    return Found(ranked, _front(ranked), tuple(history))


class _Jury:
    """Score individuals, each against one that it must beat to survive."""

    def __init__(
        self,
        trials: Callable[[Sequence[Individual]], Sequence[Trial]],
        params: SearchParams,
        memory: Memory,
        cost: Callable[[Individual], float],
        spread: Spread,
    ) -> None:
        self._trials, self._params, self._memory = trials, params, memory
        self._cost, self._spread = cost, spread
        self.halves = 0

    def score(self, individuals: Sequence[Individual], parents: Sequence[Scored]) -> list[Scored]:
        """Return the scores of one generation."""
        self._memory.hits += sum(one in self._memory.records for one in individuals)
        costs = [self._cost(one) for one in individuals]
        leaders = parents or (self._first_leaders(individuals, costs) if self._params.race else [])
        rivals = [self._rival(leaders, cost) for cost in costs]
        self._judge(individuals, rivals, self._params.halves)
        scored = []
        for one, rival, cost in zip(individuals, rivals, costs, strict=True):
            value, halves = verdict(self._memory.records[one], rival, self._params.halves)
            scored.append(Scored(one, value, cost, halves))
        return scored

    def _first_leaders(self, individuals: Sequence[Individual], costs: Sequence[float]) -> list[Scored]:
        """Return the one that does best on a few halves, when there are no parents, judged on all."""
        few = min(FIRST_LOOK, self._params.halves)
        self._judge(individuals, [None] * len(individuals), few)
        glimpses = [float(self._memory.records[one].means[:few].mean()) for one in individuals]
        best = max(range(len(individuals)), key=lambda index: (glimpses[index], -costs[index], -index))
        self._judge([individuals[best]], [None], self._params.halves)
        record = self._memory.records[individuals[best]]
        return [Scored(individuals[best], float(record.means.mean()), costs[best], self._params.halves)]

    def _judge(self, individuals: Sequence[Individual], rivals: Sequence[Array | None], n_halves: int) -> None:
        """Have the memory hold what a verdict on each needs."""
        memory = self._memory
        known = [memory.recall(one) for one in individuals]
        open_cases = [index for index, record in enumerate(known) if not _settled(record, rivals[index], n_halves)]
        trials = self._trials([individuals[index] for index in open_cases]) if open_cases else ()
        cases = [
            (trial, known[index], rivals[index], n_halves) for index, trial in zip(open_cases, trials, strict=True)
        ]
        for index, record in zip(open_cases, self._spread(_judge, cases), strict=True):
            self.halves += record.halves - known[index].halves
            memory.keep(individuals[index], record)

    def _rival(self, leaders: Sequence[Scored], cost: float) -> Array | None:
        """Return the mean scores on each half of the best of those that cost no more; None without any.

        Whoever is clearly worse than the best need not be known exactly: it is ranked by its estimate.
        """
        n_halves = self._params.halves
        if not self._params.race:
            return None
        fair = [one for one in leaders if one.cost <= cost and one.halves == n_halves]
        if not fair:
            return None
        return self._memory.records[max(fair, key=_rank).individual].means[:n_halves]


def _judge(case: tuple[Trial, Record, Array | None, int]) -> Record:
    return judge(*case)


def _settled(known: Record, rival: Array | None, n_halves: int) -> bool:
    """Tell whether what is remembered is enough for a verdict."""
    if known is EMPTY:
        return False
    return known.halves >= n_halves or (
        rival is not None and verdict(known, rival, known.halves + 1)[1] <= known.halves
    )


def _objectives(one: Scored, params: SearchParams) -> list[float]:
    return [-one.fitness, one.cost] if params.objective == 'front' else [-one.fitness]


def _rank(one: Scored) -> tuple[float, float, str]:
    return one.fitness, -one.cost, str(one.individual)


def _front(scored: Sequence[Scored]) -> tuple[Scored, ...]:
    """Return those that none beats in accuracy at the same cost or less, cheapest first."""
    front: list[Scored] = []
    for one in sorted(scored, key=lambda s: (s.cost, -s.fitness)):
        if not front or one.fitness > front[-1].fitness:
            front.append(one)
    return tuple(front)

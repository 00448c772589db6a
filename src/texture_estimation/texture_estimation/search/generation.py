"""Individuals of a genetic search with their scores, and how a generation is ranked."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param
from texture_estimation.search.variables import Individual

OBJECTIVES = ('accuracy', 'front')


@dataclass(frozen=True)
class SearchParams:
    """How long and for what is searched; the defaults are those of Roberge et al.

    Examples
    --------
    >>> SearchParams(population=10).population
    10
    """

    population: int = param(
        20, 'Sets the number of individuals in a generation; more search wider and take longer.', low=4, high=1000
    )
    generations: int = param(
        30, 'Sets the number of generations, including the first one; more search longer.', low=1, high=10_000
    )
    halves: int = param(20, 'Number of random half splits on which each individual is evaluated.', low=2, high=1000)
    seed: int = param(
        0, 'Sets the seed of the random half splits and of the search; equal seeds give equal results.', low=0
    )
    objective: str = param(
        'accuracy',
        "Sets the objective: 'accuracy', or the Pareto 'front' of accuracy and computing cost (NSGA-II).",
        choices=OBJECTIVES,
    )
    finalists: int = param(
        3, 'Number of best individuals that are evaluated again with the learner itself.', low=1, high=1000
    )
    race: bool = param(True, 'Stop evaluating an individual once it is significantly worse than the best one (racing).')


@dataclass(frozen=True)
class ScoredIndividual:
    """An individual with its fitness (larger is better), its cost and the number of halves behind the fitness.

    Examples
    --------
    >>> ScoredIndividual((3, 'svm'), fitness=0.9, cost=1e4, halves=20).individual
    (3, 'svm')
    """

    individual: Individual
    fitness: float
    cost: float
    halves: int


@dataclass(frozen=True)
class Generation:
    """What is reported after each generation.

    Parameters
    ----------
    number, of
        Of the generation, and how many there will be.
    best
        Of the individuals alive.
    evaluated
        Different individuals met so far.
    cache_hits
        How often one was met again.
    halves
        Evaluated so far: `evaluated` times the number of halves, had none been given up early.

    Examples
    --------
    >>> best = ScoredIndividual((3, 'svm'), fitness=0.9, cost=1e4, halves=20)
    >>> Generation(1, of=30, best=best, evaluated=20, cache_hits=0, halves=400).best.individual
    (3, 'svm')
    """

    number: int
    of: int
    best: ScoredIndividual
    evaluated: int
    cache_hits: int
    halves: int


def rank(one: ScoredIndividual) -> tuple[float, float, str]:
    """Return by what individuals are ranked, the best highest."""
    return one.fitness, -one.cost, str(one.individual)

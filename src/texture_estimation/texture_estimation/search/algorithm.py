"""The evolutionary algorithms of pymoo, set up for a search space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2  # type: ignore[import-untyped]
from pymoo.algorithms.soo.nonconvex.ga import GA  # type: ignore[import-untyped]
from pymoo.config import Config  # type: ignore[import-untyped]
from pymoo.core.problem import Problem  # type: ignore[import-untyped]
from pymoo.core.repair import Repair  # type: ignore[import-untyped]
from pymoo.core.termination import NoTermination  # type: ignore[import-untyped]
from pymoo.operators.crossover.sbx import SBX  # type: ignore[import-untyped]
from pymoo.operators.mutation.pm import PM  # type: ignore[import-untyped]

from texture_core.arrays import Array
from texture_estimation.search.variables import Individual, SearchSpace

# Crossover and mutation reach this far: low indices make wide steps, which variables of few values need.
WIDTH_INDEX = 3.0
CROSSOVER_SHARE = 0.9
ALGORITHMS = {1: GA, 2: NSGA2}

# Its compiled parts would save nothing here, and it prints a notice of their lack.
Config.warnings['not_compiled'] = False


class Snap(Repair):  # type: ignore[misc]
    """Bring points to the middles of their cells, so that equal individuals are known as such.

    Examples
    --------
    >>> from pymoo.core.population import Population
    >>> from texture_estimation.search.variables import Integer
    >>> space = SearchSpace({'bands': Integer(1, 2)})
    >>> Snap(space).do(None, Population.new(X=np.array([[0.1], [0.4]]))).get('X').tolist()  # both mean 1 band
    [[0.25], [0.25]]
    """

    def __init__(self, space: SearchSpace) -> None:
        super().__init__()
        self._space = space

    def _do(self, problem: Any, points: Array, **_: Any) -> Array:
        return self._space.snap(points)


def algorithm_for(
    space: SearchSpace, population: int, n_objectives: int, seed: int, start: Sequence[Individual] = ()
) -> Any:
    """Return a genetic algorithm (one objective) or NSGA-II (two), to be asked for points and given their objectives.

    Parameters
    ----------
    space
        Points are in its unit cube.
    population
        Individuals of a generation.
    n_objectives
        1 or 2; smaller is better.
    seed
        Of all that it draws.
    start
        Individuals of the first generation; the others are drawn.

    Returns
    -------
    pymoo's Algorithm
        Set up, before its first generation.
    """
    problem = Problem(n_var=len(space.names), n_obj=n_objectives, xl=0.0, xu=1.0)
    algorithm = ALGORITHMS[n_objectives](
        pop_size=population,
        sampling=_first_points(space, population, seed, start),
        crossover=SBX(eta=WIDTH_INDEX, prob=CROSSOVER_SHARE),
        mutation=PM(eta=WIDTH_INDEX),
        repair=Snap(space),
        eliminate_duplicates=True,
    )
    algorithm.setup(problem, termination=NoTermination(), seed=seed)
    return algorithm


def _first_points(space: SearchSpace, population: int, seed: int, start: Sequence[Individual]) -> Array:
    """Return the first generation, (population, n_variables)."""
    given = np.array([space.encode(individual) for individual in start]).reshape(-1, len(space.names))[:population]
    sample_rows = np.random.default_rng(seed).random((population - len(given), len(space.names)))
    return np.concatenate([given, sample_rows])

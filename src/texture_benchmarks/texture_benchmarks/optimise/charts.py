"""Charts of the searches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from texture_benchmarks.optimise.cases import (
    CASES,
)
from texture_estimation.search.optimise import SearchResult
from texture_evaluation.optimise_charts import convergence_chart, search_front_chart


def linear_charts(found: Mapping[str, SearchResult[Any]], out: Path) -> tuple[Path, ...]:
    """Draw how the searches of the linear experiment converge."""
    reported = {name: one.found.history for name, one in found.items()}
    title = 'Searches of the linear experiment (simulated slides)'
    return (convergence_chart(reported, title, out / 'optimise_linear.png'),)


def search_charts(found: Mapping[str, SearchResult[Any]], out: Path) -> tuple[Path, ...]:
    """Draw how all searches converge, and the front of fitness and computing."""
    single = {name: one.found.history for name, one in found.items() if CASES[name].params.objective == 'accuracy'}
    fronts: dict[str, Sequence[tuple[float, float]]] = {
        name.removesuffix(', front'): [(point.searched.cost, point.fitness) for point in one.finalists]
        for name, one in found.items()
        if CASES[name].params.objective == 'front'
    }
    reported = {name: history for name, history in single.items() if CASES[name].data != 'roughness'}
    graded = {name: history for name, history in single.items() if CASES[name].data == 'roughness'}
    return (
        convergence_chart(
            reported, 'Searches that distinguish surfaces (simulated slides)', out / 'optimise_textures.png'
        ),
        convergence_chart(graded, 'Searches that grade roughness (simulated slides)', out / 'optimise_roughness.png'),
        search_front_chart(
            fronts, 'The linear experiment: fitness and computing (simulated slides)', out / 'optimise_front.png'
        ),
    )

"""What an experiment is given, and what it hands back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from texture_benchmarks.result import BenchmarkResult


@dataclass(frozen=True)
class Experiment:
    """Where an experiment writes, its seed, and whether to hurry.

    Parameters
    ----------
    out
        Folder for the JSON and the charts.
    seed
        Of everything random.
    quick
        Fewer slides, for tests; such numbers are not for publishing.
    tune
        Search the parameters first, as the paper does; refused where the paper has no search.
    splits
        Try each method on at most so many of the splits; 0 for all.
    papers_only
        Leave our own recipes out.
    """

    out: Path
    seed: int = 0
    quick: bool = False
    tune: bool = False
    splits: int = 0
    papers_only: bool = False


@dataclass(frozen=True)
class ExperimentResult(BenchmarkResult):
    """The numbers of one experiment; `lines` are the table for people, the paper's figures beside ours."""

    lines: tuple[str, ...] = ()


Run = Callable[[Experiment], ExperimentResult]

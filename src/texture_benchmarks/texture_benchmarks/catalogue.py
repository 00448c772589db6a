# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Studies by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from texture_benchmarks import generalisation, latency, learning, motion, overview, papers, scale, scenes, trust
from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_core.config import find
from texture_evaluation.charts import reduced_run

BENCHMARKS: Mapping[str, Callable[[BenchmarkOptions], BenchmarkResult]] = {
    'latency': latency.run,  # from window to estimate, in one process and through the graph; computing time
    # accuracy over sliding time and over computing time: ours, the papers' and peers, in one run
    'overview': overview.run,
    'scale': scale.run,  # trainings and windows with up to 1000 textures and 100 000 windows, drawn features
    'generalisation': generalisation.run,  # against the distance from what was trained: place, day, finger, run
    'papers': papers.run,  # the papers' recipes on recordings, at the same and at another place of a track
    'trust': trust.run,  # where recognition fails: how slides end under disturbances and over unknown materials
    'learning': learning.run,  # textures added slide by slide, and slides needed with chosen motions
    'motion': motion.run,  # forces in virtual time by stiffness, delay and fault
    'scenes': scenes.run,  # cost of simulated slides and devices; what each term of a scene contributes
}


def run_benchmark(name: str, options: BenchmarkOptions) -> tuple[BenchmarkResult, Path]:
    """Run one study; return its result and the JSON file, with the charts next to it."""
    run = find(BENCHMARKS, name, 'benchmark')
    options.out.mkdir(parents=True, exist_ok=True)  # not only when the figures are there
    with reduced_run(quick=options.quick):
        result = run(options)
        return result, result.write(options.out, name, run.__doc__)

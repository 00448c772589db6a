# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The papers' experiments by name, rebuilt on simulated surfaces."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

from joblib import Parallel, delayed

from texture_core.config import find
from texture_core.errors import InvalidParameter, TextureError
from texture_papers import hu_experiment, jamali_experiment, kaboli_experiment, rispal_experiment, roberge_experiment
from texture_papers.protocol import (
    Experiment,
    ExperimentResult,
    PairSearch,
    Run,
    over_seeds,
    pair_searches,
    search_pair,
)
from texture_papers.report import charts_of, digests, run
from texture_papers.search import QUICK, Found, Individual

PROTOCOLS = {
    protocol.name: protocol
    for protocol in (
        roberge_experiment.LINEAR,
        roberge_experiment.CIRCULAR,
        roberge_experiment.FINE,
        jamali_experiment.PROTOCOL,
        kaboli_experiment.PROTOCOL,
        kaboli_experiment.SHAPES,
        hu_experiment.PROTOCOL,
    )
}
EXPERIMENTS: Mapping[str, Run] = {
    **{name: partial(run, protocol) for name, protocol in PROTOCOLS.items()},
    'friction': roberge_experiment.run_friction,  # the further question of Roberge et al.
    'kaboli-online': kaboli_experiment.run_online,  # new objects added slide by slide: forgetting and cost
    'hu-components': hu_experiment.run_components,  # how many components one linen takes
    'roughness': rispal_experiment.run,  # Rispal et al.: grades of textures never touched
}
TUNED = tuple(name for name, one in PROTOCOLS.items() if any(m.search for task in one.tasks for m in task.methods))
# Of each stored file the digests of its rows as they are now: rows with others are neither kept nor published.
DIGESTS: Mapping[str, Callable[[], Mapping[str, str]]] = {
    **{name: partial(digests, protocol) for name, protocol in PROTOCOLS.items()},
    **{f'{name}-tuned': partial(digests, PROTOCOLS[name], tuned=True) for name in TUNED},
    'friction': roberge_experiment.friction_digests,
    'kaboli-online': kaboli_experiment.online_digests,
    'hu-components': hu_experiment.component_digests,
    'roughness': rispal_experiment.digests,
    'roughness-tuned': partial(rispal_experiment.digests, tuned=True),
}

__all__ = [
    'DIGESTS',
    'EXPERIMENTS',
    'Experiment',
    'ExperimentResult',
    'run_experiment',
    'run_over_seeds',
    'run_searches',
]


def _run_of(name: str, experiment: Experiment) -> Run:
    """Return what runs an experiment; refused is a search where the paper has none."""
    found = find(EXPERIMENTS, name, 'experiment')
    if experiment.tune and name not in (*TUNED, 'roughness'):
        raise InvalidParameter(
            f"experiment '{name}' has nothing to tune: its paper searches for no parameters; leave --tune out"
        )
    return found


SEARCHES = 'searches.jsonl'


def run_searches(
    name: str, experiment: Experiment, count: int = 1, jobs: int = 1, until_s: float = math.inf
) -> Experiment:
    """Search the variables of all pairs for this many seeds; return the experiment with what was found.

    Each search is a line of a file in the folder of the results, written when it is done: another call continues there.
    """
    if not experiment.tune or name not in TUNED:
        return experiment
    protocol = PROTOCOLS[name]
    experiment = replace(experiment, search=experiment.search or (QUICK if experiment.quick else None))
    seeds = range(experiment.seed, experiment.seed + count)
    wanted = [one for seed in seeds for one in pair_searches(protocol, replace(experiment, seed=seed))]
    path = experiment.out / SEARCHES
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = path.read_text(encoding='utf-8').splitlines() if path.is_file() else []
    done = {line['search']: Found(**line['found']) for line in map(json.loads, lines)}
    for parts in (False, True):  # the search for parts begins with the best of that for whole scans
        best = {one.kind: done[str(one)].best for one in wanted if str(one) in done}
        due = [one for one in wanted if bool(one.after) == parts and str(one) not in done]
        starts = [best.get((one.task, one.after, one.pair, one.params.seed)) for one in due]
        calls = [delayed(_searched)(one, start or (), until_s)
                 for one, start in zip(due, starts, strict=True) if start or not parts]  # fmt: skip
        for one, found in Parallel(n_jobs=jobs, return_as='generator_unordered')(calls):
            if found is not None:
                done[str(one)] = found
                with path.open('a', encoding='utf-8') as file:
                    file.write(json.dumps({'search': str(one), 'found': asdict(found)}) + '\n')
    left = sum(str(one) not in done for one in wanted)
    if left:
        raise TextureError(f'{left} of {len(wanted)} searches are left; the same command continues with them')
    return replace(experiment, found={one: done[str(one)] for one in wanted})


def _searched(wanted: PairSearch, start: Sequence[Individual], until_s: float) -> tuple[PairSearch, Found | None]:
    if time.time() > until_s:
        return wanted, None
    try:
        return wanted, search_pair(PROTOCOLS[wanted.protocol], wanted, start, until_s)
    except TimeoutError:
        return wanted, None


def run_experiment(name: str, experiment: Experiment) -> tuple[ExperimentResult, Path]:
    """Run one experiment; return its result and the JSON file, with the charts next to it."""
    run_of = _run_of(name, experiment)
    result = run_of(experiment if experiment.found else run_searches(name, experiment))
    return result, result.write(experiment.out)


def run_over_seeds(name: str, experiment: Experiment, count: int) -> tuple[ExperimentResult, Path]:
    """Run one experiment with this many seeds, from its seed on; return what `run_experiment` does."""
    run_of = _run_of(name, experiment)
    experiment = experiment if experiment.found else run_searches(name, experiment, count)
    result = over_seeds(run_of, name, experiment, count, DIGESTS[f'{name}{"-tuned" if experiment.tune else ""}']())
    if name in PROTOCOLS and not experiment.tune:
        result = replace(result, charts=charts_of(PROTOCOLS[name], result.numbers, name, experiment.out))
    elif name == 'roughness' and not experiment.tune:
        result = replace(result, charts=(rispal_experiment.errors_chart(result.numbers, experiment.out),))
    return result, result.write(experiment.out)

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The papers' experiments by name, rebuilt on simulated surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from texture_core.config import find
from texture_core.errors import InvalidParameter
from texture_papers import hu_experiment, jamali_experiment, kaboli_experiment, rispal_experiment, roberge_experiment
from texture_papers.protocol import Experiment, ExperimentResult, Run, over_seeds
from texture_papers.report import charts_of, digests, run

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

__all__ = ['DIGESTS', 'EXPERIMENTS', 'Experiment', 'ExperimentResult', 'run_experiment', 'run_over_seeds']


def _run_of(name: str, experiment: Experiment) -> Run:
    """Return what runs an experiment; refused is a search where the paper has none."""
    found = find(EXPERIMENTS, name, 'experiment')
    if experiment.tune and name not in (*TUNED, 'roughness'):
        raise InvalidParameter(
            f"experiment '{name}' has nothing to tune: its paper searches for no parameters; leave --tune out"
        )
    return found


def run_experiment(name: str, experiment: Experiment) -> tuple[ExperimentResult, Path]:
    """Run one experiment; return its result and the JSON file, next to which its charts lie."""
    result = _run_of(name, experiment)(experiment)
    return result, result.write(experiment.out)


def run_over_seeds(name: str, experiment: Experiment, count: int) -> tuple[ExperimentResult, Path]:
    """Run one experiment with so many seeds from its own on; return what `run_experiment` does."""
    run_of = _run_of(name, experiment)
    result = over_seeds(run_of, name, experiment, count, DIGESTS[f'{name}{"-tuned" if experiment.tune else ""}']())
    if name in PROTOCOLS and not experiment.tune:
        result = replace(result, charts=charts_of(PROTOCOLS[name], result.numbers, name, experiment.out))
    return result, result.write(experiment.out)

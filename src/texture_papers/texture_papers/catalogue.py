# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The papers' experiments by name, reproduced on simulated surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

from texture_core.config import find
from texture_core.errors import InvalidParameter
from texture_evaluation.charts import reduced_run
from texture_papers import hu_experiment, jamali_experiment, kaboli_experiment, rispal_experiment, roberge_experiment
from texture_papers.protocol import Experiment, ExperimentResult, with_seeds
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
EXPERIMENTS: Mapping[str, Callable[[Experiment], ExperimentResult]] = {
    **{name: partial(run, protocol) for name, protocol in PROTOCOLS.items()},
    'kaboli-online': kaboli_experiment.run_online,  # new objects added slide by slide: forgetting and cost
    'hu-components': hu_experiment.run_components,  # how many components one linen takes
    'roughness': rispal_experiment.run,  # Rispal et al.: grades of textures never touched
}
TUNED = tuple(name for name, one in PROTOCOLS.items() if any(m.search for task in one.tasks for m in task.methods))
# Of each stored file the digests of its rows as they are now: rows with others are not published.
DIGESTS: Mapping[str, Callable[[], Mapping[str, str]]] = {
    **{name: partial(digests, protocol) for name, protocol in PROTOCOLS.items()},
    **{f'{name}-tuned': partial(digests, PROTOCOLS[name], tuned=True) for name in TUNED},
    'kaboli-online': partial(digests, kaboli_experiment.PROTOCOL),
    'hu-components': partial(digests, hu_experiment.PROTOCOL),
    'roughness': rispal_experiment.digests,
    'roughness-tuned': partial(rispal_experiment.digests, tuned=True),
}

__all__ = ['DIGESTS', 'EXPERIMENTS', 'Experiment', 'ExperimentResult', 'run_experiment']


def run_experiment(name: str, experiment: Experiment, seeds: int = 1) -> tuple[ExperimentResult, Path]:
    """Run one experiment with this many seeds, from its seed on.

    Return the result of the first, with means and intervals over the seeds if there are several, and the JSON file,
    with the charts next to it.
    """
    run_of = find(EXPERIMENTS, name, 'experiment')
    if seeds < 1:
        raise InvalidParameter(f'{seeds} seeds were requested; one or more are needed')
    if experiment.tune and name not in (*TUNED, 'roughness'):
        raise InvalidParameter(
            f"experiment '{name}' has nothing to tune: its paper searches for no parameters; leave --tune out"
        )
    with reduced_run(quick=experiment.quick):
        first, *others = [run_of(replace(experiment, seed=experiment.seed + number)) for number in range(seeds)]
        if others:
            first = replace(first, numbers=with_seeds(first.numbers, [one.numbers for one in others]))
        charts = list(first.charts)
        if name in PROTOCOLS and not experiment.tune:
            charts.append(charts_of(PROTOCOLS[name], first, experiment.out))
        elif name == 'roughness' and others and not experiment.tune:
            charts.append(rispal_experiment.errors_chart(first, experiment.out))
        result = replace(first, charts=tuple(charts))
        return result, result.write(experiment.out)

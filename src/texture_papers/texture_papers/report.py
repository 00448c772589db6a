# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Figures of the papers next to ours: tables, charts, and whether the claims hold."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.types import Array
from texture_evaluation.charts import COLOURS, chart
from texture_papers.protocol import (
    NONE,
    VERDICTS,
    Experiment,
    ExperimentResult,
    Finding,
    Interval,
    Method,
    MethodResult,
    MethodResults,
    PaperProtocol,
    difference,
    digest_of_row,
    mean,
    outcomes,
    searched,
    versions,
    wilson,
)
from texture_simulation.scene import load_scene

Pair = tuple[str, str]
GRANTED = 0.05  # loss of accuracy that counts as none


def higher(claim: str, first: MethodResult, second: MethodResult) -> Finding:
    """Check that one method recognises more than another, slide by slide."""
    both = first.tested & second.tested
    gain = mean(first.right(both) - second.right(both))
    return Finding(claim, f'{percent(first.test)} against {percent(second.test)}', gain)


def higher_elsewhere(claim: str, first: MethodResult, second: MethodResult) -> Finding:
    """Check that more slides of one kind are recognised than of another kind."""
    gain = difference(first.right(), second.right())
    return Finding(claim, f'{percent(first.test)} against {percent(second.test)}', gain)


def lower_in(claim: str, outcome: MethodResult, condition: str) -> Finding:
    """Check that slides of one condition are recognised less often than all others."""
    here = outcome.conditions == condition
    loss = difference(outcome.right(~here), outcome.right(here))
    names = dict.fromkeys(outcome.conditions.tolist())
    accuracies = {name: outcome.right(outcome.conditions == name).mean() for name in names}
    reported = ', '.join(f'{name} {100 * value:.1f} %' for name, value in accuracies.items())
    return Finding(claim, reported, loss)


def kept_in(claim: str, outcome: MethodResult, changed: str, reference: str) -> Finding:
    """Check that slides of one condition are recognised at most five points less often than those of another."""
    here, before = (outcome.right(outcome.conditions == name) for name in (changed, reference))
    reported = f'{percent(wilson(here))} against {percent(wilson(before))}, {100 * GRANTED:g} points granted'
    return Finding(claim, reported, difference(here, before).less(-GRANTED))


def at_least(claim: str, outcome: MethodResult, limit: float) -> Finding:
    """Check that a figure is reached; undecided where the interval holds it."""
    return Finding(claim, percent(outcome.test), outcome.test.less(limit))


def most_errors(claim: str, outcome: MethodResult, pairs: Sequence[Pair]) -> Finding:
    """Check that surfaces of these pairs are confused more often than those of the next most confused pairs."""
    confused = sum((outcome.taken_for(*pair) for pair in pairs), start=np.zeros(1))
    others = [pair for pair in outcome.pairs() if frozenset(pair) not in {frozenset(one) for one in pairs}]
    rivals = sum((outcome.taken_for(*pair) for pair in others[: len(pairs)]), start=np.zeros(1))
    lead = mean(confused - rivals)
    named = ' and '.join('/'.join(pair) for pair in others[: len(pairs)])
    here = f'{_of_errors(confused, outcome)} of all errors; next: {named} with {_of_errors(rivals, outcome)}'
    return Finding(claim, here, lead)


def better_on(claim: str, outcome: MethodResult, surface: str) -> Finding:
    """Check that one surface is recognised more often than the others together."""
    here = outcome.codes == outcome.surfaces.index(surface)
    gain = difference(outcome.right(here), outcome.right(~here))
    reported = (
        f'{100 * outcome.right(here).mean():.1f} % right, of the others {100 * outcome.right(~here).mean():.1f} %'
    )
    return Finding(claim, reported, gain)


def seldom(claim: str, outcome: MethodResult, pair: Pair, limit: float) -> Finding:
    """Check that two surfaces are confused in fewer than a fraction of their slides."""
    of_pair = np.isin(outcome.codes, [outcome.surfaces.index(name) for name in pair])
    taken = wilson(outcome.taken_for(*pair, of=of_pair))
    below = Interval(limit - taken.value, limit - taken.high, limit - taken.low)
    return Finding(claim, f'{percent(taken)} of their slides, fewer than {100 * limit:g} % needed', below)


def more_spread(claim: str, first: MethodResult, second: MethodResult, alike: Sequence[Pair]) -> Finding:
    """Check that the first method confuses more slides with a dissimilar surface than the second."""
    novel = [one.wrong() - sum((one.taken_for(*pair) for pair in alike), start=np.zeros(1)) for one in (first, second)]
    more = mean(novel[0] - novel[1])
    reported = ' against '.join(f'{100 * part.mean():.1f} %' for part in novel)
    return Finding(claim, f'{reported} of the slides', more)


def built_in(why: str, *findings: Finding) -> Iterator[Finding]:
    """Yield findings that a choice of the scene makes so: they hold of any simulation made like this."""
    for finding in findings:
        yield replace(finding, built_in=why)


def percent(part: Interval) -> str:
    """Return a fraction with its interval."""
    return f'{100 * part.value:.1f} % ({100 * part.low:.1f} to {100 * part.high:.1f})'


def _of_errors(part: Array, outcome: MethodResult) -> str:
    wrong = outcome.wrong().sum()
    return f'{100 * part.sum() / wrong:.0f} %' if wrong else 'none'


ACCURACIES, ERRORS = ('test slides recognised (%)', 100.0), ('mean error (grades)', 1.0)


def figures_chart(
    panels: Mapping[str, Mapping[str, tuple[float | None, Interval]]],
    title: str,
    path: str | Path,
    drawn: str,
    unit: tuple[str, float] = ACCURACIES,
) -> Path:
    """Draw the figure of each method: the paper's as a cross, the simulated with its interval."""
    heights = [len(methods) + 1 for methods in panels.values()]
    with chart(path, (5.4, 1.2 + 0.32 * sum(heights)), title) as figure:
        rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
        for axes, (task, methods) in zip(rows, panels.items(), strict=True):
            _bars(axes, methods, drawn, unit[1])
            axes.set_title(task)
        rows[-1].set_xlabel(unit[0])
        figure.legend(*rows[0].get_legend_handles_labels(), loc='outside lower left', ncols=2)
    return Path(path)


def _bars(axes: Any, methods: Mapping[str, tuple[float | None, Interval]], drawn: str, scale: float) -> None:
    at = np.arange(len(methods))
    ours = [interval for _, interval in methods.values()]
    values = scale * np.array([interval.value for interval in ours])
    reach = scale * np.array([[i.value - i.low for i in ours], [i.high - i.value for i in ours]])
    axes.errorbar(values, at, xerr=reach, fmt='o', markersize=4, color=COLOURS[0], label=f'simulated: {drawn}')
    reported = [
        (scale * paper, place) for place, (paper, _) in zip(at, methods.values(), strict=True) if paper is not None
    ]
    axes.plot(*zip(*reported, strict=True), 'x', color=COLOURS[5], label='paper') if reported else None
    axes.set_yticks(at, [textwrap.fill(name, 26) for name in methods], linespacing=1.0)
    axes.set(ylim=(len(methods) - 0.4, -0.6))


TUNED = '-tuned'
SEARCHED = '; the first alone, whose slides for training the search was given'


def run(protocol: PaperProtocol, experiment: Experiment) -> ExperimentResult:
    """Reproduce a paper's experiment on simulated surfaces; with a search, by the recipes that it finds."""
    scene = load_scene(protocol.scene)
    tuned = searched(protocol, experiment) if experiment.tune else NONE
    found = outcomes(protocol, scene, experiment.seed, quick=experiment.quick, tuned=tuned)
    methods = {task.name: [m for m in task.methods if (task.name, m.name) in found] for task in protocol.tasks}
    trained_on = next(iter(found.values())).trained_on  # (n_splits, n_slides)
    here = f'; here {trained_on[0].sum()} of {trained_on.shape[1]} slides train'
    slides = {task: _slides(found[task, some[0].name]) for task, some in methods.items()}
    for (task, method), one in tuned.items():
        one.write(experiment.out / f'{method}{TUNED}-{task.replace(" ", "-")}-{experiment.seed}.yaml')
    return ExperimentResult(
        name=f'{protocol.name}{TUNED if tuned else ""}',
        measured=f'slides recognised, as in {protocol.paper}; intervals of 95 % over slides',
        data=(
            f"simulated: scene '{scene.name}' ({scene.about}); "
            f'slides a surface: {", ".join(f"{count} ({name})" for name, count in slides.items())}'
        ),
        split=f'{protocol.split}{SEARCHED if tuned else ""}{here if experiment.quick else ""}',
        numbers={
            'seed': experiment.seed,
            'digests': digests(protocol, tuned=experiment.tune),
            'difficulty': _difficulty(protocol, found, tuned=experiment.tune),
            'tasks': {
                task: {m.name: figures_of(m, found[task, m.name], by_condition=protocol.by_condition) for m in some}
                for task, some in methods.items()
            },
            'findings': [finding_as_json(finding) for finding in protocol.findings(found)],
            'tuning': {f'{task}, {method}': one.as_json() for (task, method), one in tuned.items()},
        },
    )


def digests(protocol: PaperProtocol, *, tuned: bool = False) -> dict[str, str]:
    """Return the digest of each row of figures, by task and method, as it is now, and the versions of the libraries."""
    rows = {
        f'{task.name}, {m.name}': digest_of_row(protocol, task, m, tuned=tuned)
        for task in protocol.tasks
        for m in task.methods
        if m.search or not tuned
    }
    return {**rows, 'versions': versions()}


def _slides(outcome: MethodResult) -> int:
    return len(outcome.codes) // len(outcome.surfaces)


def _difficulty(protocol: PaperProtocol, found: MethodResults, *, tuned: bool) -> dict[str, Any]:
    anchor = protocol.anchor
    if anchor is None:
        return {}
    outcome = found.get((anchor.task, anchor.method))
    where = anchor.experiment or protocol.name
    return {
        'set_by': f'{where}: {anchor.method}, {anchor.task}: {anchor.source}',
        'paper': anchor.test,
        'here': outcome.test.as_json() if outcome and where == f'{protocol.name}{TUNED if tuned else ""}' else None,
        'setting': anchor.setting,
        'shortfall': anchor.shortfall,
    }


def figures_of(method: Method, outcome: MethodResult, *, by_condition: bool = False) -> dict[str, Any]:
    """Return the figures of one method as an experiment's JSON holds them."""
    paper = {name: getattr(method.paper, name) for name in ('learning', 'test', 'unclassified')}
    sets = {name: {'test': wilson(right_of(outcome, of)).as_json()} for name, of in method.sets.items()}
    return {
        'paper': {name: value for name, value in paper.items() if value is not None},
        'learning': None if outcome.learning is None else round(outcome.learning, 4),
        'test': outcome.test.as_json(),
        'unclassified': round(outcome.unclassified, 4),
        **(_by_condition(outcome) if by_condition else {}),
        **({'sets': sets} if sets else {}),
        'train_s': round(outcome.train_s, 3),
        'surfaces': list(outcome.surfaces),
        'confusion_last_unclassified': np.round(outcome.confusion, 3).tolist(),
    }


def _by_condition(outcome: MethodResult) -> dict[str, Any]:
    """Return the accuracy under each condition in which slides were tested."""
    names = dict.fromkeys(outcome.conditions[outcome.tested].tolist())
    return {
        'conditions': {name: {'test': wilson(outcome.right(outcome.conditions == name)).as_json()} for name in names}
    }


def right_of(outcome: MethodResult, surfaces: Sequence[str]) -> Array:
    """Return how often each slide over some of the surfaces was recognised when held out, (n_tested,)."""
    return outcome.right(np.isin(outcome.codes, [outcome.surfaces.index(name) for name in surfaces]))


def finding_as_json(finding: Finding) -> dict[str, Any]:
    """Return a finding as an experiment's JSON holds it."""
    return {
        'claim': finding.claim,
        'here': finding.here,
        'interval': finding.interval.as_json(),
        'verdict': VERDICTS[finding.holds],
        **({'built_in': finding.built_in} if finding.built_in else {}),
        **({'by_texture': dict(finding.by_texture)} if finding.by_texture else {}),
    }


def charts_of(protocol: PaperProtocol, result: ExperimentResult, out: Path) -> Path:
    """Draw the figures of an experiment's JSON: the means over seeds with their intervals, where there are several."""
    panels: dict[str, dict[str, tuple[float | None, Interval]]] = {}
    for task in protocol.tasks:
        panels[task.name] = {}
        for method in task.methods:
            figures = result.numbers['tasks'][task.name][method.name]
            panels[task.name][method.name] = (method.paper.test, _interval(figures))
    path = out / f'experiment_{result.name.replace("-", "_")}.png'
    variables = ' with one set of variables' if any(m.search for task in protocol.tasks for m in task.methods) else ''
    about = f'{result.data.rpartition("; ")[2]}; {result.split}'
    title = f'{result.name}{variables}: slides recognised, paper and simulation; {about}'
    return figures_chart(panels, title, path, drawn(result.numbers))


def drawn(numbers: Mapping[str, Any]) -> str:
    """Return what the intervals of a chart are."""
    seeds = len(numbers.get('seeds', [0]))
    return f'mean of {seeds} seeds, 95 % interval' if seeds > 1 else 'one seed, 95 % interval over slides'


def _interval(figures: Mapping[str, Any]) -> Interval:
    return Interval(*figures.get('over_seeds', figures['test']))

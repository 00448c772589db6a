"""An experiment's result: the paper's table beside ours, and its findings one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.papers.claim_checks import percent
from texture_benchmarks.papers.experiment import Experiment, ExperimentResult
from texture_benchmarks.papers.interval import share
from texture_benchmarks.papers.method_result import MethodResult
from texture_benchmarks.papers.paper_charts import accuracy_chart, confusions_chart
from texture_benchmarks.papers.protocol import Finding, Method, MethodResults, PaperProtocol, RecognitionTask, Table
from texture_benchmarks.papers.recipe_digest import digest_of
from texture_benchmarks.papers.trial import NONE, TunedRecipes, outcomes, searched, without_ours
from texture_core.arrays import AnyArray
from texture_simulation.scene import load_scene

TUNED = '-tuned'
SEARCHED = '; recipes that were searched for: the first alone, whose slides for training the search was given'
VERDICTS = {True: 'holds', False: 'does not hold', None: 'not decided'}


def run(protocol: PaperProtocol, experiment: Experiment) -> ExperimentResult:
    """Rebuild a paper's experiment on simulated surfaces."""
    scene = load_scene(protocol.scene)
    protocol = without_ours(protocol) if experiment.papers_only else protocol
    tuned = searched(protocol, scene, experiment.seed, quick=experiment.quick) if experiment.tune else NONE
    found = outcomes(protocol, scene, experiment.seed, quick=experiment.quick, tuned=tuned, splits=experiment.splits)
    name = f'{protocol.name}{TUNED if tuned else ""}'
    checked = protocol.findings(found)
    slides = {task.name: _slides(found[task.name, task.methods[0].name]) for task in protocol.tasks}
    return ExperimentResult(
        name=name,
        measured=f'slides recognised, as in {protocol.paper}; intervals of 95 % over slides',
        data=(
            f"simulated: scene '{scene.name}' ({scene.about}); "
            f'slides a surface: {", ".join(f"{count} ({name})" for name, count in slides.items())}'
        ),
        split=f'{protocol.split}{SEARCHED if tuned else ""}',
        numbers={
            'seed': experiment.seed,
            'recipes': {m.recipe: digest_of(m.recipe) for task in protocol.tasks for m in task.methods},
            'difficulty': _difficulty(protocol, found),
            'tasks': {
                task.name: {
                    m.name: figures_of(m, found[task.name, m.name], by_condition=protocol.by_condition)
                    for m in task.methods
                }
                for task in protocol.tasks
            },
            'findings': [finding_as_json(finding) for finding in checked],
            'tuning': {f'{recipe}, {task}': one.figures() for (task, recipe), one in tuned.items()},
        },
        charts=_charts(protocol, found, name, experiment.out),
        lines=(*_lines(protocol, found, checked), *_tuning_lines(tuned, experiment.out)),
    )  # fmt: skip


def _slides(outcome: MethodResult) -> int:
    return len(outcome.codes) // len(outcome.surfaces)


def _difficulty(protocol: PaperProtocol, found: MethodResults) -> dict[str, Any]:
    anchor = protocol.anchor
    outcome = found.get((anchor.task, anchor.method)) if not anchor.experiment else None
    parts = {
        task: {'paper': test, 'here': found[task, anchor.method].test.as_json()} for task, test in anchor.parts.items()
    }
    return {
        'set_by': f'{anchor.experiment or protocol.name}: {anchor.method}, {anchor.task}: {anchor.source}',
        'paper': anchor.test,
        'here': outcome and outcome.test.as_json(),
        'setting': anchor.setting,
        'shortfall': anchor.shortfall,
        'parts': parts,
    }


def figures_of(method: Method, outcome: MethodResult, *, by_condition: bool = False) -> dict[str, Any]:
    """Return the figures of one method as an experiment's JSON holds them.

    Parameters
    ----------
    method
        With the paper's figures.
    outcome
        What came out.
    by_condition
        Whether the share recognised is given for each condition of the test, too.

    Returns
    -------
    dict
    """
    paper = {name: getattr(method.paper, name) for name in ('learning', 'test', 'unclassified')}
    return {
        'paper': {name: value for name, value in paper.items() if value is not None},
        'learning': None if outcome.learning is None else round(outcome.learning, 4),
        'test': outcome.test.as_json(),
        'unclassified': round(outcome.unclassified, 4),
        **(_by_condition(outcome) if by_condition else {}),
        'note': outcome.note,
        'train_s': round(outcome.train_s, 3),
        'surfaces': list(outcome.surfaces),
        'confusion_last_unclassified': np.round(outcome.confusion, 3).tolist(),
    }


def _by_condition(outcome: MethodResult) -> dict[str, Any]:
    """Return the share recognised under each condition in which slides were tested."""
    names = dict.fromkeys(outcome.conditions[outcome.tested].tolist())
    return {
        'conditions': {name: {'test': share(outcome.right(outcome.conditions == name)).as_json()} for name in names}
    }


def finding_as_json(finding: Finding) -> dict[str, Any]:
    """Return a finding as an experiment's JSON holds it."""
    return {
        'claim': finding.claim,
        'here': finding.here,
        'interval': finding.interval.as_json(),
        'verdict': VERDICTS[finding.holds],
        'reaches': finding.reaches,
    }


def _charts(protocol: PaperProtocol, found: MethodResults, name: str, out: Path) -> tuple[Path, ...]:
    stem = f'experiment_{name.replace("-", "_")}'
    panels = {
        task.name: {m.name: (m.paper.test, found[task.name, m.name].test) for m in task.methods}
        for task in protocol.tasks
    }
    charts = [accuracy_chart(panels, f'{name}: slides recognised, paper and simulation', out / f'{stem}.png')]
    several = len(protocol.tasks) > 1
    tables = {
        f'{method.name}, {task.name}' if several else method.name: (
            outcome.surfaces,
            shares_of(method.confusion),
            outcome.confusion,
        )
        for task in protocol.tasks
        for method in task.methods
        for outcome in [found[task.name, method.name]]
        if method.confusion is not None
    }
    if tables:
        path = out / f'{stem}_confusion.png'
        charts.append(confusions_chart(tables, f'{name}: confusion matrices, % of each surface', path))
    return tuple(charts)


def _lines(protocol: PaperProtocol, found: MethodResults, checked: Sequence[Finding]) -> Iterator[str]:
    yield (
        f'{"%":38}{"paper: learning":>16}{"test":>7}{"unclassified":>14}   '
        f'{"simulated: learning":>20}{"test":>22}{"unclassified":>14}'
    )
    for task in protocol.tasks:
        yield f'{task.name}:'
        for method in task.methods:
            yield _row(method, found[task.name, method.name])
    anchor = protocol.anchor
    where = f'{anchor.task} of {anchor.experiment}' if anchor.experiment else anchor.task
    yield (
        f'anchor, no finding: {anchor.setting}, set so that {anchor.method} ({where}) recognises '
        f'{100 * anchor.test:.1f} % ({anchor.source}){f"; {anchor.shortfall}" if anchor.shortfall else ""}'
    )
    yield 'findings of the paper:'
    for finding in checked:
        interval = finding.interval.times(100.0)
        yield f'  {VERDICTS[finding.holds]:14} {finding.claim}'
        reported = f'{interval.value:+.1f} points ({interval.low:+.1f} to {interval.high:+.1f})'
        yield f'  {"":14} here {finding.here}; decided by {reported}'
    for task in protocol.tasks:
        for method in task.methods:
            if method.confusion is not None:
                yield from _confusion_lines(task, method, found[task.name, method.name])


def _tuning_lines(tuned: TunedRecipes, out: Path) -> Iterator[str]:
    """Write the recipes that were searched for, and tell where they are and what they took."""
    for (task, recipe), one in tuned.items():
        path = one.write(out / f'{recipe}{TUNED}-{task.replace(" ", "-")}.yaml')
        facts = one.figures()
        yield (
            f'searched: {path}: training {100 * facts["learning"]:.1f} %, test {100 * facts["test"]:.1f} % within the '
            f'search; {facts["individuals_tried"]} individuals on {facts["scans"]} slides in {facts["seconds"]:.0f} s'
        )


def _row(method: Method, outcome: MethodResult) -> str:
    paper = method.paper
    return (
        f'  {method.name:36}{_share(paper.learning):>16}{_share(paper.test):>7}{_share(paper.unclassified):>14}   '
        f'{_share(outcome.learning):>20}{_plain(outcome):>22}{_share(outcome.unclassified):>14}'
    )


def _plain(outcome: MethodResult) -> str:
    return percent(outcome.test).replace(' %', '')


def _share(value: float | None) -> str:
    return '–' if value is None else f'{100 * value:.1f}'


def _confusion_lines(task: RecognitionTask, method: Method, outcome: MethodResult) -> Iterator[str]:
    yield f'{method.name}, {task.name}: % of each surface taken for each, paper | simulated (last: none)'
    width = max(map(len, outcome.surfaces))
    for name, theirs, ours in zip(outcome.surfaces, shares_of(method.confusion), outcome.confusion, strict=True):
        left, right = (' '.join(f'{100 * value:3.0f}' for value in row) for row in (theirs, ours))
        yield f'  {name:{width}}  {left}  | {right}'


def shares_of(table: Table | None) -> AnyArray:
    """Return a paper's table as shares of each row, with a last column for what is unclassified.

    Parameters
    ----------
    table
        Counts or per cents as printed; None if the paper has none.

    Returns
    -------
    (n_labels, n_labels + 1)
        0 to 1.
    """
    counts = np.asarray(table, dtype=np.float64)
    if counts.shape[1] == counts.shape[0]:
        counts = np.column_stack((counts, np.zeros(len(counts))))
    shares: AnyArray = counts / counts.sum(axis=1, keepdims=True)
    return shares

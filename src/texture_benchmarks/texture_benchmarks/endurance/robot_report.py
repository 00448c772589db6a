"""The report of the robot part of an endurance run: figures as JSON, a page and a chart."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.endurance.robot_record import RobotExploration, RobotRecord
from texture_benchmarks.endurance.robot_requirements import (
    ABORTED,
    FORCE_SHARE,
    LOST,
    REFUSED,
    SUCCESS,
    check_robots,
)
from texture_benchmarks.result import BenchmarkResult, machine
from texture_evaluation.charts import chart

NUMBERS = re.compile(r'-?\d[\w.:-]*')
PATHS = re.compile(r"'/[^']*'")
COLOURS = {SUCCESS: '#009E73', ABORTED: '#E69F00', REFUSED: '#56B4E9', LOST: '#D55E00'}
AGAIN = ', same request again'
CHART = 'endurance-robots.png'


def write_robots(record: RobotRecord, out: Path) -> list[Path]:
    """Write endurance-robots.md, .json and .png into a folder; return them."""
    page = out / 'endurance-robots.md'
    page.write_text('\n'.join(as_page(record)) + '\n', encoding='utf-8')
    return [page, write_figures(record, out), draw_robots(record, out / CHART)]


def write_figures(record: RobotRecord, out: Path) -> Path:
    """Write endurance-robots.json into a folder; return it."""
    return BenchmarkResult(
        name='endurance-robots',
        measured='explorations by robot, fault and ending, true mean force of the successes as a share of the wanted '
        'force, and what every exit of an explorer leaves behind',
        data='emulated UR, emulated hand, rails and simulated arm; faults injected in turn',
        split='none: one run, nothing is trained',
        numbers=as_json(record),
        charts=(out / CHART,),
    ).write(out)


def as_json(record: RobotRecord) -> dict[str, Any]:
    """Return the figures, and each exploration and exit with times from the beginning of the run."""
    return {
        'seed': record.seed,
        'duration_s': record.end_s - record.begin_s,
        'sessions': record.sessions,
        'parameters': record.parameters,
        'load_median_max': [float(np.median(record.load)), max(record.load)] if record.load else None,
        'requirements': [asdict(item) for item in check_robots(record)],
        'endings': [dict(zip(HEAD, row, strict=True)) for row in rows(record)],
        'messages': _messages(record),
        'explorations': [_since(record, asdict(item)) for item in record.explorations],
        'exits': [_since(record, asdict(item)) for item in record.exits],
    }


HEAD = ('robot', 'fault', 'injected', SUCCESS, ABORTED, REFUSED, LOST, 'true mean force of successes / asked')


def rows(record: RobotRecord) -> list[tuple[str, ...]]:
    """Return a row for each robot and fault: how the explorations ended, and the span of the true force."""
    groups: dict[tuple[str, str], list[RobotExploration]] = {}
    for item in record.explorations:
        groups.setdefault((item.rig, item.fault + (AGAIN if item.attempt else '')), []).append(item)
    return [_row(*names, items) for names, items in sorted(groups.items())]


def as_page(record: RobotRecord) -> list[str]:
    """Return the lines of the page."""
    minutes = (record.end_s - record.begin_s) / 60
    load = f'{np.median(record.load):.1f} in the median, {max(record.load):.1f} at most' if record.load else 'unknown'
    return [
        '# Endurance of the emulated robots',
        '',
        f'{minutes:.0f} minutes, {record.sessions} lives of the explorer, {len(record.explorations)} explorations; '
        f'seed {record.seed}; {machine()}; load average {load}.',
        '',
        *_table(
            ('asked', 'seen', 'holds'),
            [(item.asked, item.seen, 'yes' if item.holds else '**no**') for item in check_robots(record)],
        ),
        '',
        *_table(HEAD, rows(record)),
        '',
        *_table(('ended', 'times'), [(text, str(times)) for text, times in _messages(record).items()]),
    ]


def draw_robots(record: RobotRecord, path: Path) -> Path:
    """Draw the true force of each slide by what was asked, by robot, and how long each exploration took."""
    rigs = list(dict.fromkeys(item.rig for item in record.explorations))
    with chart(path, (10.0, 2.6 * len(rigs) + 1.0)) as figure:
        panels = figure.subplots(len(rigs), 1, sharex=True, squeeze=False)[:, 0]
        for panel, rig in zip(panels, rigs, strict=True):
            _force_panel(panel, record, rig)
        if rigs:
            panels[-1].set_xlabel('time since the start (min)')
    return path


def _force_panel(axes: Any, record: RobotRecord, rig: str) -> None:
    axes.axhspan(1 - FORCE_SHARE, 1 + FORCE_SHARE, color='black', alpha=0.08)
    for ending, colour in COLOURS.items():
        items = [item for item in record.explorations if (item.rig, item.ending) == (rig, ending)]
        known = [item for item in items if math.isfinite(item.force_ratio)]
        minutes = [(item.begin_s - record.begin_s) / 60 for item in known]
        marker = '.' if ending == SUCCESS else 'x'
        axes.plot(minutes, [item.force_ratio for item in known], marker, color=colour, label=f'{ending} ({len(items)})')
    axes.set(title=rig, ylabel='true mean force / asked', ylim=(0.0, 1.5))
    axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5))


def _row(rig: str, fault: str, items: Sequence[RobotExploration]) -> tuple[str, ...]:
    counts = Counter(item.ending for item in items)
    ratios = [item.force_ratio for item in items if item.ending == SUCCESS]
    span = f'{min(ratios):.2f} to {max(ratios):.2f}' if ratios else ''
    injected = '' if fault.endswith(AGAIN) else str(sum(item.injected for item in items))
    return (rig, fault, injected, *(str(counts[name]) for name in (SUCCESS, ABORTED, REFUSED, LOST)), span)


def _messages(record: RobotRecord) -> dict[str, int]:
    texts = Counter(
        f'{item.rig}: {item.ending}: {NUMBERS.sub("…", PATHS.sub("…", item.message))}'
        for item in record.explorations
        if item.ending != SUCCESS
    )
    return dict(texts.most_common())


def _table(head: Sequence[str], lines: Iterable[Sequence[str]]) -> list[str]:
    cells = [head, ['---'] * len(head), *lines]
    return ['| ' + ' | '.join(cell.replace('|', '/').replace('\n', ' ') for cell in line) + ' |' for line in cells]


def _since(record: RobotRecord, row: dict[str, Any]) -> dict[str, Any]:
    """Return a row with its times counted from the beginning, numbers rounded, and what is not known as None."""
    timed = {'begin_s', 'end_s', 'time_s'}
    return {name: _rounded(value - record.begin_s if name in timed else value) for name, value in row.items()}


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(item) for name, item in value.items()}
    if isinstance(value, float):
        return round(value, 4) if math.isfinite(value) else None
    return value

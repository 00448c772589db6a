"""The chart of an endurance run: memory and computing time of each node, and how explorations ended."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.endurance.endurance_record import ABORTED, LOST, REFUSED, SUCCESS, EnduranceRecord
from texture_benchmarks.endurance.process_load import by_process, cpu_shares
from texture_core.arrays import Array
from texture_evaluation.charts import COLOURS, chart

MIB = 2**20
SMOOTHED = 6  # looks
ENDINGS = {SUCCESS: '#009E73', ABORTED: '#E69F00', REFUSED: '#56B4E9', LOST: '#D55E00'}


def draw(record: EnduranceRecord, path: Path) -> Path:
    """Draw the run over its minutes."""
    nodes = list(dict.fromkeys(usage.node for usage in record.usages))
    colours = dict(zip(nodes, COLOURS, strict=False))
    with chart(path, (10.0, 9.0)) as figure:
        memory, computing, endings = figure.subplots(3, 1, sharex=True, height_ratios=(2, 2, 2))
        _memory(memory, record, colours)
        _computing(computing, record, colours)
        _endings(endings, record)
        endings.set_xlabel('time since the start (min)')
    return path


def _memory(axes: Any, record: EnduranceRecord, colours: dict[str, str]) -> None:
    seen = set()
    for (node, _), usages in by_process(record.usages).items():
        label = None if node in seen else node
        seen.add(node)
        minutes = [(usage.time_s - record.begin_s) / 60 for usage in usages]
        axes.plot(
            minutes,
            [usage.resident_bytes / MIB for usage in usages],
            color=colours.get(node),
            label=label,
            linewidth=1.2,
        )
        axes.plot(minutes[0], usages[0].resident_bytes / MIB, '|', color=colours.get(node))
    axes.set(
        ylabel='resident memory (MiB)', title='1. Memory of each process; a new line begins where a node was killed'
    )
    axes.set_ylim(bottom=0)
    axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5))


def _computing(axes: Any, record: EnduranceRecord, colours: dict[str, str]) -> None:
    for node, (times_s, shares) in cpu_shares(record.usages).items():
        axes.plot(*_means(record, times_s, 100 * shares), color=colours.get(node), label=node)
    if record.machine_speeds:
        times_s, works_s = np.array(
            [(machine_speed.time_s, machine_speed.work_s) for machine_speed in record.machine_speeds]
        ).T
        lines = axes.plot(*_means(record, times_s, 1e3 * works_s), color='grey', linestyle=':', label='same work (ms)')
        axes.legend(handles=lines, loc='center left', bbox_to_anchor=(1.0, 0.5))
    axes.set(ylabel='computing time (% of a core)', title='2. Computing time of each node, means of a minute')
    axes.set_ylim(bottom=0)


def _means(record: EnduranceRecord, times_s: Array, values: Array) -> tuple[Array, Array]:
    """Return minutes and means of a minute."""
    width = min(SMOOTHED, len(values))
    return (times_s[width - 1 :] - record.begin_s) / 60, np.convolve(values, np.full(width, 1 / width), mode='valid')


def _endings(axes: Any, record: EnduranceRecord) -> None:
    for ending, colour in ENDINGS.items():
        found = [item for item in record.explored if item.ending == ending]
        minutes = [(item.end_s - record.begin_s) / 60 for item in found]
        axes.plot(minutes, [item.duration_s for item in found], '.', color=colour, label=f'{ending} ({len(found)})')
    for item in record.fault_events:
        axes.axvline((item.begin_s - record.begin_s) / 60, ymax=0.05, color='black', linewidth=0.8)
    axes.set(ylabel='time it took (s)', yscale='log', title='3. Each exploration and how it ended; ticks below: faults')
    axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5))

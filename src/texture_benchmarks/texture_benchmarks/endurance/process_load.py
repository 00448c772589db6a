"""Memory and processor time of processes over an endurance run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from texture_benchmarks.endurance.endurance_record import EnduranceRecord
from texture_benchmarks.endurance.usage import ProcessUsage
from texture_core.arrays import Array

WARM_UP_S = 300.0  # of a process, before its memory is evaluated
STRETCH_S = 120.0  # medians over so long are compared, and a life must have two of them after the warm-up


@dataclass(frozen=True)
class ProcessMemory:
    """The memory of one process after its warm-up and at its end, bytes: its own, and all that is resident."""

    node: str
    pid: int
    age_s: float
    own_bytes: tuple[float, float]
    resident_bytes: tuple[float, float]

    @property
    def growth(self) -> float:
        """Growth of its resident memory, as a share."""
        return self.resident_bytes[1] / self.resident_bytes[0] - 1

    @property
    def own_growth(self) -> float:
        """The same of what is its own."""
        return self.own_bytes[1] / self.own_bytes[0] - 1


def by_process(usages: Sequence[ProcessUsage]) -> Mapping[tuple[str, int], list[ProcessUsage]]:
    """Return what each process used, in the order of time."""
    found: dict[tuple[str, int], list[ProcessUsage]] = {}
    for usage in usages:
        found.setdefault((usage.node, usage.pid), []).append(usage)
    return found


def lives(usages: Sequence[ProcessUsage]) -> list[ProcessMemory]:
    """Return the memory of each process that lived long enough to be evaluated."""
    found = []
    for (node, pid), own in by_process(usages).items():
        born_s, died_s = own[0].time_s, own[-1].time_s
        if died_s - born_s < WARM_UP_S + 2 * STRETCH_S:
            continue
        early = [usage for usage in own if born_s + WARM_UP_S <= usage.time_s <= born_s + WARM_UP_S + STRETCH_S]
        late = [usage for usage in own if usage.time_s >= died_s - STRETCH_S]
        pairs = [
            (float(np.median([pick(usage) for usage in early])), float(np.median([pick(usage) for usage in late])))
            for pick in (_own, _resident)
        ]
        found.append(ProcessMemory(node, pid, died_s - born_s, pairs[0], pairs[1]))
    return found


def cpu_shares(usages: Sequence[ProcessUsage]) -> Mapping[str, tuple[Array, Array]]:
    """Return of each node times (s) and shares of a core used between two looks at the same process.

    Parameters
    ----------
    usages
        What each process used, in the order of time.

    Returns
    -------
    mapping
        Node → (n,) s and (n,) shares, 0 to 1 of a core.
    """
    points: dict[str, list[tuple[float, float]]] = {}
    for (node, _), own in by_process(usages).items():
        for before, after in pairwise(own):
            share = (after.cpu_s - before.cpu_s) / max(1e-3, after.time_s - before.time_s)
            points.setdefault(node, []).append((after.time_s, share))
    return {node: (np.array(sorted(pairs))[:, 0], np.array(sorted(pairs))[:, 1]) for node, pairs in points.items()}


def cpu_change(record: EnduranceRecord) -> Mapping[str, tuple[float, float]]:
    """Return of each node the median share of a core in the first and in the last third after the warm-up.

    Both as they would be had the machine been as quick as in its median of the run (`work_change`).
    """
    works_s, usual_s = (
        work_change(record),
        float(np.median([machine_speed.work_s for machine_speed in record.machine_speeds] or [1.0])),
    )
    early_s, late_s = works_s or (usual_s, usual_s)
    changes = {node: _early_and_late(record, *shares) for node, shares in cpu_shares(record.usages).items()}
    return {node: (pair[0] * usual_s / early_s, pair[1] * usual_s / late_s) for node, pair in changes.items() if pair}


def work_change(record: EnduranceRecord) -> tuple[float, float] | None:
    """Return how long the fixed piece of work took in the first and in the last third after the warm-up, s, medians."""
    machine_speeds = np.array(
        [(machine_speed.time_s, machine_speed.work_s) for machine_speed in record.machine_speeds]
    ).reshape(-1, 2)
    return _early_and_late(record, machine_speeds[:, 0], machine_speeds[:, 1])


def _early_and_late(record: EnduranceRecord, times_s: Array, values: Array) -> tuple[float, float] | None:
    """Return the medians in the first and in the last third after the warm-up; None if one of them has no values."""
    begin_s = min(record.begin_s + WARM_UP_S, (record.begin_s + record.end_s) / 2)
    third_s = (record.end_s - begin_s) / 3
    early = values[(times_s >= begin_s) & (times_s < begin_s + third_s)]
    late = values[times_s >= record.end_s - third_s]
    return (float(np.median(early)), float(np.median(late))) if len(early) and len(late) else None


def _own(usage: ProcessUsage) -> float:
    return usage.own_bytes


def _resident(usage: ProcessUsage) -> float:
    return usage.resident_bytes

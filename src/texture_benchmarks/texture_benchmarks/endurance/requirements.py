"""What is asked of an endurance run, and what was seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from texture_benchmarks.endurance.endurance_record import EnduranceRecord
from texture_benchmarks.endurance.usage import ProcessUsage
from texture_core.arrays import Array

WARM_UP_S = 300.0  # of a process, before its memory is evaluated
STRETCH_S = 120.0  # medians over so long are compared, and a life must have two of them after the warm-up
GROWTH = 0.01
HUNG_S = 60.0
CPU_SHARE, CPU_POINTS = 0.1, 0.01  # flat: within 10 % of itself, or within 1 % of a core
DRIFT_S = 0.3  # of what a device that was frozen keeps and sends late, 0.25 s, nothing may be taken for new


@dataclass(frozen=True)
class RequirementResult:
    """One thing asked, what was seen, and whether it holds."""

    asked: str
    seen: str
    holds: bool


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


def unrecorded_samples(record: EnduranceRecord) -> int:
    """Return how many samples the index of the stream shows as lost that no node has counted."""
    counted = max(
        record.totals.get('sensor', {}).get('lost', 0),
        record.totals.get('feature_extractor', {}).get('lost_samples', 0),
    )
    return max(0, record.signal.gaps - counted)


def unexplained_vectors(record: EnduranceRecord) -> int:
    """Return how many feature vectors were not answered although the classifier was not killed meanwhile."""
    fault_events = {item.exploration_id: item.faults for item in record.explored}
    return sum(
        count
        for name, count in record.unanswered.items()
        if not any('classifier' in fault for fault in fault_events.get(name, ('classifier',)))
    )


def _own(usage: ProcessUsage) -> float:
    return usage.own_bytes


def _resident(usage: ProcessUsage) -> float:
    return usage.resident_bytes


def _every_exploration_ends(record: EnduranceRecord) -> RequirementResult:
    longest = max((item.duration_s for item in record.explored), default=0.0)
    hung = sum(item.duration_s > HUNG_S for item in record.explored)
    return RequirementResult(
        'every exploration ends', f'{hung} of {len(record.explored)} hung; the longest took {longest:.1f} s', not hung
    )


def _every_abort_is_named(record: EnduranceRecord) -> RequirementResult:
    nameless = [item for item in record.explored if item.ending != 'success' and not item.message]
    unexplained = [item for item in record.explored if not item.explained]
    seen = (
        f'{len(nameless)} without a reason; {len(unexplained)} ended otherwise than asked while no fault was injected'
    )
    return RequirementResult(
        'every abort is named, and none comes without a fault', seen, not nameless and not unexplained
    )


def _all_faults_pass(record: EnduranceRecord) -> RequirementResult:
    over = [item for item in record.fault_events if math.isfinite(item.end_s)]
    late = [item for item in over if math.isnan(item.back_s)]
    waited = [item.recovery_s for item in over if math.isfinite(item.back_s)]
    seen = f'{len(late)} of {len(over)} did not; the slowest recovery took {max(waited, default=0.0):.1f} s'
    return RequirementResult('after every fault all nodes report and samples flow again', seen, not late)


def _nobody_dies_alone(record: EnduranceRecord) -> RequirementResult:
    kills = sum(item.name.endswith('killed') for item in record.fault_events)
    return RequirementResult(
        'no process ends but those that were killed',
        f'{len(record.ends)} ended, {kills} killed',
        len(record.ends) == kills,
    )


def _memory_is_flat(record: EnduranceRecord) -> RequirementResult:
    found = lives(record.usages)
    worst = max(found, key=lambda life: life.growth, default=None)
    if worst is None:
        return RequirementResult('memory of each process grows < 1 %', 'no process lived long enough to tell', False)
    seen = (
        f'most: {worst.node}, {worst.growth:+.2%} in {worst.age_s / 60:.0f} min ({len(found)} processes that lived '
        'long enough, after 5 min of warm-up)'
    )
    return RequirementResult('memory of each process grows < 1 %', seen, worst.growth < GROWTH)


def _cpu_is_flat(record: EnduranceRecord) -> RequirementResult:
    changes = cpu_change(record)
    steep = [n for n, (a, b) in changes.items() if b - a > max(CPU_POINTS, CPU_SHARE * a)]
    all_first, all_last = (sum(pair[i] for pair in changes.values()) for i in (0, 1))
    seen = f'all together {all_first:.1%} of a core early, {all_last:.1%} late; rose: {", ".join(steep) or "none"}'
    works_s = work_change(record)
    if works_s:
        early_ms, late_ms = (1e3 * work_s for work_s in works_s)
        seen += f'; the same work took {early_ms:.1f} ms early, {late_ms:.1f} ms late, which is accounted for'
    return RequirementResult('computing time is flat', seen, not steep)


def _samples_are_accounted_for(record: EnduranceRecord) -> RequirementResult:
    missing, book = unrecorded_samples(record), record.signal
    seen = (
        f'{book.gaps} of {book.samples + book.gaps} samples lost by the index, {missing} of them not counted on '
        f'/diagnostics; index and time differ by {book.drift_s * 1e3:.0f} ms at most'
    )
    return RequirementResult('every lost sample is counted', seen, not missing and book.drift_s < DRIFT_S)


def _vectors_are_answered(record: EnduranceRecord) -> RequirementResult:
    missing, unexplained = sum(record.unanswered.values()), unexplained_vectors(record)
    counted = record.totals.get('classifier', {}).get('lost_vectors', 0)
    seen = (
        f'{missing} of {record.vectors} without an estimate, {unexplained} while the classifier ran, which counted '
        f'{counted} as lost'
    )
    return RequirementResult('every feature vector is answered or counted', seen, unexplained <= counted)


CHECKS: Sequence[Callable[[EnduranceRecord], RequirementResult]] = (
    _every_exploration_ends,
    _every_abort_is_named,
    _all_faults_pass,
    _nobody_dies_alone,
    _memory_is_flat,
    _cpu_is_flat,
    _samples_are_accounted_for,
    _vectors_are_answered,
)


def check_requirements(record: EnduranceRecord) -> list[RequirementResult]:
    """Return what was asked and seen."""
    found = [check(record) for check in CHECKS]
    return [
        RequirementResult('the run goes to its end', record.ended_early_by or 'it did', not record.ended_early_by),
        *found,
    ]

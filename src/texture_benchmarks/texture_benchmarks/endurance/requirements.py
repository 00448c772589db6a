"""What is asked of an endurance run, and what was seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from texture_benchmarks.endurance.endurance_record import EnduranceRecord
from texture_benchmarks.endurance.process_load import cpu_change, lives, work_change

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

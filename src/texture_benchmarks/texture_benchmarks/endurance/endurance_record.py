"""What happened in an endurance run: explorations, faults, and what processes used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from texture_benchmarks.endurance.accounting import SampleAccount
from texture_benchmarks.endurance.machine_speed import MachineSpeed
from texture_benchmarks.endurance.usage import ProcessUsage

SUCCESS, ABORTED, REFUSED, LOST = 'success', 'aborted', 'refused', 'lost'
# A fault may still be measured for so long: connections are made again, queues are emptied.
RECOVERY_S = 5.0


@dataclass(frozen=True)
class ExplorationRecord:
    """How one exploration went.

    Parameters
    ----------
    begin_s, end_s
        When it was asked for, and answered (monotonic clock).
    motion, surface
        What was asked for.
    ending
        'success', 'aborted' (begun and ended early), 'refused' (not begun) or 'lost' (the explorer went away).
    message
        Why, in the words of the explorer or the operator.
    wanted
        What was to be expected if no fault was injected: 'success', 'aborted' for one that was stopped, or 'refused'.
    exploration_id
        Its name; '' if it was refused or lost.
    label, final
        What was recognised, and whether that was the last word.
    faults
        Faults that were in force or had just ended.
    """

    begin_s: float
    end_s: float
    motion: str
    surface: str
    ending: str
    message: str
    wanted: str
    exploration_id: str = ''
    label: str = ''
    final: bool = False
    faults: tuple[str, ...] = ()

    @property
    def duration_s(self) -> float:
        """How long the operator waited."""
        return self.end_s - self.begin_s

    @property
    def explained(self) -> bool:
        """Whether it ended as wanted, or a fault tells why not."""
        return self.ending in (SUCCESS, self.wanted) or bool(self.faults)


@dataclass(frozen=True)
class FaultEvent:
    """An injected fault.

    Parameters
    ----------
    name
        Of the fault.
    begin_s, end_s
        While it was in force (monotonic clock).
    back_s
        When all nodes reported again and samples arrived; NaN if they did not in time, inf if the run ended before.
    detail
        Its strength or whom it was injected.
    """

    name: str
    begin_s: float
    end_s: float
    back_s: float
    detail: str

    @property
    def recovery_s(self) -> float:
        """How long it took from the end of the fault until all worked again; from its beginning for a killed node."""
        return self.back_s - self.end_s


def in_force(fault_events: Sequence[FaultEvent], begin_s: float, end_s: float) -> tuple[str, ...]:
    """Return the faults that were measured in a stretch of time.

    Parameters
    ----------
    fault_events
        Faults with their times.
    begin_s, end_s
        Limits of the stretch, on the clock of the faults.

    Returns
    -------
    tuple of str
        Name of each fault.
    """
    return tuple(
        item.name
        for item in fault_events
        if item.begin_s <= end_s and begin_s <= max(item.end_s, item.back_s) + RECOVERY_S
    )


@dataclass(frozen=True)
class EnduranceRecord:
    """A whole run.

    Parameters
    ----------
    begin_s, end_s
        When it began and ended (monotonic clock).
    seed
        Of orders and faults.
    explored, fault_events, usages, machine_speeds
        What was explored, what was injected, what processes used, and how quick the machine was, in the order of time.
    totals
        Sum of each counter on /diagnostics over all lives of each node.
    signal
        Books about samples.
    vectors, unanswered
        Feature vectors sent, and those without an estimate by exploration.
    said
        Warnings and errors: node, level, sentence without its numbers, how often.
    ends
        What the launcher said about processes that ended.
    ended_early_by
        What ended the run early; '' if nothing did.
    """

    begin_s: float
    end_s: float
    seed: int
    explored: Sequence[ExplorationRecord]
    fault_events: Sequence[FaultEvent]
    usages: Sequence[ProcessUsage]
    machine_speeds: Sequence[MachineSpeed]
    totals: Mapping[str, Mapping[str, int]]
    signal: SampleAccount
    vectors: int
    unanswered: Mapping[str, int]
    said: Sequence[tuple[str, str, str, int]]
    ends: Sequence[str]
    ended_early_by: str

"""What happened in the robot part of an endurance run: explorations with their true force, exits of the explorer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from texture_benchmarks.endurance.true_contact import NO_CONTACT, TrueContact


@dataclass(frozen=True)
class RobotExploration:
    """How one exploration of an emulated robot went.

    Parameters
    ----------
    rig, fault, detail
        On which robot, and what was injected; `detail` is its strength.
    injected
        Whether the fault was injected: a slide may have ended before.
    attempt
        0: the fault belongs to this one; 1, 2, …: the same request again after the recovery.
    begin_s, end_s
        When it was asked for, and answered (monotonic clock).
    motion, force_n
        What was asked for.
    ending, message
        'success', 'aborted', 'refused', 'lost' or 'hung'; the sentence of the explorer.
    contact
        What the finger truly did.
    lost_contact_s
        The explorer's own parameter: for longer the contact may not be lost.
    remedy
        What was answered to the request to recover or reboot that came before a further attempt.
    taken_over
        What became of a program of somebody else that was playing, if it was not left alone.
    """

    rig: str
    fault: str
    detail: str
    injected: bool
    attempt: int
    begin_s: float
    end_s: float
    motion: str
    force_n: float
    ending: str
    message: str
    contact: TrueContact = NO_CONTACT
    lost_contact_s: float = 0.1
    remedy: str = ''
    taken_over: str = ''

    @property
    def duration_s(self) -> float:
        """How long the operator waited."""
        return self.end_s - self.begin_s

    @property
    def force_ratio(self) -> float:
        """True mean force of the slide by the force that was asked for."""
        return self.contact.mean_force_n / self.force_n


@dataclass(frozen=True)
class ExplorerExit:
    """The end of an explorer process.

    Parameters
    ----------
    rig, how, time_s
        On which robot, by which signal, and when (monotonic clock).
    exit_s
        How long the process took to end.
    powered
        Motors that still had torque when that should have been over, or the robot if it still moved; '' if neither.
    """

    rig: str
    how: str
    time_s: float
    exit_s: float
    powered: str = ''


@dataclass(frozen=True)
class RobotRecord:
    """The robot part of a run.

    Parameters
    ----------
    begin_s, end_s
        When it began and ended (monotonic clock).
    seed
        Of requests and faults.
    sessions
        How many lives of the explorer there were.
    explorations, exits
        In the order of time.
    parameters
        Parameters of the explorer that differ from their defaults, by rig.
    load
        Load averages of the machine (processes that wanted to run, over a minute), one a session.
    ended_early_by
        What ended it early; '' if nothing did.
    """

    begin_s: float
    end_s: float
    seed: int
    sessions: int
    explorations: Sequence[RobotExploration]
    exits: Sequence[ExplorerExit]
    parameters: dict[str, dict[str, object]]
    load: Sequence[float]
    ended_early_by: str = ''

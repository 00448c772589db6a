"""What is required of the robot part of an endurance run, and what was measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby

from texture_benchmarks.endurance.requirements import RequirementResult
from texture_benchmarks.endurance.robot_record import RobotExploration, RobotRecord

SUCCESS, ABORTED, REFUSED, LOST, HUNG = 'success', 'aborted', 'refused', 'lost', 'hung'
FORCE_SHARE = 0.3  # the true mean force of a success may differ from the asked one by this share
# The explorer sees the force later than it is, by one state of the arm and one of its own steps.
LOSS_MARGIN_S = 0.02
MIN_OBSERVED = 0.8  # share of a slide of which the true force must be known
DEADLINE_S = 60.0
EXIT_DEADLINE_S = 20.0


def force_is_kept(item: RobotExploration) -> bool:
    """Return whether the true mean force of the slide was within ±30 % of what was asked; NaN is not."""
    return abs(item.force_ratio - 1) <= FORCE_SHARE


def contact_is_kept(item: RobotExploration) -> bool:
    """Return whether the contact was never lost for longer than the explorer's own parameter allows."""
    return item.contact.longest_loss_s <= item.lost_contact_s + LOSS_MARGIN_S


def is_named(item: RobotExploration) -> bool:
    """Return whether the message is a sentence: several words."""
    return len(item.message.split()) >= 3


def _successes(record: RobotRecord) -> list[RobotExploration]:
    return [item for item in record.explorations if item.ending == SUCCESS]


def _each_ends(record: RobotRecord) -> RequirementResult:
    hung = [item for item in record.explorations if item.ending == HUNG or item.duration_s > DEADLINE_S]
    killed = [item for item in record.explorations if item.ending == LOST]
    strange = [item for item in killed if item.fault != 'explorer killed']
    nameless = [item for item in record.explorations if item.ending != SUCCESS and not is_named(item)]
    longest_s = max((item.duration_s for item in record.explorations), default=0.0)
    seen = (
        f'{len(hung)} of {len(record.explorations)} hung, the longest took {longest_s:.1f} s; {len(nameless)} ended '
        f'without a sentence; {len(killed)} were lost with an explorer that was killed, {len(strange)} otherwise'
    )
    holds = bool(record.explorations) and not hung and not nameless and not strange
    return RequirementResult('robots: every exploration ends as a success or as an abort with a sentence', seen, holds)


def _true_force_is_kept(record: RobotRecord) -> RequirementResult:
    ratios = [item.force_ratio for item in _successes(record)]
    wrong = [item for item in _successes(record) if not force_is_kept(item)]
    span = f'from {min(ratios):.2f} to {max(ratios):.2f} of what was asked' if ratios else 'no success'
    return RequirementResult(
        'robots: no success with a true mean force in the slide beyond ±30 % of what was asked',
        f'{len(wrong)} of {len(ratios)}; {span}',
        bool(ratios) and not wrong,
    )


def _contact_is_kept(record: RobotRecord) -> RequirementResult:
    good = _successes(record)
    wrong = [item for item in good if not contact_is_kept(item)]
    longest_s = max((item.contact.longest_loss_s for item in good), default=0.0)
    return RequirementResult(
        "robots: no success with contact lost for longer than 'lost_contact_s'",
        f'{len(wrong)} of {len(good)}; at most {1e3 * longest_s:.0f} ms',
        bool(good) and not wrong,
    )


def _truth_is_known(record: RobotRecord) -> RequirementResult:
    shares = [item.contact.observed_s / max(1e-9, item.contact.slide_s) for item in _successes(record)]
    unknown = sum(not share >= MIN_OBSERVED for share in shares)
    return RequirementResult(
        'robots: the true force is known for at least 80 % of the slide of each success',
        f'{unknown} of {len(shares)} less; the least {min(shares, default=0.0):.0%}',
        not unknown,
    )


def _another_program_is_respected(record: RobotRecord) -> RequirementResult:
    met = [item for item in record.explorations if item.fault == 'another program at connect' and item.attempt == 0]
    wrong = [item for item in met if item.taken_over or item.ending != REFUSED or 'another program' not in item.message]
    return RequirementResult(
        'UR: another program that plays is named, and nothing is taken over',
        f'{len(wrong)} of {len(met)} otherwise',
        not wrong,
    )


def _each_robot_explores_again(record: RobotRecord) -> RequirementResult:
    series = [list(items) for _, items in groupby(record.explorations, key=_series_key(record))]
    tried = [items for items in series if items[-1].attempt > 0]
    gave_up = [items[-1] for items in tried if items[-1].ending != SUCCESS]
    most = max((items[-1].attempt for items in tried), default=0)
    return RequirementResult(
        'robots: after each fault and its remedy the same request succeeds within three attempts',
        f'{len(gave_up)} of {len(tried)} did not; at most {most} attempts',
        not gave_up,
    )


def _series_key(record: RobotRecord) -> Callable[[RobotExploration], int]:
    """Return a key that is the same for an exploration and the attempts that follow it."""
    number = iter(range(len(record.explorations) + 1))
    current = [0]

    def key(item: RobotExploration) -> int:
        if item.attempt == 0:
            current[0] = next(number)
        return current[0]

    return key


def _exits_leave_nothing(record: RobotRecord) -> RequirementResult:
    powered = [item for item in record.exits if item.powered]
    slow = [item for item in record.exits if item.exit_s > EXIT_DEADLINE_S]
    longest_s = max((item.exit_s for item in record.exits), default=0.0)
    return RequirementResult(
        'robots: after each exit of the explorer no motor has torque and nothing moves',
        f'{len(powered)} of {len(record.exits)} otherwise; {len(slow)} did not end, the slowest took {longest_s:.1f} s',
        bool(record.exits) and not powered and not slow,
    )


CHECKS: Sequence[Callable[[RobotRecord], RequirementResult]] = (
    _each_ends,
    _true_force_is_kept,
    _contact_is_kept,
    _truth_is_known,
    _another_program_is_respected,
    _each_robot_explores_again,
    _exits_leave_nothing,
)


def check_robots(record: RobotRecord) -> list[RequirementResult]:
    """Return what was required and measured."""
    early = record.ended_early_by
    to_its_end = RequirementResult('robots: the run goes to its end', early or 'it did', not early)
    return [to_its_end, *(check(record) for check in CHECKS)]

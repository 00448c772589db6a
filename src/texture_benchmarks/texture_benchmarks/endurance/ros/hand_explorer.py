"""The explorer node with two errors of its program that a signal triggers, once each, in a Dynamixel hand.

SIGUSR1: the next cycle of the bus thread raises an exception. SIGUSR2: the next force goal is NaN.
"""

from __future__ import annotations

import math
import signal
from dataclasses import replace
from typing import Any

from texture_exploration.arms.protocol import ArmCommand
from texture_exploration.hands.dynamixel import DynamixelFinger, DynamixelHand
from texture_exploration.nodes import explorer

EXCEPTION, NAN_FORCE = signal.SIGUSR1, signal.SIGUSR2


class InjectedError(RuntimeError):
    """Raised in the bus thread on purpose."""


def arm() -> None:
    """Let the signals trigger the errors from now on."""
    pending: set[int] = set()
    for number in (EXCEPTION, NAN_FORCE):
        signal.signal(number, lambda number, _frame: pending.add(number))
    goals, command = DynamixelFinger.goals, DynamixelHand.command

    def failing_goals(finger: DynamixelFinger, *arguments: Any) -> Any:
        if EXCEPTION in pending:
            pending.discard(EXCEPTION)
            raise InjectedError('injected by the endurance run')
        return goals(finger, *arguments)

    def nan_command(hand: DynamixelHand, fingers: Any, given: ArmCommand) -> None:
        if NAN_FORCE in pending and given.force_n is not None:
            pending.discard(NAN_FORCE)
            given = replace(given, force_n=math.nan)
        command(hand, fingers, given)

    DynamixelFinger.goals = failing_goals  # type: ignore[method-assign]
    DynamixelHand.command = nan_command  # type: ignore[method-assign]


def main() -> None:
    """Run the node."""
    arm()
    explorer.main()


if __name__ == '__main__':
    main()

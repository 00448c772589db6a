"""What an arm or a hand does not carry out, whoever commands it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from texture_core.errors import CommandRefused
from texture_core.parameters import param
from texture_exploration.arms.protocol import ArmCommand


@dataclass(frozen=True)
class CommandLimits:
    """Limits of every single command; a base of the parameters of each arm.

    The explorer has tighter limits of its own for what may be asked for. These hold also for programs that use an arm
    without the explorer, and for a motion with an error in its arithmetic.
    """

    command_speed_m_s: float = param(
        1.0,
        'Sets the highest tangential speed that one command may ask for; faster commands are refused.',
        unit='m/s',
        low=0.001,
        high=2.0,
    )
    command_normal_m_s: float = param(
        0.5,
        'Sets the highest normal speed that one command may ask for; faster commands are refused.',
        unit='m/s',
        low=0.001,
        high=1.0,
    )
    command_force_n: float = param(
        50.0,
        'Sets the highest normal force that one command may ask for; larger forces are refused.',
        unit='N',
        low=0.1,
        high=200.0,
    )

    def check(self, command: ArmCommand, stop: Callable[[], None] | None = None) -> None:
        """Return if the command may be carried out.

        Parameters
        ----------
        command
            What the arm was asked for.
        stop
            Called before the error is raised: brings the arm to a standstill, as the command before may still hold.

        Raises
        ------
        CommandRefused
            If a number is not finite or out of its range, with the range.
        """
        reason = self._excess(command)
        if not reason:
            return
        if stop is not None:
            stop()
        raise CommandRefused(f'the command was refused and the arm stopped: {reason}')

    def _excess(self, command: ArmCommand) -> str:
        # Written so that NaN is too much too.
        speed = math.hypot(*command.tangential_m_s)
        if not speed <= self.command_speed_m_s:
            return _range('the speed along the surface', speed, 0.0, self.command_speed_m_s, 'm/s')
        if not abs(command.normal_m_s) <= self.command_normal_m_s:
            highest = self.command_normal_m_s
            return _range('the speed along the normal', command.normal_m_s, -highest, highest, 'm/s')
        if command.force_n is not None and not 0.0 <= command.force_n <= self.command_force_n:
            return _range('the force', command.force_n, 0.0, self.command_force_n, 'N')
        return ''


def _range(what: str, value: float, low: float, high: float, unit: str) -> str:
    return f'{what} is {value:g} {unit}; allowed is {low:g} to {high:g} {unit}'

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sliding fingers of a hand as an arm: they move as one, while the other fingers hold."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass

from texture_core.config import find, param
from texture_core.errors import DeviceError
from texture_core.types import DEVICES
from texture_exploration.arms.arm import Arm, ArmCommand, ArmState, Vector
from texture_exploration.arms.dynamixel import DynamixelHand
from texture_exploration.arms.hand import FingerSet, Fingertip

HELD_FRACTION = 0.8  # of the wanted force: a finger that presses with it holds the object
LOST_FRACTION = 0.5  # one that presses less has lost it
SAMPLE_PERIOD_S = 0.01


@dataclass(frozen=True)
class InHandParams:
    """Parameters of the hand and of its grip."""

    finger_set: str = param('kaboli-train', 'Finger set of the hand: which fingers hold and which slide.')
    grip_force_n: float = param(2.0, 'Force with which each holding finger presses.', unit='N', low=0.1, high=20.0)
    grip_timeout_s: float = param(
        3.0, 'How long the fingers may take to grip the object before connecting fails.', unit='s', low=0.1, high=30.0
    )
    profile: str = param('leap', 'Profile of the hand: the name of a shipped one or the path of a file.')
    device: str = param(f'{DEVICES}/dynamixel', 'Path of the serial device of the hand.')


class InHandArm(Arm):
    """A Dynamixel hand: hold from `connect` on, move the sliding fingers alike; see `texture_exploration.arms.arm.Arm`.

    The state is the mean of the sliding fingers. A holding finger that presses with less than half of the wanted force
    is a fault.
    """

    Params = InHandParams

    def __init__(self, params: InHandParams = InHandParams()) -> None:
        self._params = params
        self.hand = DynamixelHand(params.profile, params.device)
        self.fingers: FingerSet = find(self.hand.finger_sets, params.finger_set, 'finger set')

    def connect(self) -> None:
        """Reach the hand and close the holding fingers around the object."""
        self.close()
        self.hand.connect()
        try:
            self._take_hold()
        except BaseException:
            self.close()  # a hand that is not connected holds nothing
            raise

    def close(self) -> None:
        """Release the object."""
        self.hand.close()

    def state(self) -> ArmState:
        """Return the mean of the sliding fingers.

        Raises
        ------
        DeviceError
            If the hand is not connected or does not answer.
        """
        hand = self.hand.state()
        tips = [hand.fingers[name] for name in self.fingers.slide]
        weak = self._weak(LOST_FRACTION)
        return ArmState(
            time_ns=hand.time_ns,
            position=_mean([tip.position for tip in tips]),
            velocity=_mean([tip.velocity for tip in tips]),
            force_n=sum(tip.force_n for tip in tips) / len(tips),
            fault=hand.fault or (f'the grip is lost: {weak}' if weak else ''),
        )

    def command(self, command: ArmCommand) -> None:
        """Let the sliding fingers follow.

        Raises
        ------
        DeviceError
            If the hand is not connected.
        CommandRefused
            If the command is out of the limits of the arm; the fingers stop.
        """
        self.hand.command(self.fingers.slide, command)

    def stop(self) -> None:
        """Stop the sliding fingers; the others keep holding."""
        self.command(ArmCommand())

    def warning(self) -> str:
        """Return what is not as it should be although the hand moves, '' if nothing."""
        return self.hand.warning()

    def recover(self) -> None:
        """Release the object and reboot the motors that report an error."""
        self.hand.reboot()

    def _take_hold(self) -> None:
        self.hand.grip(dict.fromkeys(self.fingers.hold, self._params.grip_force_n))
        end_s = time.monotonic() + self._params.grip_timeout_s
        while weak := self._weak(HELD_FRACTION):
            if time.monotonic() > end_s:
                raise DeviceError(f'there is nothing to hold: {weak}; give the hand an object')
            time.sleep(SAMPLE_PERIOD_S)

    def _weak(self, fraction: float) -> str:
        """Return which holding finger presses with less than a fraction of the wanted force, '' if none."""
        tips: Mapping[str, Fingertip] = self.hand.state().fingers
        wanted = self._params.grip_force_n
        weak = [name for name in self.fingers.hold if tips[name].force_n < fraction * wanted]
        return ', '.join(f'{name} presses with {tips[name].force_n:.2f} N of {wanted:g} N' for name in weak)


def _mean(vectors: list[Vector]) -> Vector:
    x, y, z = (sum(axis) / len(vectors) for axis in zip(*vectors, strict=True))
    return x, y, z

"""Lead the arm through ur-rtde: one command per cycle.

All commands pass through the same registers of the controller, which its script reads every 2 ms. Commands that stream
are not acknowledged: a second one would overwrite the first before it is read. So each cycle sends one of them, and
what must hold is said again and again.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from typing import Any

from texture_exploration.arms.ur_messages import Wish
from texture_exploration.arms.ur_params import UrArmParams
from texture_exploration.arms.ur_tables import (
    FORCE_DEVIATION_M,
    FORCE_DEVIATION_RAD,
    FORCE_FRAME_FIXED,
    STOP_DECELERATION_M_S2,
)


class Mode(enum.Enum):
    """What the arm is doing."""

    REST = enum.auto()
    SPEED = enum.auto()
    FORCE = enum.auto()  # speed along the surface, force along its normal


class Pilot:
    """Turn the newest wish into commands.

    Parameters
    ----------
    control
        The RTDEControlInterface of ur-rtde. Only one thread may use it.
    params
        The arm.
    """

    def __init__(self, control: Any, params: UrArmParams) -> None:
        self.refused = 0
        self._control = control
        self._params = params
        self._mode = Mode.REST
        self._speed_is_next = False

    def cycle(self, wish: Wish | None) -> None:
        """Send what is due; no wish is the wish to stand still."""
        mode = _mode(wish)
        if mode is not self._mode:
            self._change(mode, wish)
        self._count(STREAM[mode](self, wish))

    def forget(self) -> None:
        """The program on the controller was started anew: the arm is at rest."""
        self._mode = Mode.REST

    def _change(self, mode: Mode, wish: Wish | None) -> None:
        """Leave the present mode. These commands are acknowledged, so nothing overwrites them."""
        if mode is Mode.REST:
            self._count(self._control.speedStop(STOP_DECELERATION_M_S2))
        if self._mode is Mode.FORCE:
            self._count(self._control.forceModeStop())
        if self._mode is Mode.REST and wish is not None and wish.zero_first:
            self._count(self._control.zeroFtSensor())
        self._mode = mode
        self._speed_is_next = False

    def _rest(self, _wish: Wish | None) -> bool:
        return bool(self._control.kickWatchdog())

    def _speed(self, wish: Wish) -> bool:
        velocity = [*wish.velocity_m_s, 0.0, 0.0, 0.0]
        return bool(self._control.speedL(velocity, self._params.arm_acceleration_m_s2, 1.0 / self._params.rate_hz))

    def _force(self, wish: Wish) -> bool:
        """Say by turns how to press and how to slide."""
        self._speed_is_next = not self._speed_is_next
        if not self._speed_is_next:
            return self._speed(wish)
        normal_only = [0, 0, 1, 0, 0, 0]
        wrench = [0.0, 0.0, -(wish.force_n or 0.0), 0.0, 0.0, 0.0]
        limits = [*(FORCE_DEVIATION_M,) * 2, self._params.force_speed_m_s, *(FORCE_DEVIATION_RAD,) * 3]
        frame = list(self._params.surface_pose)
        return bool(self._control.forceMode(frame, normal_only, wrench, FORCE_FRAME_FIXED, limits))

    def _count(self, taken: bool) -> None:
        self.refused += not taken


STREAM: Mapping[Mode, Callable[[Pilot, Any], bool]] = {
    Mode.REST: Pilot._rest,
    Mode.SPEED: Pilot._speed,
    Mode.FORCE: Pilot._force,
}


def _mode(wish: Wish | None) -> Mode:
    if wish is None:
        return Mode.REST
    return Mode.SPEED if wish.force_n is None else Mode.FORCE

"""Send commands to the arm through ur-rtde, one per cycle.

All commands pass through the same registers of the controller, which its script reads every 2 ms. Commands that stream
are not acknowledged: a second one would overwrite the first before it is read. So each cycle sends one of them, and
what must hold is said again and again.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from texture_exploration.arms.protocol import Vector
from texture_exploration.arms.surface_frame import SurfaceFrame
from texture_exploration.arms.ur_messages import UrCommand
from texture_exploration.arms.ur_params import UrArmParams
from texture_exploration.arms.ur_tables import (
    FORCE_DEVIATION_M,
    FORCE_DEVIATION_RAD,
    FORCE_FRAME_FIXED,
    STOP_DECELERATION_M_S2,
)
from texture_exploration.arms.ur_watchdog import Watchdog
from texture_exploration.free_air import FreeAir

RISE_M_S = 0.02
CALM_NS = 100_000_000  # at rest, before the force sensor is zeroed
TURN_NS = 100_000_000  # in which an arm has turned back
MAX_RISES = 5.0  # a finger that is lifted to zero its sensor rises at most by so many times what proves free air


class Mode(enum.Enum):
    """What the arm is doing."""

    STANDSTILL = enum.auto()
    SPEED = enum.auto()
    FORCE = enum.auto()  # speed along the surface, force along its normal


class UrCommandStream:
    """Turn the newest command of the arm into calls of ur-rtde.

    Parameters
    ----------
    control
        The RTDEControlInterface of ur-rtde. Only one thread may use it.
    params
        The arm.
    watchdog
        The same controller's.

    Attributes
    ----------
    refused, zeroings
        How many commands the controller did not take, and how often the force sensor was zeroed.
    trusted
        The force sensor was zeroed since the arm was connected or recovered.
    unsteady
        It could not be zeroed: the force changed all the while the finger rose.
    """

    def __init__(self, control: Any, params: UrArmParams, watchdog: Watchdog) -> None:
        self.refused = 0
        self.zeroings = 0
        self.trusted = self.unsteady = False
        self._control = control
        self._params = params
        self._watchdog = watchdog
        self._frame = SurfaceFrame(params.surface_pose)
        self._up = self._frame.to_base((0.0, 0.0, RISE_M_S))
        self._air = FreeAir(params.zero_rise_m, params.zero_steady_n)
        self._measured_ns = self._rest_ns = 0
        self._rise_from_m: float | None = None
        self._height_m = 0.0
        self._mode = Mode.STANDSTILL
        self._braking = False
        self._next_is_speed = False
        self._led_m_s: Vector = (0.0, 0.0, 0.0)  # the newest velocity sent
        self._turned_ns = -TURN_NS

    def observe(self, time_ns: int, position_m: Vector, force_n: Vector) -> None:
        """Take over what the controller measured last, in the base frame.

        Parameters
        ----------
        time_ns
            When it was measured, ns.
        position_m : (3,)
            Place of the tool, m, in the base frame.
        force_n : (3,)
            Force on the tool, N, in the base frame.
        """
        place = self._frame.place(position_m)
        self._height_m, self._measured_ns = place[2], time_ns
        self._air.update(time_ns, place, self._frame.direction(force_n)[2])

    def cycle(self, ur_command: UrCommand | None) -> None:
        """Send what is due; None commands standstill."""
        ur_command = self._lifted_first(ur_command)
        mode = _mode(ur_command)
        self._braking &= mode is Mode.STANDSTILL
        if mode is not self._mode and not self._change(mode):
            return
        if mode is Mode.FORCE:
            self._air.presume_contact()
        self._count(STREAM[mode](self, ur_command))

    def stand_still(self) -> None:
        """Stop at once, and return when the arm stands still."""
        with self._watchdog.patient():
            self._stop()

    def reset(self) -> None:
        """The program on the controller was started again: the arm is at rest, in contact or not."""
        self._mode = Mode.STANDSTILL
        self._braking = False
        self.trusted = self.unsteady = False
        self._rise_from_m = None
        self._air.presume_contact()

    def _lifted_first(self, ur_command: UrCommand | None) -> UrCommand | None:
        """Return the wish, or to rise and to stand still before it if it needs a force sensor that is not zeroed."""
        if ur_command is None or ur_command.force_n is None or self.trusted:
            self._rise_from_m = None
            return ur_command
        if self.unsteady:
            return None
        if self._air.proven:
            return ur_command if self._mode is Mode.STANDSTILL else None
        if self._rise_from_m is None:
            self._rise_from_m = self._height_m
        self.unsteady = self._height_m - self._rise_from_m > MAX_RISES * self._params.zero_rise_m
        return replace(ur_command, velocity_m_s=self._up, force_n=None)

    def _change(self, mode: Mode) -> bool:
        """Leave the present mode; return whether the new one has begun."""
        if mode is Mode.STANDSTILL and not self._braking:
            # A command that streams takes effect at once; those that follow wait for each other.
            self._braking = True
            self._count(bool(self._control.speedL([0.0] * 6, STOP_DECELERATION_M_S2, 1.0 / self._params.rate_hz)))
            return False
        if not self._leave(mode):
            return False
        if not self._guarded(mode):
            self._count(False)
            return False
        self._mode = mode
        self._rest_ns = self._measured_ns
        self._braking = self._next_is_speed = False
        return True

    def _guarded(self, mode: Mode) -> bool:
        """Return whether the watchdog guards a mode; at rest one that waits too long is set again."""
        if mode is Mode.STANDSTILL:
            return True
        late = self._mode is Mode.STANDSTILL and self._watchdog.widened
        return self._watchdog.arm() if late or not self._watchdog.armed else True

    def _leave(self, mode: Mode) -> bool:
        """Do what ends the present mode; return whether that is enough for the new one."""
        if mode is Mode.STANDSTILL:
            self.stand_still()
        elif self._mode is Mode.FORCE:
            with self._watchdog.patient():
                self._count(self._watchdog.call(self._control.forceModeStop))
        elif self._mode is Mode.STANDSTILL and self._air.proven:
            with self._watchdog.patient():
                return self._zero()
        return True

    def _stop(self) -> None:
        """Come to rest; these commands are acknowledged, so nothing overwrites them."""
        self._count(self._watchdog.call(self._control.speedStop, STOP_DECELERATION_M_S2))
        if self._mode is Mode.FORCE:
            self._count(self._watchdog.call(self._control.forceModeStop))
        self._mode = Mode.STANDSTILL

    def _zero(self) -> bool:
        """Zero the force sensor, at rest and in free air; return whether the controller did."""
        taken = self._watchdog.call(self._control.zeroFtSensor)
        self._count(taken)
        if not taken:
            self._rest_ns = self._measured_ns  # free air is still proven: try again after another rest
            return False
        self.trusted = True
        self.zeroings += 1
        self._air.presume_contact()  # the force is another one now; the next zeroing needs a proof of its own
        return True

    def _hold_still(self, _ur_command: UrCommand | None) -> bool:
        """Zero the force sensor as soon as the arm has calmed down in free air."""
        if self._air.proven and self._measured_ns - self._rest_ns > CALM_NS:
            with self._watchdog.patient():
                self._zero()
        return bool(self._control.kickWatchdog())

    def _speed(self, ur_command: UrCommand) -> bool:
        velocity = [*ur_command.velocity_m_s, 0.0, 0.0, 0.0]
        if sum(now * before for now, before in zip(ur_command.velocity_m_s, self._led_m_s, strict=True)) < 0.0:
            self._turned_ns = self._measured_ns
        self._led_m_s = ur_command.velocity_m_s
        # Whoever turns back has met something: as hard as a stop.
        turns = self._measured_ns - self._turned_ns < TURN_NS
        acceleration = max(STOP_DECELERATION_M_S2 if turns else 0.0, self._params.arm_acceleration_m_s2)
        return bool(self._control.speedL(velocity, acceleration, 1.0 / self._params.rate_hz))

    def _force(self, ur_command: UrCommand) -> bool:
        """Say by turns how to press and how to slide."""
        self._next_is_speed = not self._next_is_speed
        if not self._next_is_speed:
            return self._speed(ur_command)
        normal_only = [0, 0, 1, 0, 0, 0]
        wrench = [0.0, 0.0, -(ur_command.force_n or 0.0), 0.0, 0.0, 0.0]
        limits = [*(FORCE_DEVIATION_M,) * 2, self._params.force_speed_m_s, *(FORCE_DEVIATION_RAD,) * 3]
        frame = list(self._params.surface_pose)
        return bool(self._control.forceMode(frame, normal_only, wrench, FORCE_FRAME_FIXED, limits))

    def _count(self, taken: bool) -> None:
        self.refused += not taken


STREAM: Mapping[Mode, Callable[[UrCommandStream, Any], bool]] = {
    Mode.STANDSTILL: UrCommandStream._hold_still,
    Mode.SPEED: UrCommandStream._speed,
    Mode.FORCE: UrCommandStream._force,
}


def _mode(ur_command: UrCommand | None) -> Mode:
    if ur_command is None:
        return Mode.STANDSTILL
    return Mode.SPEED if ur_command.force_n is None else Mode.FORCE

"""Dynamixel motors of the X series: control tables and mechanics, around an object.

A motor in current-based position mode follows its goal by its gain, with at most its goal current; motors that press
meet the object.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.finger import FingerState

ALERT, RANGE, ACCESS = 0x80, 4, 7  # errors of a status packet
EEPROM_END = 64
TORQUE, ERROR, P_GAIN, GOAL_CURRENT, GOAL_POSITION, PRESENT = 64, 70, 84, 102, 116, 126
RAD_PER_COUNT, RAD_S_PER_COUNT, A_PER_COUNT = 0.001533981, 0.0239691, 0.001
TORQUE_NM_A = 0.35
A_PER_RAD_AND_GAIN = 0.005  # how much current an error makes, per gain
DAMPING = 0.012  # N·m per rad/s
PHYSICS_S = 0.0005


@dataclass(frozen=True)
class Pressing:
    """A motor whose lever presses a fingertip on the object."""

    lever_m: float
    height_m: float  # above the object at the start


@dataclass(frozen=True)
class Finger:
    """The motors of a finger: what presses, and what moves the fingertip across and along the object, with levers."""

    press: int
    across: int
    along: int
    across_m: float = 0.09
    along_m: float = 0.05


# Of a LEAP hand: each finger bends forward by the motor that presses.
LEAP_IDS = range(16)
LEAP_FINGERS: Mapping[str, Finger] = {
    'index': Finger(1, 0, 2),
    'middle': Finger(5, 4, 6),
    'ring': Finger(9, 8, 10),
    'thumb': Finger(13, 12, 14),
}
LEAP_PRESSING = {finger.press: Pressing(0.09, 0.01) for finger in LEAP_FINGERS.values()}


class DynamixelMotors:
    """Control tables and mechanics of all motors.

    Parameters
    ----------
    ids
        Of the motors.
    pressing
        Those that press, and how.
    stiffness_n_m
        Of fingertip and object; 0: there is no object.
    model
        Number of the model.
    """

    def __init__(
        self, ids: list[int], pressing: Mapping[int, Pressing], stiffness_n_m: float = 2000.0, model: int = 1220
    ) -> None:
        self.ids = ids
        self.absent: set[int] = set()  # cable out
        self.stiffness_n_m = stiffness_n_m
        self.tables = {motor: bytearray(256) for motor in ids}
        self._angle: Array = np.zeros(len(ids))
        self._speed: Array = np.zeros(len(ids))
        self._current: Array = np.zeros(len(ids))
        self._lever = np.array([pressing[motor].lever_m if motor in pressing else 0.0 for motor in ids])
        self._height = np.array([pressing[motor].height_m if motor in pressing else 1.0 for motor in ids])
        for motor in ids:
            struct.pack_into('<H', self.tables[motor], 0, model)
            struct.pack_into('<i', self.tables[motor], GOAL_POSITION, 2048)
        self._show()

    @property
    def forces_n(self) -> dict[int, float]:
        """The force of each motor's fingertip on the object."""
        depth = np.maximum(0.0, self._angle * self._lever - self._height)
        return dict(zip(self.ids, (self.stiffness_n_m * depth).tolist(), strict=True))

    def angle_rad(self, motor: int) -> float:
        """Return how far a motor has turned since the start."""
        return float(self._angle[self.ids.index(motor)])

    def finger_state(self, finger: Finger, time_ns: int) -> FingerState:
        """Return where a fingertip is over the object, how fast, and how hard it presses."""
        press, across, along = (self.ids.index(motor) for motor in (finger.press, finger.across, finger.along))
        ways, speeds = (
            (values[across] * finger.across_m, values[along] * finger.along_m, values[press] * self._lever[press])
            for values in (self._angle.tolist(), self._speed.tolist())
        )
        height_m = float(self._height[press]) - ways[2]
        return FingerState(time_ns, *ways[:2], height_m, *speeds[:2], -speeds[2], self.forces_n[finger.press])

    def advance(self, steps: int) -> None:
        """Let time pass, in steps of `PHYSICS_S`."""
        torque = np.array([self.tables[motor][TORQUE] for motor in self.ids], dtype=bool)
        goal = (self._registers(GOAL_POSITION, '<i') - 2048) * RAD_PER_COUNT
        most = np.abs(self._registers(GOAL_CURRENT, '<h')) * A_PER_COUNT
        gain = self._registers(P_GAIN, '<H') * A_PER_RAD_AND_GAIN
        for _ in range(steps):
            self._current = np.where(torque, np.clip(gain * (goal - self._angle), -most, most), 0.0)
            depth = np.maximum(0.0, self._angle * self._lever - self._height)
            spring = self.stiffness_n_m * self._lever * (depth > 0)
            # Implicit: the load is that at the end of the step, so no stiffness makes it swing.
            self._speed = (self._current * TORQUE_NM_A - spring * depth) / (DAMPING + PHYSICS_S * spring * self._lever)
            self._angle = self._angle + self._speed * PHYSICS_S
        self._show()

    def write(self, motor: int, address: int, data: bytes) -> int:
        """Write into a control table; return the error of the status packet."""
        table = self.tables[motor]
        if address + len(data) > len(table):
            return RANGE
        if address < EEPROM_END and table[TORQUE]:
            return ACCESS
        table[address : address + len(data)] = data
        return ALERT if table[ERROR] else 0

    def _registers(self, address: int, form: str) -> Array:
        return np.array([struct.unpack_from(form, self.tables[motor], address)[0] for motor in self.ids], dtype=float)

    def _show(self) -> None:
        """Put what is measured into the control tables: current, velocity, position."""
        for place, motor in enumerate(self.ids):
            struct.pack_into(
                '<hii',
                self.tables[motor],
                PRESENT,
                round(self._current[place] / A_PER_COUNT),
                round(self._speed[place] / RAD_S_PER_COUNT),
                round(self._angle[place] / RAD_PER_COUNT) + 2048,
            )


def leap_hand(stiffness_n_m: float = 2000.0) -> DynamixelMotors:
    """Return the motors of a LEAP hand."""
    return DynamixelMotors(list(LEAP_IDS), LEAP_PRESSING, stiffness_n_m)

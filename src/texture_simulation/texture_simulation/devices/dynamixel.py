# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Dynamixel motors and a hand emulated at protocol level."""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.types import Array, FingerState
from texture_simulation.devices.rails import EmulatedSerialRobot

# --------------------
# Dynamixel motors of the X series: control tables and mechanics, around an object.
#
# A motor in current-based position mode follows its goal by its gain, with at most its goal current; motors that press
# meet the object. What a motor refuses, and what its Bus Watchdog, its shutdown and a reboot do, is as in the ROBOTIS
# e-Manual of the X series (sections Bus Watchdog, Hardware Error Status, Shutdown; protocol 2.0, Status Packet).

ALERT, RANGE, LENGTH, LIMIT, ACCESS = 0x80, 4, 5, 6, 7  # errors of a status packet
EEPROM_END = 64
MODE, CURRENT_LIMIT, SHUTDOWN = 11, 38, 63
TORQUE, ERROR, P_GAIN, WATCHDOG, GOAL_CURRENT, GOAL_POSITION, PRESENT = 64, 70, 84, 98, 102, 116, 126
PRESENT_END = 147  # of what is measured; none of it can be written
GOALS = range(100, 104), range(104, 108), range(116, 120)  # PWM and current, velocity, position
WATCHDOG_UNIT_S, MAX_WATCHDOG, TRIPPED = 0.02, 127, 0xFF
SHUTDOWN_BITS = 0x34  # as delivered: overload, electrical shock and overheating switch the torque off
OVERLOAD = 1 << 5  # in Hardware Error Status and Shutdown
POSITION_MODE, DEFAULT_P_GAIN = 3, 400
REBOOT_S = 0.3  # a motor that starts is silent for so long; an assumption
RAD_PER_COUNT, RAD_S_PER_COUNT, A_PER_COUNT = 0.001533981, 0.0239691, 0.001
XC330_M288, XC330_CURRENT_LIMIT = 1240, 1750  # model number, mA
TORQUE_NM_A = 0.517  # of an XC330-M288: stall torque by stall current, 0.93 N·m by 1.80 A
A_PER_RAD_AND_GAIN = 0.005  # how much current an error makes, per gain
DAMPING = 0.012  # N·m per rad/s
PHYSICS_S = 0.0005
SPEED_FILTER_S = 0.02  # of the register Present Velocity; a guess, the manual names none


class PressingMotor(NamedTuple):
    """A motor whose lever presses a fingertip on the object."""

    lever_m: float
    height_m: float  # above the object at the start


class FingerMotors(NamedTuple):
    """The motors of a finger: what presses, and what moves the fingertip across and along the object, with levers."""

    press: int
    across: int
    along: int
    across_m: float = 0.09
    along_m: float = 0.05


# Of a LEAP hand: each finger bends forward by the motor that presses.
LEAP_IDS = range(16)
LEAP_FINGERS: Mapping[str, FingerMotors] = {
    'index': FingerMotors(1, 0, 2),
    'middle': FingerMotors(5, 4, 6),
    'ring': FingerMotors(9, 8, 10),
    'thumb': FingerMotors(13, 12, 14),
}
LEAP_PRESSING = {finger.press: PressingMotor(0.09, 0.01) for finger in LEAP_FINGERS.values()}


class DynamixelMotors:
    """Control tables and mechanics of all motors."""

    def __init__(self, ids: list[int], pressing: Mapping[int, PressingMotor], stiffness_n_m: float = 2000.0) -> None:
        self.ids = ids
        self.absent: set[int] = set()  # cable out
        self.held: set[int] = set()  # something holds them where they are
        self.twice: set[int] = set()  # two motors with this id, whose answers collide
        self.stiffness_n_m = stiffness_n_m
        self._silence_s = 0.0  # since the last instruction packet, in the time of the mechanics
        self._starting_s: dict[int, float] = {}  # motors that reboot, and for how much longer
        self.tables = {motor: bytearray(256) for motor in ids}
        self._angle: Array = np.zeros(len(ids))
        self._speed: Array = np.zeros(len(ids))
        self._shown_speed: Array = np.zeros(len(ids))
        self._current: Array = np.zeros(len(ids))
        self._lever = np.array([pressing[motor].lever_m if motor in pressing else 0.0 for motor in ids])
        self._height = np.array([pressing[motor].height_m if motor in pressing else 1.0 for motor in ids])
        for motor in ids:
            struct.pack_into('<H', self.tables[motor], 0, XC330_M288)
            self.tables[motor][6] = 52  # firmware
            self.tables[motor][MODE] = POSITION_MODE
            self.tables[motor][SHUTDOWN] = SHUTDOWN_BITS
            struct.pack_into('<H', self.tables[motor], CURRENT_LIMIT, XC330_CURRENT_LIMIT)
            self._clear_memory(motor)
        self._show()

    @property
    def forces_n(self) -> dict[int, float]:
        """The force of each motor's fingertip on the object."""
        depth = np.maximum(0.0, self._angle * self._lever - self._height)
        return dict(zip(self.ids, (self.stiffness_n_m * depth).tolist(), strict=True))

    def angle_rad(self, motor: int) -> float:
        """Return how far a motor has turned since the start."""
        return float(self._angle[self.ids.index(motor)])

    def finger_state(self, finger: FingerMotors, time_ns: int) -> FingerState:
        """Return where a fingertip is over the object, how fast, and how hard it presses."""
        press, across, along = (self.ids.index(motor) for motor in (finger.press, finger.across, finger.along))
        travels, speeds = (
            (values[across] * finger.across_m, values[along] * finger.along_m, values[press] * self._lever[press])
            for values in (self._angle.tolist(), self._speed.tolist())
        )
        height_m = float(self._height[press]) - travels[2]
        return FingerState(time_ns, *travels[:2], height_m, *speeds[:2], -speeds[2], self.forces_n[finger.press])

    def receive(self) -> None:
        """Take note of an instruction packet on the bus, whomever it is for: the Bus Watchdogs count from now."""
        self._silence_s = 0.0

    def answers(self, motor: int) -> bool:
        """Return whether a motor is on the bus and has started."""
        return motor in self.tables and motor not in self.absent and motor not in self._starting_s

    def fail(self, motor: int, bits: int) -> None:
        """Let a motor detect a hardware error: it is latched, and what the register Shutdown names ends the torque."""
        table = self.tables[motor]
        table[ERROR] |= bits
        if bits & table[SHUTDOWN]:
            table[TORQUE] = 0

    def reboot(self, motor: int) -> None:
        """Restart a motor, as by the instruction or after a dip of its supply: what is not in its EEPROM is lost."""
        self._starting_s[motor] = REBOOT_S
        self._clear_memory(motor)

    def advance(self, steps: int) -> None:
        """Let time pass, in steps of `PHYSICS_S`."""
        self._watch(steps * PHYSICS_S)
        torque = np.array([self.tables[motor][TORQUE] for motor in self.ids], dtype=bool)
        goal = (self._registers(GOAL_POSITION, '<i') - 2048) * RAD_PER_COUNT
        most = np.abs(self._registers(GOAL_CURRENT, '<h')) * A_PER_COUNT
        gain = self._registers(P_GAIN, '<H') * A_PER_RAD_AND_GAIN
        free = np.array([motor not in self.held for motor in self.ids])
        before = self._angle
        for _ in range(steps):
            self._current = np.where(torque, np.clip(gain * (goal - self._angle), -most, most), 0.0)
            self._move(free)
        # Without inertia the speed swings with each goal: reads in step with the goals would always see half.
        passed_s = max(1, steps) * PHYSICS_S
        newest = (self._angle - before) / passed_s - self._shown_speed
        self._shown_speed = self._shown_speed + newest * (1.0 - math.exp(-passed_s / SPEED_FILTER_S))
        self._show()

    def _move(self, free: NDArray[np.bool_]) -> None:
        """Move the joints for one step with the present currents; those that are not free stay."""
        depth = np.maximum(0.0, self._angle * self._lever - self._height)
        spring = self.stiffness_n_m * self._lever * (depth > 0)
        # Implicit: the load is that at the end of the step, so no stiffness makes it swing.
        speed = (self._current * TORQUE_NM_A - spring * depth) / (DAMPING + PHYSICS_S * spring * self._lever)
        self._speed = np.where(free, speed, 0.0)
        self._angle = self._angle + self._speed * PHYSICS_S

    def write(self, motor: int, address: int, data: bytes) -> int:
        """Write into a control table unless the motor refuses it; return the error of the status packet."""
        table = self.tables[motor]
        error = self._refusal(table, address, data)
        if not error:
            table[address : address + len(data)] = data
        return error | (ALERT if table[ERROR] else 0)

    def _refusal(self, table: bytearray, address: int, data: bytes) -> int:
        if address + len(data) > len(table):
            return RANGE
        if (address < EEPROM_END and table[TORQUE]) or PRESENT - 6 <= address < PRESENT_END or address == ERROR:
            return ACCESS
        if any(address in goal for goal in GOALS):
            return self._refused_goal(table, address, data)
        if address == WATCHDOG and int.from_bytes(data[:1], 'little', signed=True) < 0:
            return RANGE
        if address == TORQUE and data[0]:
            # After a shutdown only a reboot lets the torque be switched on again.
            return ACCESS if table[ERROR] & table[SHUTDOWN] else 0
        return 0

    def _refused_goal(self, table: bytearray, address: int, data: bytes) -> int:
        if table[WATCHDOG] == TRIPPED:
            return RANGE
        if address != GOAL_CURRENT:
            return 0
        if len(data) < 2:
            return LENGTH
        (goal,) = struct.unpack_from('<h', data)
        (limit,) = struct.unpack_from('<H', table, CURRENT_LIMIT)
        return LIMIT if abs(goal) > limit else 0

    def _watch(self, passed_s: float) -> None:
        """Let the Bus Watchdogs and the starting motors see that time has passed."""
        self._silence_s += passed_s
        self._starting_s = {motor: left - passed_s for motor, left in self._starting_s.items() if left > passed_s}
        for table in self.tables.values():
            armed = table[TORQUE] and 0 < table[WATCHDOG] <= MAX_WATCHDOG
            if armed and self._silence_s > table[WATCHDOG] * WATCHDOG_UNIT_S:
                table[WATCHDOG] = TRIPPED
                table[GOAL_POSITION : GOAL_POSITION + 4] = table[PRESENT + 6 : PRESENT + 10]

    def _clear_memory(self, motor: int) -> None:
        """Give what is not in the EEPROM the values with which a motor starts."""
        table = self.tables[motor]
        table[EEPROM_END:PRESENT] = bytes(PRESENT - EEPROM_END)
        struct.pack_into('<H', table, P_GAIN, DEFAULT_P_GAIN)
        table[GOAL_CURRENT : GOAL_CURRENT + 2] = table[CURRENT_LIMIT : CURRENT_LIMIT + 2]
        place = self.ids.index(motor)
        struct.pack_into('<i', table, GOAL_POSITION, round(float(self._angle[place]) / RAD_PER_COUNT) + 2048)

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
                round(self._shown_speed[place] / RAD_S_PER_COUNT),
                round(self._angle[place] / RAD_PER_COUNT) + 2048,
            )


def leap_hand(stiffness_n_m: float = 2000.0) -> DynamixelMotors:
    """Return the motors of a LEAP hand."""
    return DynamixelMotors(list(LEAP_IDS), LEAP_PRESSING, stiffness_n_m)


# --------------------
# A bus of Dynamixel motors (protocol 2.0) on a pseudo-terminal: written from the protocol.
#
# `FF FF FD 00 | id | length | instruction | parameters | CRC`.

HEADER = b'\xff\xff\xfd\x00'
PING, READ, WRITE, REBOOT, STATUS, SYNC_READ, SYNC_WRITE = 1, 2, 3, 8, 0x55, 0x82, 0x83
UNDEFINED, CUT_SHORT = 2, 5  # errors of a status packet: instruction, length
TURN_S = 0.002
IDLE_S = 0.0005
MAX_STEPS = 100


def crc16(data: bytes) -> int:
    """Return the checksum of protocol 2.0: polynomial 8005, start 0, not reflected; of "123456789" FEE8."""
    value = 0
    for byte in data:
        value ^= byte << 8
        for _ in range(8):
            value = ((value << 1) ^ 0x8005 if value & 0x8000 else value << 1) & 0xFFFF
    return value


class EmulatedDynamixelBus(EmulatedSerialRobot):
    """The motors on their bus."""

    def __init__(
        self,
        link: Path,
        motors: DynamixelMotors,
        finger: FingerMotors | None = None,
        finger_pipe: str = '',
    ) -> None:
        super().__init__(link, finger_pipe)
        self.motors = motors
        self._finger = finger
        self._received = b''

    def run(self) -> None:
        """Answer what comes, and let the motors move."""
        due_s = time.monotonic()
        while not self.closing.is_set():
            # First the time that has passed: a read is answered with the present position, as a motor does.
            steps = int((time.monotonic() - due_s) / PHYSICS_S)
            if steps * PHYSICS_S >= TURN_S:
                due_s += steps * PHYSICS_S
                self.motors.advance(min(steps, MAX_STEPS))
                if self._finger is not None:
                    self.emulator.send(self.motors.finger_state(self._finger, time.monotonic_ns()))
            with self.port_lock:
                data = self.port.read()
                self.port.write(self.receive(data))
            if not data:
                self.closing.wait(IDLE_S)

    def receive(self, data: bytes) -> bytes:
        """Return the answers to what came over the line."""
        self._received += data
        answers = b''
        while (at := self._received.find(HEADER)) >= 0 and len(self._received) >= at + 7:
            length = int.from_bytes(self._received[at + 5 : at + 7], 'little')
            packet = self._received[at : at + 7 + length]
            if len(packet) < 7 + length:
                break
            self._received = self._received[at + 7 + length :]
            if crc16(packet[:-2]) == int.from_bytes(packet[-2:], 'little'):
                self.motors.receive()
                unstuffed = packet[8:-2].replace(b'\xff\xff\xfd\xfd', b'\xff\xff\xfd')
                answers += self._execute(packet[4], packet[7], unstuffed)
        return answers

    def _execute(self, motor: int, instruction: int, params: bytes) -> bytes:
        if instruction == SYNC_READ:
            address, size = struct.unpack_from('<HH', params)
            answers = b''
            for asked in params[4:]:
                if not self.motors.answers(asked):
                    break  # each waits for the one before it
                answers += self._status(asked, bytes(self.motors.tables[asked][address : address + size]))
            return answers
        if instruction == SYNC_WRITE:
            address, size = struct.unpack_from('<HH', params)
            for at in range(4, len(params), size + 1):
                if self.motors.answers(params[at]):
                    self.motors.write(params[at], address, params[at + 1 : at + 1 + size])
            return b''
        if not self.motors.answers(motor):
            return b''
        return self._one(motor, instruction, params)

    def _one(self, motor: int, instruction: int, params: bytes) -> bytes:
        table = self.motors.tables[motor]
        if instruction == PING:
            return self._status(motor, bytes(table[0:2]) + bytes([table[6]]))
        if instruction == READ:
            address, size = struct.unpack('<HH', params)
            return self._status(motor, bytes(table[address : address + size]))
        if instruction == WRITE:
            if len(params) < 3:
                return self._status(motor, b'', CUT_SHORT)
            error = self.motors.write(motor, int.from_bytes(params[:2], 'little'), params[2:])
            return self._status(motor, b'', error)
        if instruction == REBOOT:
            answer = self._status(motor, b'')
            self.motors.reboot(motor)
            return answer
        return self._status(motor, b'', UNDEFINED)

    def _status(self, motor: int, params: bytes, error: int = 0) -> bytes:
        error |= ALERT if self.motors.tables[motor][ERROR] else 0
        body = (bytes([STATUS, error]) + params).replace(b'\xff\xff\xfd', b'\xff\xff\xfd\xfd')
        packet = HEADER + bytes([motor]) + struct.pack('<H', len(body) + 2) + body
        packet += struct.pack('<H', crc16(packet))
        # Two motors with one id answer at once, and what they send is neither's.
        return packet[:-2] + bytes(2) if motor in self.motors.twice else packet

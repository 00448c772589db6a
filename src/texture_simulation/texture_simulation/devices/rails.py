# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Two rails and a pressing motor emulated at protocol level."""

from __future__ import annotations

import binascii
import struct
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from texture_core.config import param
from texture_core.framing import cobs_decode
from texture_core.types import FingerSender, FingerState
from texture_simulation.devices.fingers import ByteFaults, PtyPort, framed

# --------------------
# The rails of a PVDF finger: their firmware and their mechanics, written from the protocol.
#
# Frame: COBS(kind u8, version u8, sequence u16, time_us u32, 1, 1, body, CRC-16/CCITT-FALSE u16), then a zero; little
# endian. Orders 0xA0 move (i32 vx, vy µm/s; u8 mode; i32 value), 0xA1 stop, 0xA2 clear; state 0x20 (i32 x, y, z counts;
# i32 mN; u8 flags; u16 watchdog stops).

WATCHDOG_S = 0.15
VERSION = 1
HOLD, MOVING, PRESS = 0, 1, 2
LOW, HIGH = (1, 4), (2, 8)  # flags of the end switches of x and y
TOP, LOCKED, OVERLOAD, STALL = 16, 32, 64, 128
PRESS_SPEED_M_S = 0.01
PRESS_GAIN_M_S_N = 0.008  # the motor slows down as the force comes near: self-locking gears stop at once
REACHED = 0.99  # of the wanted force, where the motor stops
LIFT_SPEED_M_S = 0.05


ACCELERATION_M_S2 = 5.0  # of the stepper motors
XY_COUNTS_M, Z_COUNTS_M = 200_000.0, 1_000_000.0  # encoder counts per metre: the defaults of the arm
OVERLOAD_N = 14.0  # above this the firmware lifts the finger
RISE_M = 0.05  # of the pressing motor above the start


@dataclass(frozen=True)
class ContactParams:
    """Where a finger begins, and how hard it is to press."""

    start_height_m: float = param(0.01, 'Height of the finger above the surface at the start.', unit='m', low=0.0)
    stiffness_n_m: float = param(
        2000.0, 'Stiffness of finger and surface in contact; 0 removes the surface.', unit='N/m', low=0.0, high=200000.0
    )


@dataclass(frozen=True)
class RailsMachine(ContactParams):
    """Parameters of the emulated rails and of the surface under the finger."""

    travel_m: float = param(0.3, 'Distance of the end switches from the start.', unit='m', low=0.01)
    stalled: bool = param(False, 'Blocks the rails mechanically, so that the encoders do not follow the motors.')
    reports_stall: bool = param(True, 'Lets the firmware stop and report encoders that do not follow the motors.')


class RailsFirmware:
    """Orders in, states out; time goes by `advance`."""

    def __init__(self, machine: RailsMachine) -> None:
        self.machine = machine
        self.watchdog_stops = self.bad_frames = 0
        self.position = np.array([0.0, 0.0, machine.start_height_m])
        self.velocity = np.zeros(3)
        self.surface_m = 0.0  # height of the surface there
        self._flags = 0
        self._wanted = np.zeros(2)
        self._mode, self._value = HOLD, 0.0
        self._silent_for_s = 0.0
        self._watching = False
        self._received = b''
        self._sent = 0
        self._time_s = 0.0

    @property
    def force_n(self) -> float:
        """Force on the force sensor, N."""
        return float(self.machine.stiffness_n_m * max(0.0, self.surface_m - self.position[2]))

    def receive(self, data: bytes) -> None:
        """Obey the orders in what came over the line."""
        *segments, self._received = (self._received + data).split(b'\x00')
        for segment in segments:
            content = _checked(segment)
            if content is None:
                self.bad_frames += bool(segment)
            else:
                self._execute(content[0], content[10:])

    def advance(self, dt_s: float) -> None:
        """Let time pass."""
        self._time_s += dt_s
        self._watch(dt_s)
        self._move_rails(dt_s)
        self._move_motor(dt_s)
        if self.force_n > OVERLOAD_N:
            self._flags |= OVERLOAD
            self._wanted[:] = 0.0
            self._mode, self._value = MOVING, LIFT_SPEED_M_S

    def state(self) -> bytes:
        """Return a state on the wire."""
        x, y = (round(place * XY_COUNTS_M) for place in self.position[:2])
        z = round((self.position[2] - self.machine.start_height_m) * Z_COUNTS_M)
        body = struct.pack('<iiiiBH', x, y, z, round(1e3 * self.force_n), self._flags, self.watchdog_stops % 2**16)
        self._sent += 1
        return framed(0x20, VERSION, self._sent - 1, round(self._time_s * 1e6), shape=(1, 1), body=body)

    def _execute(self, kind: int, body: bytes) -> None:
        self._silent_for_s = 0.0
        if kind == 0xA2:
            self._flags &= ~(OVERLOAD | STALL)
        if kind in (0xA1, 0xA2) or self._flags & (OVERLOAD | STALL):
            self._halt()
        elif kind == 0xA0 and len(body) == 13:
            vx, vy, mode, value = struct.unpack('<iiBi', body)
            self._wanted[:] = vx * 1e-6, vy * 1e-6
            new = (mode, value * (1e-3 if mode == PRESS else 1e-6))
            if new != (self._mode, self._value):
                self._flags &= ~LOCKED
            self._mode, self._value = new
            self._watching = True

    def _halt(self) -> None:
        self._wanted[:] = 0.0
        self._mode, self._watching = HOLD, False

    def _watch(self, dt_s: float) -> None:
        self._silent_for_s += dt_s
        if self._watching and self._silent_for_s > WATCHDOG_S:
            self.watchdog_stops += 1
            self._halt()

    def _move_rails(self, dt_s: float) -> None:
        change = ACCELERATION_M_S2 * dt_s
        self.velocity[:2] += np.clip(self._wanted - self.velocity[:2], -change, change)
        if self.machine.stalled and self._wanted.any():
            self.velocity[:2] = 0.0
            if self.machine.reports_stall:
                self._flags |= STALL
                self._halt()
        self.position[:2] += self.velocity[:2] * dt_s
        self._stop_at_ends()

    def _stop_at_ends(self) -> None:
        travel = self.machine.travel_m
        for axis in (0, 1):
            low, high = self.position[axis] <= -travel, self.position[axis] >= travel
            self._flags = (self._flags & ~(LOW[axis] | HIGH[axis])) | low * LOW[axis] | high * HIGH[axis]
            if low or high:
                self.position[axis] = np.clip(self.position[axis], -travel, travel)
                self.velocity[axis] = 0.0

    def _move_motor(self, dt_s: float) -> None:
        """Follow a speed at once, or press until the force is there and lock."""
        speed = self._value if self._mode == MOVING else 0.0
        if self._mode == PRESS and not self._flags & LOCKED:
            error = self._value - self.force_n
            if 0.0 <= error <= (1 - REACHED) * self._value:
                self._flags |= LOCKED
            else:
                speed = float(np.clip(-PRESS_GAIN_M_S_N * error, -PRESS_SPEED_M_S, PRESS_SPEED_M_S))
        top = self.machine.start_height_m + RISE_M
        before = self.position[2]
        self.position[2] = min(top, before + speed * dt_s)
        self._flags = (self._flags & ~TOP) | (self.position[2] >= top) * TOP
        self.velocity[2] = (self.position[2] - before) / dt_s


def _checked(segment: bytes) -> bytes | None:
    """Return a frame without its checksum, or None if it is damaged."""
    try:
        content = cobs_decode(segment)
    except ValueError:
        return None
    checked, checksum = content[:-2], content[-2:]
    return checked if len(checked) >= 10 and struct.pack('<H', binascii.crc_hqx(checked, 0xFFFF)) == checksum else None


# --------------------
# Common to emulated robots: finger states for the emulator; on a serial line a real-time thread and a plug.


@dataclass(frozen=True)
class FingerPipeParams:
    """Receiver of the finger state of an emulated robot."""

    finger_pipe: str = param('', "Path of the named pipe for the finger position that the emulator reads; '' for none.")


LineT = TypeVar('LineT', bound='EmulatedSerialRobot')


class EmulatedSerialRobot:
    """A robot in real time behind a device path, in a separate thread; usable as a context."""

    def __init__(self, link: Path, finger_pipe: str) -> None:
        self.port = PtyPort(link)
        self.emulator = FingerSender(finger_pipe)
        self.port_lock = threading.Lock()  # the port: it is unplugged by others
        self.closing = threading.Event()
        self._thread = threading.Thread(target=self.run, name=type(self).__name__, daemon=True)

    def run(self) -> None:
        """Let time go by until `closing`."""
        raise NotImplementedError

    def __enter__(self: LineT) -> LineT:
        self.port.plug()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.closing.set()
        self._thread.join()
        self.port.unplug()
        self.emulator.close()

    @property
    def running(self) -> bool:
        """Whether time goes by."""
        return self._thread.is_alive()

    def plug(self) -> None:
        """Plug it in again; it gets another device name."""
        with self.port_lock:
            self.port.plug()

    def unplug(self) -> None:
        """Pull its plug."""
        with self.port_lock:
            self.port.unplug()


# --------------------
# The rails of a PVDF finger on a pseudo-terminal.

STEP_S = 0.0025
STATE_STEPS = 4  # a state every 10 ms
MAX_STEPS = 40  # in one go, after the machine was busy


class EmulatedRails(EmulatedSerialRobot):
    """The rails on their line."""

    def __init__(
        self,
        link: Path,
        machine: RailsMachine | None = None,
        rng: np.random.Generator | None = None,
        finger_pipe: str = '',
    ) -> None:
        super().__init__(link, finger_pipe)
        self.faults = ByteFaults()
        self.firmware = RailsFirmware(machine or RailsMachine())
        self.silent = False
        self._rng = rng or np.random.default_rng(0)
        self._steps = 0

    def run(self) -> None:
        """Follow the orders that come, and send states."""
        due_s = time.monotonic()
        while not self.closing.wait(STEP_S):
            passed = int((time.monotonic() - due_s) / STEP_S)
            due_s += passed * STEP_S
            with self.port_lock:
                self.firmware.receive(self.port.read())
                for _ in range(min(passed, MAX_STEPS)):
                    self._step()

    def _step(self) -> None:
        self.firmware.advance(STEP_S)
        self._steps += 1
        if self._steps % STATE_STEPS:
            return
        state = self.firmware.state()
        if not self.silent:
            self.port.write(self.faults.apply(state, self._rng))
        x, y, z = self.firmware.position.tolist()
        vx, vy, vz = self.firmware.velocity.tolist()
        height, force = z - self.firmware.surface_m, self.firmware.force_n
        self.emulator.send(FingerState(time.monotonic_ns(), x, y, height, vx, vy, vz, force))

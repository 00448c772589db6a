# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Two linear rails with encoders and a pressing motor, behind a microcontroller on a serial line."""

from __future__ import annotations

import contextlib
import math
import termios
import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from struct import Struct

import serial

from texture_core.config import param
from texture_core.errors import DeviceError
from texture_core.framing import Frame, FrameDecoder, pack
from texture_core.types import DEVICES
from texture_exploration.arms.arm import Arm, ArmCommand, ArmState, Vector, check_command

# --------------------
# Numbers of the rails and of the line to their microcontroller: the machine of Hu et al. 2014, frames of this project.
#
# Commands and answers are frames of `texture_core.framing` with one row and one column, little endian:
#
# | kind | direction | body |
# |---|---|---|
# | 0xA0 move | to the rails | i32 vx, i32 vy in µm/s; u8 mode; i32 value |
# | 0xA1 stop | to the rails | – |
# | 0xA2 clear | to the rails | – |
# | 0x20 state | from the rails | i32 x, i32 y, i32 z in encoder counts; i32 force in mN; u8 flags; u16 watchdog stops
# |
#
# A state comes 100 times a second. Modes of the pressing motor: 0 it holds (it locks itself), 1 it moves at `value`
# µm/s, positive away from the surface, 2 it presses until `value` mN are reached, and locks. A motor without an encoder
# counts the commanded distance.

VERSION = 1
MOVE, STOP, CLEAR, STATE = 0xA0, 0xA1, 0xA2, 0x20
HOLD, MOVING, PRESS = 0, 1, 2
MOVE_BODY = Struct('<iiBi')
STATE_BODY = Struct('<iiiiBH')
STATE_PERIOD_S = 0.01
WATCHDOG_S = 0.15  # time for which a command holds
MICRO, MILLI = 1e6, 1e3

# Flags of a state.
LOW_X, HIGH_X, LOW_Y, HIGH_Y, TOP, LOCKED, OVERLOAD, STALL = (1 << bit for bit in range(8))
FAULTS = {
    OVERLOAD: 'its force sensor was overloaded, and the finger was lifted',
    STALL: 'an encoder does not follow its motor; is something in the way?',
}


# An unplugged port raises termios.error from tcflush, which is no OSError.
LINE_FAULTS = (serial.SerialException, OSError, termios.error, TypeError)
FIRST_STATE_S = 2.0
SPEED_OVER = 4  # states; a count of 5 µm in 30 ms is 0.7 % of 25.5 mm/s
READ_S = 0.05


@dataclass(frozen=True)
class RailsParams:
    """Device of the rails, and the scale of their encoders."""

    device: str = param(f'{DEVICES}/rails', 'Path of the serial device of the rails; the default is the emulated one.')
    xy_counts_m: float = param(200_000.0, 'Encoder counts per metre of the rails.', unit='1/m', low=1e3, high=1e8)
    z_counts_m: float = param(
        1_000_000.0, 'Encoder counts per metre of the pressing motor.', unit='1/m', low=1e3, high=1e8
    )
    height_m: float = param(0.01, 'Height of the finger above the surface at 0 counts.', unit='m', low=-0.5, high=0.5)


BAUD = 230400  # of a UART; a USB device ignores it


class RailsArm(Arm):
    """Two rails and a pressing motor behind a microcontroller (Hu et al. 2014)."""

    Params = RailsParams

    def __init__(self, params: RailsParams = RailsParams()) -> None:
        self._params = params
        self._port: serial.Serial | None = None
        self._thread: threading.Thread | None = None
        self._closing = threading.Event()
        self._fresh = threading.Event()
        self._failure = 'the rails are not connected; connect them first'
        self._deframer = FrameDecoder()
        self._sending = threading.Lock()
        self._sent = self._time_us = self._place_ns = 0  # the last two by the clock of the rails
        self._states: deque[tuple[int, Vector]] = deque(maxlen=SPEED_OVER)  # time by that clock, ns, and place
        self._state: ArmState | None = None

    def connect(self) -> None:
        """Open the line, clear faults and wait for the first state.

        Raises
        ------
        DeviceError
            If the device cannot be opened, or sends no state within 2 s.
        """
        self.close()
        self._closing.clear()
        self._fresh.clear()
        self._deframer.restart()
        self._states.clear()
        with self._line():
            self._port = serial.Serial(self._params.device, BAUD, exclusive=True, timeout=READ_S, write_timeout=0.2)
        self._failure = ''
        self._thread = threading.Thread(target=self._read, name='rails', daemon=True)
        self._thread.start()
        try:
            self._send(CLEAR)
            if not self._fresh.wait(FIRST_STATE_S):
                raise DeviceError(
                    self._failure
                    or f"device '{self._params.device}' is open and sends no state of rails; check that it is the "
                    f'right device, and its baud rate ({BAUD} is set)'
                )
        except DeviceError:
            self.close()
            raise

    def close(self) -> None:
        """Stop, and close the line."""
        if self._port is not None:
            with contextlib.suppress(DeviceError):
                self._send(STOP)
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self._port is not None:
            with contextlib.suppress(*LINE_FAULTS):
                self._port.close()
            self._port = None
        self._failure = self._failure or 'the rails are not connected; connect them first'

    def state(self) -> ArmState:
        """Return the newest state.

        Raises
        ------
        DeviceError
            If the rails are not connected or have stopped sending.
        """
        if self._failure or self._state is None:
            raise DeviceError(self._failure)
        return self._state

    def command(self, command: ArmCommand) -> None:
        """Send a command."""
        check_command(command, self.stop)
        vx, vy = (round(speed * MICRO) for speed in command.tangential_m_s)
        mode, value = MOVING, round(command.normal_m_s * MICRO)
        if command.force_n is not None:
            mode, value = PRESS, round(command.force_n * MILLI)
        elif value == 0:
            mode = HOLD
        self._send(MOVE, MOVE_BODY.pack(vx, vy, mode, value))

    def stop(self) -> None:
        """Stop the rails; the pressing motor locks."""
        self._send(STOP)

    def _send(self, kind: int, body: bytes = b'') -> None:
        if self._failure or self._port is None:
            raise DeviceError(self._failure)
        with self._sending, self._line():
            frame = Frame(kind, VERSION, self._sent, time.monotonic_ns() // 1000, 1, 1, body)
            self._sent += 1
            self._port.write(pack(frame))

    def _read(self) -> None:
        port = self._port
        assert port is not None
        with contextlib.suppress(DeviceError), self._line():
            while not self._closing.is_set():
                data = port.read(max(1, port.in_waiting))
                for frame in self._deframer.feed(data):
                    self._take(frame)

    def _take(self, frame: Frame) -> None:
        """Convert a frame to a state; frames of other kinds are those of the finger, on the same line."""
        if frame.kind != STATE:
            return
        if frame.version != VERSION or len(frame.body) != STATE_BODY.size:
            self._failure = (
                f'the rails send states of version {frame.version}, and {VERSION} is known; update the firmware '
                'or this package'
            )
            return
        x, y, z, force_mn, flags, _watchdog_stops = STATE_BODY.unpack(frame.body)
        per_m, params = self._params.xy_counts_m, self._params
        place: Vector = (x / per_m, y / per_m, params.height_m + z / params.z_counts_m)
        self._place_ns += 1000 * ((frame.time_us - self._time_us) % (1 << 32))
        self._time_us = frame.time_us
        self._states.append((self._place_ns, place))
        self._state = ArmState(
            time_ns=time.monotonic_ns(),
            position=place,
            velocity=self._velocity(),
            force_n=force_mn / MILLI,
            fault='; '.join(text for flag, text in FAULTS.items() if flags & flag),
            watchdog_s=WATCHDOG_S,
            place_ns=self._place_ns,  # by the clock of the rails: a busy machine receives states late, then many
        )
        self._fresh.set()

    def _velocity(self) -> Vector:
        """Return the speed by the clock of the rails, over the last states."""
        (begin_ns, first), (end_ns, last) = self._states[0], self._states[-1]
        passed_s = (end_ns - begin_ns) * 1e-9 or math.inf
        vx, vy, vz = ((b - a) / passed_s for a, b in zip(first, last, strict=True))
        return vx, vy, vz

    @contextlib.contextmanager
    def _line(self) -> Iterator[None]:
        try:
            yield
        except LINE_FAULTS as error:
            self._failure = (
                f"the rails on '{self._params.device}' cannot be reached ({error}); check that they are plugged in, "
                'that you may open the device, and that no other program has it open'
            )
            raise DeviceError(self._failure) from error

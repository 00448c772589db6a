# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A sensor at a serial port: find the port, open it, decode its packets, count what is broken or missing."""

from __future__ import annotations

import contextlib
import os
import termios
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import serial
from numpy.typing import NDArray
from serial.tools import list_ports

from texture_core.config import param
from texture_core.errors import DeviceError, InvalidParameter
from texture_core.framing import TIME_BITS, CounterUnwrapper, Frame, FrameDecoder
from texture_core.types import NANOSECONDS, Array, TactileSignal
from texture_drivers.health import Limits
from texture_drivers.sensor import SensorParams
from texture_drivers.timing import PPM, RATE_TOLERANCE, SLOW_CLOCK, StreamClock

# --------------------
# A stream of a framed protocol, as a sensor declares it.

VERSION = 1
SAMPLE = np.dtype('<i2')


@dataclass(frozen=True, eq=False)
class FramedStream:
    """What one kind of frames holds, and under what name and in what units it is published."""

    topic: str
    kind: int
    sensor: str
    rate_hz: float
    channels: tuple[str, ...]
    units: tuple[str, ...]
    gains: Array
    offsets: Array
    sample_s: float = 0.0  # that it takes to take a sample

    def __post_init__(self) -> None:
        if not len(self.channels) == len(self.units) == len(self.gains) == len(self.offsets) > 0:
            raise InvalidParameter(
                f"'{self.sensor}' has {len(self.channels)} channels, {len(self.units)} units, {len(self.gains)} gains "
                f'and {len(self.offsets)} offsets; give one of each for every channel'
            )

    @property
    def limits(self) -> tuple[Array, Array]:
        """Lowest and highest sample of each channel, (n_channels,) each."""
        counts = np.iinfo(SAMPLE)
        ends = np.array([self.gains * end + self.offsets for end in (counts.min, counts.max)], dtype=np.float32)
        return ends.min(axis=0), ends.max(axis=0)


# --------------------
# A serial port with one kind of error: DeviceError, whatever pyserial, the kernel or termios raise.

# An unplugged port raises termios.error from tcflush, which is no OSError.
PORT_ERRORS = (serial.SerialException, OSError, termios.error)
MAX_BYTES = 65536  # at once
MODEM_SETTLE_S = 0.2  # the vendor's pause between raising DTR and the first command


def baud_param(default: int) -> Any:
    """Return the parameter `baud` of a sensor on a line."""
    return param(
        default,
        'Baud rate of a real UART in bit/s; a USB device ignores it. It must equal that of the device.',
        low=9600,
        high=12_000_000,
    )


class Port(Protocol):
    """What a sensor reads its bytes from, opened by its constructor; a fault is a DeviceError."""

    def read(self, wait_s: float) -> bytes:
        """Wait, and return what has arrived."""

    def write(self, data: bytes) -> None:
        """Send."""

    def close(self) -> None:
        """Close; never raises."""


class SerialPort:
    """An exclusively opened serial device in raw mode."""

    def __init__(self, device: str, baud: int = 115200) -> None:
        self._device = device
        with self._faults():
            self._serial = serial.Serial(baudrate=baud, exclusive=True, timeout=0, write_timeout=0.5)
            self._serial.port = device
            self._serial.rts = False  # as the vendor does; pyserial raises DTR and passes over ports without the lines
            self._serial.open()
            if self._has_modem_lines():
                time.sleep(MODEM_SETTLE_S)
            self._serial.reset_input_buffer()

    def _has_modem_lines(self) -> bool:
        try:
            return self._serial.cts or True
        except OSError:  # a pseudo-terminal: ENOTTY
            return False

    def read(self, wait_s: float) -> bytes:
        """Wait, and return what has arrived."""
        time.sleep(wait_s)
        data = b''
        with self._faults():
            # The kernel returns 4 kB at once and holds more; what comes meanwhile is read next time.
            while (waiting := self._serial.in_waiting) and len(data) < MAX_BYTES:
                data += self._serial.read(waiting)
        return data

    def write(self, data: bytes) -> None:
        """Send."""
        with self._faults():
            self._serial.write(data)

    def close(self) -> None:
        """Close; never raises."""
        with contextlib.suppress(*PORT_ERRORS):
            self._serial.close()

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        try:
            yield
        except PORT_ERRORS as error:
            raise DeviceError(
                f"device '{self._device}' cannot be used ({reason_of(error)}); check that it is plugged in, "
                'that you may open it, and that no other program has it open'
            ) from error


def reason_of(error: Exception) -> str:
    """Return the message of the operating system about a fault, without the path that pyserial repeats."""
    code = error.args[0] if len(error.args) > 1 else None  # termios.error has no errno
    return os.strerror(code) if isinstance(code, int) else str(error)


# --------------------
# A sensor that streams samples over a serial port, whatever its protocol.

SILENCE_S = 1.0  # the device sends unrequested; opening the port again often restarts it


class SerialSensor:
    """Read the streams of one device. See `texture_core.types.Sensor`; each kind turns the bytes into batches."""

    def __init__(
        self,
        params: SensorParams,
        now_ns: Callable[[], int],
        *,
        baud: int = 115200,
        start_command: bytes = b'',
        stop_command: bytes = b'',
    ) -> None:
        self._params = params
        self._now_ns = now_ns
        self._baud = baud
        self._start_command = start_command
        self._stop_command = stop_command
        self._path = params.device
        self._port: Port | None = None
        self._opened = 0
        self._silent_s, self._babbles = 0.0, False

    def open(self) -> None:
        """Open the device and start its stream; DeviceError if it cannot be reached."""
        self.close()
        self._port = self._open_port()
        self.send(self._start_command)
        self._opened += 1
        self._silent_s, self._babbles = 0.0, False
        self.restart()

    def _open_port(self) -> Port:
        return SerialPort(self._path, self._baud)

    def send(self, command: bytes) -> None:
        """Send a command; b'' sends nothing."""
        port = self._opened_port()
        if command:
            port.write(command)

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for the length of one batch and return what arrived."""
        data = self._opened_port().read(self._params.batch_s)
        arrival_ns = self._now_ns()
        frames = self.valid_frames
        batches = self.feed(data, arrival_ns)
        alive = self.valid_frames > frames
        self._silent_s = 0.0 if alive else self._silent_s + self._params.batch_s
        self._babbles = not alive and (self._babbles or bool(data))  # since the last valid frame, not in the last read
        self._act_on_silence()
        return batches

    def close(self) -> None:
        """Stop the stream and close the device."""
        if self._port is None:
            return
        with contextlib.suppress(DeviceError):  # if it is gone there is nothing to stop
            self.send(self._stop_command)
        self._port.close()
        self._port = None

    @property
    def valid_frames(self) -> int:
        """How many valid frames have come in all."""
        raise NotImplementedError

    def restart(self) -> None:
        """Resume after an interruption, with the index according to the host's clock."""
        raise NotImplementedError

    def feed(self, data: bytes, arrival_ns: int) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches, by topic, in `data`, which has just arrived; none in the first 0.1 s of a stream."""
        raise NotImplementedError

    @property
    def counts(self) -> Mapping[str, int]:
        """How often the device was opened again; each kind adds its totals, such as 'samples', 'lost', 'bogus'."""
        return {'reopened': max(0, self._opened - 1)}

    @property
    def details(self) -> Mapping[str, str | float]:
        """What the stream shows in addition to the samples, such as the drift of the device's clock."""
        return {}

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        raise NotImplementedError

    @property
    def limits(self) -> Limits:
        """Lowest and highest sample by topic, where they are known."""
        return {}

    def _opened_port(self) -> Port:
        if self._port is None:
            raise DeviceError(f"device '{self._params.device}' is not open; open it before reading")
        return self._port

    def _act_on_silence(self) -> None:
        """Raise DeviceError when the device has been silent for too long."""
        if self._silent_s >= SILENCE_S:
            raise DeviceError(self._silence_sentence())

    def _silence_sentence(self) -> str:
        what, check = 'nothing', 'that its firmware runs'
        if self._babbles:
            what, check = 'bytes but no valid frame', f'its baud rate ({self._baud} is set)'
        return (
            f"device '{self._params.device}' is open and sends {what}; check that it is the right device, and {check}"
        )


# --------------------
# Place the blocks of a stream in time and note what is missing between them.

MICROSECONDS = 1_000_000


class StreamBlock(NamedTuple):
    """The samples of one frame, with unwrapped time."""

    time_us: int
    rows: int
    lost_frames: int
    data: bytes


RATE_CHECK_S = 1.0
MAX_FAILED_CHECKS = 3  # consecutive failures that are no transient


class StreamTracker:
    """Follow one stream: number its blocks so that a jump is exactly what was lost, and join those without a gap.

    The device's time shows how many samples are missing, wherever they were lost: lost frames of the line show in their
    numbers, what is missing beyond them was left out by the device itself and counts as `overrun`.
    """

    def __init__(self, stream: FramedStream) -> None:
        self.stream = stream
        self.samples = 0  # published
        self.lost = 0  # between the first one published and the last
        self.overrun = 0  # samples that the device itself left out
        self.wrong_rate = False  # until a check is passed nothing is published, also after an interruption
        self._next_index = 0
        self._next_us: float | None = None  # when the next sample is due by the device's clock
        self._due_ns: int | None = None  # when the next sample would have come, had there been no interruption
        self._carried = 0.0  # lost in interruptions and not counted yet: less than a sample; below 0: counted too many
        self._published: int | None = None  # index after the last one
        self._restart_check()

    def end_us(self, block: StreamBlock) -> int:
        """Return the device's time at the end of a block's last sample."""
        return block.time_us + round(((block.rows - 1) / self.stream.rate_hz + self.stream.sample_s) * MICROSECONDS)

    def interrupt(self, clock: StreamClock) -> None:
        """Note by the old clock when the next sample is due."""
        if self._next_us is not None and clock.settled:
            self._due_ns = clock.time_ns(self._next_us)
        self._next_us = None
        self._restart_check()

    def place(self, time_us: int, rows: int, lost_frames: int) -> int:
        """Return the index of a block's first sample."""
        skipped = 0
        if self._next_us is not None:
            skipped = max(0, round((time_us - self._next_us) * self.stream.rate_hz / MICROSECONDS))
        self.overrun += max(0, skipped - lost_frames * rows)
        self._check_rate(time_us, rows, lost_frames)
        index = self._next_index + skipped
        self._next_index = index + rows
        self._next_us = time_us + rows * MICROSECONDS / self.stream.rate_hz
        return index

    def runs(self, blocks: Sequence[StreamBlock], clock: StreamClock) -> list[tuple[int, int, bytes]]:
        """Return index, stamp in ns and bytes of the samples of consecutive blocks: a new run wherever some miss."""
        if self._due_ns is not None:
            late_ns = max(0.0, clock.time_ns(blocks[0].time_us) - self._due_ns)
            missing = self._carried + late_ns * self.stream.rate_hz / NANOSECONDS
            self._next_index += max(0, round(missing))
            self._carried, self._due_ns = missing - max(0, round(missing)), None
        runs: list[tuple[int, int, list[bytes]]] = []
        for block in blocks:
            expected = self._next_index
            index = self.place(block.time_us, block.rows, block.lost_frames)
            if not self.wrong_rate:
                self.lost += 0 if self._published is None else index - self._published
                self._published = index + block.rows
                self.samples += block.rows
            if not runs or index != expected:
                runs.append((index, block.time_us, []))
            runs[-1][2].append(block.data)
        return [(index, clock.time_ns(time_us), b''.join(data)) for index, time_us, data in runs]

    def _restart_check(self) -> None:
        self._since_us: int | None = None
        self._rows = 0
        self._failed_checks = 0

    def _check_rate(self, time_us: int, rows: int, lost_frames: int) -> None:
        """Compare rows, those of lost frames included, with time."""
        if self._since_us is None:
            self._since_us, self._rows = time_us, rows
            return
        self._rows += lost_frames * rows
        elapsed_s = (time_us - self._since_us) / MICROSECONDS
        if elapsed_s >= RATE_CHECK_S:
            rate_hz = self._rows / elapsed_s
            off = abs(rate_hz / self.stream.rate_hz - 1) > RATE_TOLERANCE
            self._failed_checks = self._failed_checks + 1 if off else 0
            self.wrong_rate = off and (self.wrong_rate or self._failed_checks == MAX_FAILED_CHECKS)
            if self.wrong_rate:
                raise DeviceError(
                    f"'{self.stream.sensor}' delivers {rate_hz:.4g} samples in a second of the device's clock, and "
                    f'{self.stream.rate_hz:.4g} are needed; correct the timer of the device, or for a DAQ '
                    'finger the rate in the settings, or lighten the load of the device'
                )
            self._since_us, self._rows = time_us, 0
        self._rows += rows


# --------------------
# Streams of samples on a framed serial line: numbered, timed, in physical units.
#
# Each frame (see `texture_core.framing`) carries `rows` consecutive samples of `columns` channels as int16, little
# endian, row after row; its kind identifies the stream, its time is that of the first row.

LONGEST_STEP_US = 10 * MICROSECONDS  # a clock that jumps further is another one; the host's clock gives the gap


class FramedSensor(SerialSensor):
    """Read the streams of a framed serial line, all timed by one clock.

    Frames of other kinds are passed over, so that other traffic may share the line.
    """

    def __init__(
        self,
        params: SensorParams,
        now_ns: Callable[[], int],
        streams: Sequence[FramedStream],
        *,
        baud: int = 115200,
        max_drift: float = 5e-3,
    ) -> None:
        super().__init__(params, now_ns, baud=baud)
        self.malformed = 0  # frames that passed the checksum and hold another number of bytes than declared
        self.other_frames = 0  # frames of other kinds
        self._known_frames = 0
        self._other_kinds: set[int] = set()  # since the last known frame
        self.restarts = 0  # of the device's clock
        self.deframer = FrameDecoder()
        self.clock = StreamClock(MICROSECONDS, max_drift=max_drift)
        self.trackers = {stream.kind: StreamTracker(stream) for stream in streams}
        self._time = CounterUnwrapper(TIME_BITS)
        self._latest_us: dict[int, int] = {}  # time of the last block of each kind
        self._newest_us = 0

    @property
    def valid_frames(self) -> int:
        """Frames of the known kinds that hold samples."""
        return self._known_frames

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples published and lost, frames refused or passed over, and new beginnings."""
        trackers = self.trackers.values()
        return {
            'samples': sum(tracker.samples for tracker in trackers),
            'lost': sum(tracker.lost for tracker in trackers),
            'left out by the device': sum(tracker.overrun for tracker in trackers),
            'bogus': self.deframer.bad_frames + self.malformed,
            'repeated frames': self.deframer.repeated,
            'other frames': self.other_frames,
            'device restarts': self.restarts,
            'clock_steps': self.clock.steps,
            **super().counts,
        }

    @property
    def details(self) -> Mapping[str, str | float]:
        """How much the device's clock is slow."""
        return {SLOW_CLOCK: PPM * self.clock.drift}

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        return {tracker.stream.topic: tracker.stream.rate_hz for tracker in self.trackers.values()}

    @property
    def limits(self) -> Limits:
        """Lowest and highest sample by topic: those of an int16."""
        return {tracker.stream.topic: tracker.stream.limits for tracker in self.trackers.values()}

    def restart(self) -> None:
        """Resume after an interruption, with the index according to the host's clock."""
        self.deframer.restart()
        self._other_kinds = set()
        self._restart_streams()

    def feed(self, data: bytes, arrival_ns: int) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches in `data`, which has just arrived; none in the first 0.1 s of a stream."""
        blocks = self._blocks(self.deframer.feed(data))
        if not blocks:
            return {}
        newest_us = max(self.trackers[kind].end_us(found[-1]) for kind, found in blocks.items())
        if newest_us >= self._newest_us:  # an older block of a slower stream adds nothing new
            self.clock.observe(newest_us, arrival_ns)
            self._newest_us = newest_us
        if not self.clock.settled:
            return {}
        topics: dict[str, list[TactileSignal]] = {}
        for kind, found in blocks.items():
            tracker = self.trackers[kind]
            for run in tracker.runs(found, self.clock):
                for topic, batch in self._batches(tracker.stream, *run):
                    if not tracker.wrong_rate:
                        topics.setdefault(topic, []).append(batch)
        return topics

    def _batches(
        self, stream: FramedStream, index: int, stamp_ns: int, data: bytes
    ) -> Iterable[tuple[str, TactileSignal]]:
        """Return topic and batch of consecutive samples."""
        counts: NDArray[np.int16] = np.frombuffer(data, dtype=SAMPLE).reshape(-1, len(stream.channels))
        samples = (counts * stream.gains + stream.offsets).astype(np.float32)
        batch = TactileSignal(
            stamp_ns,
            stream.sensor,
            stream.channels,
            stream.units,
            stream.rate_hz,
            index,
            samples,
            self._params.frame_id,
        )
        return [(stream.topic, batch)]

    def _restart_streams(self) -> None:
        for tracker in self.trackers.values():
            tracker.interrupt(self.clock)
        self.clock.restart()
        self._time = CounterUnwrapper(TIME_BITS)
        self._latest_us = {}
        self._newest_us = 0

    def _blocks(self, frames: Sequence[Frame]) -> dict[int, list[StreamBlock]]:
        """Return the blocks of each stream; those before a restart of the device's clock are dropped."""
        blocks: dict[int, list[StreamBlock]] = {}
        for frame in frames:
            rows = self._rows(frame)
            if not rows:
                continue
            if self._has_restarted(frame):
                self.restarts += 1
                self._restart_streams()
                blocks = {}
            time_us = self._latest_us[frame.kind] = self._time.advance(frame.time_us)
            blocks.setdefault(frame.kind, []).append(StreamBlock(time_us, rows, frame.lost, frame.body))
        return blocks

    def _has_restarted(self, frame: Frame) -> bool:
        """Return whether the device's clock went back, within one stream, or leapt."""
        if self._time.value is None:
            return False
        step_us = self._time.step(frame.time_us)
        moved_back = self._time.value + step_us < self._latest_us.get(frame.kind, self._time.value + step_us)
        return moved_back or abs(step_us) > LONGEST_STEP_US

    def _rows(self, frame: Frame) -> int:
        """Return how many samples a frame holds; 0 if it is passed over."""
        tracker = self.trackers.get(frame.kind)
        if tracker is None:
            self.other_frames += 1
            self._other_kinds.add(frame.kind)
            return 0
        if frame.version != VERSION:
            raise DeviceError(
                f"'{tracker.stream.sensor}' sends frames of version {frame.version}, and {VERSION} is known; update "
                'the device or this driver'
            )
        rows = self._rows_of(tracker.stream, frame)
        self.malformed += not rows
        if rows:
            self._known_frames += 1
            self._other_kinds = set()
        return rows

    def _silence_sentence(self) -> str:
        if not self._other_kinds:
            return super()._silence_sentence()
        came, wanted = (
            ', '.join(f'0x{kind:02X}' for kind in sorted(kinds)) for kinds in (self._other_kinds, self.trackers)
        )
        return (
            f"device '{self._params.device}' is open and sends frames of kind {came} instead of {wanted}; check that "
            'it is the right device, and the kind in its firmware'
        )

    def _rows_of(self, stream: FramedStream, frame: Frame) -> int:
        """Return how many samples a frame of a stream holds; 0 if it contradicts itself."""
        if frame.columns != len(stream.channels):
            raise DeviceError(
                f"'{stream.sensor}' sends {frame.columns} channels, and {len(stream.channels)} are named "
                f'{list(stream.channels)}; correct the channels in the settings'
            )
        return frame.rows if len(frame.body) == frame.rows * frame.columns * SAMPLE.itemsize else 0


# --------------------
# Find a serial device by the numbers that its maker was given for USB.

AUTO = 'auto'
UsbId = tuple[int, int]  # vendor, product


# Ports as pyserial lists them: device, and vid, pid and serial_number, which may be None.
ListPorts = Callable[[], Iterable[Any]]


def resolve(device: str, usb_ids: Sequence[UsbId], kind: str, ports: ListPorts = list_ports.comports) -> str:
    """Return the path that is meant: `device` itself, or for 'auto' that of the only port with one of the numbers."""
    if device != AUTO:
        return device
    listed = list(ports())
    found = sorted(str(port.device) for port in listed if (port.vid, port.pid) in usb_ids)
    if len(found) == 1:
        return found[0]
    if found:
        raise DeviceError(
            f"device 'auto' may be any of {len(found)} {kind}s: {', '.join(found)}; set the parameter device to one"
        )
    seen = ', '.join(sorted(_description(port) for port in listed)) or 'none'
    wanted = ' or '.join(_numbers(*usb_id) for usb_id in usb_ids)
    raise DeviceError(
        f"device 'auto' is no {kind} ({wanted}): the serial ports here are {seen}; plug it in, or set the parameter "
        'device to its path'
    )


def serial_number(device: str, ports: ListPorts = list_ports.comports) -> str:
    """Return the serial number of the USB device behind a path, '' if it has none."""
    path = str(Path(device).resolve())
    return next((port.serial_number or '' for port in ports() if port.device == path), '')


def _description(port: Any) -> str:
    if port.vid is None or port.pid is None:
        return str(port.device)
    return f'{port.device} ({_numbers(port.vid, port.pid)})'


def _numbers(vendor: int, product: int) -> str:
    return f'{vendor:04X}:{product:04X}'

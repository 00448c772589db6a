# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""SynTouch BioTac: protocol over a Cheetah adapter, messages of the vendor's driver, the sensor."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import DeviceError, InvalidData
from texture_core.framing import SEQUENCE_BITS, TIME_BITS, CounterUnwrapper, Frame, FrameDecoder
from texture_core.types import NANOSECONDS, TactileSignal
from texture_drivers.health import Limits
from texture_drivers.sensor import SensorParams
from texture_drivers.serial_line import SerialPort
from texture_drivers.timing import PPM, SLOW_CLOCK, PacketNumbering, StreamClock

# --------------------
# How the replies of a BioTac board reach this computer: what every link offers.


class SpiFrame(NamedTuple):
    """The reply to all sampling commands of one frame."""

    epoch: int
    number: int
    time_us: int
    fingers: int
    reply: bytes


class SpiLink:
    """The link to a board; `counts` are totals kept over reopening."""

    max_drift: float  # largest relative error of its clock
    serials: tuple[str, ...] = ()  # of the BioTac at each place, '' where there is none

    def open(self) -> None:
        """Open the link and start sampling; DeviceError if it is missing."""
        raise NotImplementedError

    def read(self) -> Sequence[SpiFrame]:
        """Wait for about one frame and return those that came, in order; DeviceError if the device is gone."""
        raise NotImplementedError

    def close(self) -> None:
        """Stop; never raises, may be called twice."""
        raise NotImplementedError

    @property
    def counts(self) -> Mapping[str, int]:
        """Return the faults of the link."""
        raise NotImplementedError


# --------------------
# Numbers of the BioTac's protocol and streams.
#
# Sources: "BioTac C Library Manual for Cheetah" v1.1.0 (frame, slot time, adapter settings), "BioTac QuickStart Guide"
# (meaning of the channels); kth-ros-pkg/biotac_driver @6fb8e33 `biotac_sensors/include/biotac_sensors/biotac.h`
# (commands, error words, chip selects); for the BioTac SP CNCR-NTU/biotac_sp_ros @e9f69b9.

SLOT_RATE_HZ = 4400.0  # samplings of any channel; a slot is 227.27 µs
SLOT_NS = NANOSECONDS / SLOT_RATE_HZ
FULL_SCALE = 4095  # 12 bits

# A sampling command is bit 7, the channel's index in bits 6..1, and a bit that makes the number of ones odd.
SAMPLE = 0x80
FIRST_ELECTRODE = 17
INDICES: Mapping[str, int] = {
    'pac': 0,
    'pdc': 1,
    'tac': 2,
    'tdc': 3,
    **{f'electrode{number}': FIRST_ELECTRODE + number - 1 for number in range(1, 25)},
}
# What a BioTac answers instead of a value when it does not like a command. The first byte has even parity.
ERROR_WORDS: Mapping[int, str] = {
    0xA545: 'bad parity of the command',
    0xA53F: 'unknown command',
    0xA52E: 'commands too close together',
    0xA52D: 'sampling commands too close together',
    0xA558: 'unknown channel',
    0xA55F: 'nothing to send again',
    0xA552: 'parameter is read-only',
    0xA557: 'writing failed',
}
ECHO_BYTES = 2  # came back while the command went out
WORD_BYTES = 2  # of each BioTac, after the echo

PAC = 'pac'
PAC_SENSOR, SLOW_SENSOR = 'biotac/pac', 'biotac/slow'
UNIT = 'count'


def sampling_command(channel: str) -> int:
    """Return the byte that samples a channel, such as 0x80 for 'pac' and 0xA2 for 'electrode1'."""
    byte = SAMPLE | INDICES[channel] << 1
    return byte | (byte.bit_count() + 1) % 2


@dataclass(frozen=True)
class BioTacLayout:
    """In which order the channels of one kind of BioTac are sampled: every second slot is PAC."""

    electrodes: int

    @cached_property
    def slots(self) -> tuple[str, ...]:
        """The channel sampled in each slot of a frame."""
        slow = (*(f'electrode{number}' for number in range(1, self.electrodes + 1)), 'pdc', 'tac', 'tdc')
        return tuple(channel for name in slow for channel in (name, PAC))

    @cached_property
    def slow_channels(self) -> tuple[str, ...]:
        """The channels sampled once a frame, in the order they are published."""
        return ('tdc', 'tac', 'pdc', *(f'electrode{number}' for number in range(1, self.electrodes + 1)))

    @cached_property
    def slow_slots(self) -> tuple[int, ...]:
        """The slot of each slow channel."""
        return tuple(self.slots.index(channel) for channel in self.slow_channels)

    @property
    def pac_per_frame(self) -> int:
        """How often a frame samples PAC; sample k in slot 2k + 1."""
        return len(self.slots) // 2

    @property
    def frame_s(self) -> float:
        """Length of a frame."""
        return len(self.slots) / SLOT_RATE_HZ

    @property
    def frame_rate_hz(self) -> float:
        """Frames per second, the rate of every slow channel."""
        return SLOT_RATE_HZ / len(self.slots)

    @property
    def pac_rate_hz(self) -> float:
        """Rate of PAC."""
        return SLOT_RATE_HZ / 2

    def frame_bytes(self, fingers: int) -> int:
        """Return the length of the reply to one frame from a board with this many BioTacs."""
        return len(self.slots) * (ECHO_BYTES + WORD_BYTES * fingers)


def signal_makers(
    layout: BioTacLayout, pac_rate_hz: float, slow_rate_hz: float, frame_id: str
) -> tuple[Callable[..., TactileSignal], Callable[..., TactileSignal]]:
    """Return what makes the batches of PAC and of the slow channels, out of stamp, first sample and samples."""
    slow = {'channels': layout.slow_channels, 'units': (UNIT,) * len(layout.slow_channels)}
    signal = partial(TactileSignal, frame_id=frame_id)
    return (
        partial(signal, sensor=PAC_SENSOR, channels=(PAC,), units=(UNIT,), sampling_rate_hz=pac_rate_hz),
        partial(signal, sensor=SLOW_SENSOR, sampling_rate_hz=slow_rate_hz, **slow),
    )


LAYOUTS: Mapping[str, BioTacLayout] = {
    'biotac': BioTacLayout(electrodes=19),  # 44 slots, 100 frames/s
    'biotac_sp': BioTacLayout(electrodes=24),  # 54 slots, 81.5 frames/s
}
FINGERS = 5  # most that one board holds


# --------------------
# A microcontroller that samples a BioTac board over SPI and streams the replies over a serial line.
#
# A design of this project, for users without a Cheetah adapter: see docs/sensors.md. It sends unrequested, framed as in
# `texture_core.framing`: the reply to one frame of sampling commands in each, and now and then the serial numbers.

VERSION = 1
REPLY, SERIALS = 0x42, 0x53  # kinds of frames: 'B' and 'S'
POLLS = 5  # looks at the port per waiting time: the arrival of a frame gives its time
LATE_FRAMES = 0.5  # a frame further than this from where its number puts it: the bridge stopped or restarted
RATE_CHECK_S = 1.0
RATE_TOLERANCE = 0.02  # far more than clocks differ, far less than slots made of delays instead of by a timer


class SerialBridge(SpiLink):
    """The replies that a bridge sends, in order and each once. See `SpiLink`."""

    max_drift = 5e-3  # the internal oscillator of a microcontroller on USB is right to 0.25 %

    def __init__(self, device: str, layout: BioTacLayout, wait_s: float = 0.01) -> None:
        self._device = device
        self._layout = layout
        self._wait_s = wait_s
        self._port: SerialPort | None = None
        self._deframer = FrameDecoder()
        self._tracker = FrameTracker(layout)
        self._unknown_frames = 0

    def open(self) -> None:
        """Open the port; DeviceError if it is not there."""
        self.close()
        self._port = SerialPort(self._device)
        self._deframer.restart()
        self._tracker.restart()

    def read(self) -> Sequence[SpiFrame]:
        """Wait for bytes and return the replies they complete."""
        if self._port is None:
            raise DeviceError(f"device '{self._device}' is not open; open it before reading")
        data = b''
        for _ in range(POLLS):
            time.sleep(self._wait_s / POLLS)
            data += self._port.read()
            if data:
                break
        return [reply for frame in self._deframer.feed(data) if (reply := self._decode(frame)) is not None]

    def close(self) -> None:
        """Close the port."""
        if self._port is not None:
            self._port.close()
            self._port = None

    @property
    def counts(self) -> Mapping[str, int]:
        """Damaged or unknown frames, frames that came twice, and stops or resets of the device."""
        return {
            'bogus': self._deframer.bad_frames + self._unknown_frames,
            'repeated': self._deframer.repeated,
            'restarts': self._tracker.restarts,
        }

    def _decode(self, frame: Frame) -> SpiFrame | None:
        """Return the reply in a frame, if it is one."""
        if frame.version == VERSION and frame.kind == SERIALS:
            self.serials = tuple(frame.body.decode('ascii', 'replace').split(','))
            return None
        fits = frame.columns > 0 and len(frame.body) == frame.rows * (ECHO_BYTES + WORD_BYTES * frame.columns)
        if frame.version != VERSION or frame.kind != REPLY or not fits:
            self._unknown_frames += 1
            return None
        if frame.rows != len(self._layout.slots):
            raise DeviceError(
                f"the bridge on '{self._device}' samples frames of {frame.rows} slots, and this kind of BioTac has "
                f'{len(self._layout.slots)}; choose the sensor with the right one, or change the bridge'
            )
        return self._tracker.place(frame)


class FrameTracker:
    """Unwrap the numbers and the clock of a device, and detect when they restart."""

    def __init__(self, layout: BioTacLayout) -> None:
        self.restarts = 0
        self._epoch = 0
        self._frame_us = layout.frame_s * 1e6
        self.restart()

    def restart(self) -> None:
        """Begin a new epoch: another stream."""
        self._epoch += 1
        self._number = CounterUnwrapper(SEQUENCE_BITS)
        self._time_us = CounterUnwrapper(TIME_BITS)
        self._checked: SpiFrame | None = None

    def place(self, frame: Frame) -> SpiFrame:
        """Return the frame with its number and time."""
        steps, elapsed_us = self._number.step(frame.sequence), self._time_us.step(frame.time_us)
        late_us = abs(elapsed_us - steps * self._frame_us)
        steady = steps > 0 and late_us <= (LATE_FRAMES + RATE_TOLERANCE * steps) * self._frame_us
        if self._number.value is not None and not steady:
            self.restarts += 1
            self.restart()
        number, time_us = self._number.advance(frame.sequence), self._time_us.advance(frame.time_us)
        unwrapped = SpiFrame(self._epoch, number, time_us, frame.columns, frame.body)
        self._check_rate(unwrapped)
        return unwrapped

    def _check_rate(self, frame: SpiFrame) -> None:
        before = self._checked or frame
        elapsed_us = frame.time_us - before.time_us
        if elapsed_us < RATE_CHECK_S * 1e6:
            self._checked = before
            return
        self._checked = frame
        frame_us = elapsed_us / (frame.number - before.number)
        if abs(frame_us / self._frame_us - 1) > RATE_TOLERANCE:
            raise DeviceError(
                f'the bridge takes {frame_us / 1000:.2f} ms for a frame, and {self._frame_us / 1000:.2f} ms are needed'
                '; let a timer of the bridge start a slot every 227.27 µs'
            )


# --------------------
# The Total Phase Cheetah SPI adapter, through the vendor's Python module `cheetah_py`.
#
# That module and its library are not free and not part of this project; they come with the adapter.
# The calls and their values are those of kth-ros-pkg/biotac_driver @6fb8e33 `biotac_sensors/src/biotac.c`. This file
# has never been run on the hardware; its tests run against a mock.

MODULE = 'cheetah_py'
BITRATE_KHZ = 4400
POWER_SETTLE_MS = 100
AFTER_SAMPLE_NS, BETWEEN_WORDS_NS = 50_000, 10_000
OVERHEAD_NS = 3_000  # of a slot, as the vendor's library reckons
SELECT_ALL, SELECT_NONE = 0x07, 0x00
SELECT = (0x01, 0x02, 0x04)  # the places of a board for three BioTacs
READ_PROPERTY, SERIAL_NUMBER = 0x61, 0x15
SERIAL_BYTES, SERIAL_START = 16, 'BT'
MODE_0 = (0, 0)  # clock idles low, sampled at the first edge
QUEUED_FRAMES = 16  # submitted ahead: the adapter samples on while the host is busy
ADAPTERS = 16


class Cheetah(SpiLink):
    """Frames sampled back to back by a Cheetah adapter. See `SpiLink`."""

    max_drift = 2e-2  # the slots are made of delays, whose sum is nominal

    def __init__(self, layout: BioTacLayout, now_s: Callable[[], float] = time.monotonic) -> None:
        self._layout = layout
        self._now_s = now_s
        self._api: Any = None
        self._handle = 0
        self._epoch = self._number = self._pauses = 0
        self._last_s = 0.0
        self._pause_at: int | None = None

    def open(self) -> None:
        """Open the first free adapter and start sampling; DeviceError if there is none."""
        self.close()
        try:
            self._api = importlib.import_module(MODULE)
        except ImportError as error:
            raise DeviceError(
                f"the Cheetah adapter needs Total Phase's Python module '{MODULE}' and its library, which cannot be "
                f'imported ({error}); put them on PYTHONPATH, or use a serial bridge as the device'
            ) from error
        self._handle = self._open_first()
        self._configure()
        self.serials = tuple(self._serial(select) for select in SELECT)
        self._queue_frame()
        for _ in range(QUEUED_FRAMES):
            self._checked(self._api.ch_spi_async_submit(self._handle), 'submitting commands')
        self._epoch += 1
        self._number = 0
        self._last_s = self._now_s()
        self._pause_at = None

    def read(self) -> Sequence[SpiFrame]:
        """Wait for one frame and return it."""
        if not self._handle:
            raise DeviceError('the Cheetah adapter is not open; open it before reading')
        size = self._layout.frame_bytes(len(SELECT))
        received, data = self._api.ch_spi_async_collect(self._handle, size)
        self._checked(received, 'collecting replies')
        self._checked(self._api.ch_spi_async_submit(self._handle), 'submitting commands')
        if received != size:
            raise DeviceError(f'the Cheetah adapter returned {received} bytes of {size}; replug it')
        self._note_pauses()
        time_us = round(self._number * self._layout.frame_s * 1e6)
        frame = SpiFrame(self._epoch, self._number, time_us, len(SELECT), bytes(data))
        self._number += 1
        return [frame]

    def close(self) -> None:
        """Let the adapter go."""
        if self._handle:
            self._api.ch_close(self._handle)
            self._handle = 0

    @property
    def counts(self) -> Mapping[str, int]:
        """How often sampling paused because the host was away."""
        return {'pauses': self._pauses}

    def _note_pauses(self) -> None:
        """Begin a new epoch after the frames still queued, when the host was away for longer than they lasted."""
        now_s = self._now_s()
        if now_s - self._last_s > QUEUED_FRAMES * self._layout.frame_s:
            self._pauses += 1
            self._pause_at = self._number + QUEUED_FRAMES
        self._last_s = now_s
        if self._number == self._pause_at:
            self._epoch += 1
            self._pause_at = None

    def _open_first(self) -> int:
        found, ports, _ = self._api.ch_find_devices_ext(ADAPTERS, ADAPTERS)
        free = [port for port in list(ports)[: max(0, found)] if not port & self._api.CH_PORT_NOT_FREE]
        if not free:
            raise DeviceError(
                f'no free Cheetah adapter ({max(0, found)} found); plug it in, or close the program using it'
            )
        return int(self._checked(self._api.ch_open(free[0]), 'opening'))

    def _configure(self) -> None:
        api, handle = self._api, self._handle
        self._checked(api.ch_spi_configure(handle, *MODE_0, api.CH_SPI_BITORDER_MSB, 0), 'configuring')
        self._checked(api.ch_target_power(handle, api.CH_TARGET_POWER_ON), 'powering the board')
        api.ch_sleep_ms(POWER_SETTLE_MS)
        self._checked(api.ch_spi_bitrate(handle, BITRATE_KHZ), 'setting the bit rate')
        api.ch_spi_queue_clear(handle)
        api.ch_spi_queue_oe(handle, 1)

    def _serial(self, select: int) -> str:
        """Return the serial number of the BioTac at a place, '' if there is none."""
        api, handle = self._api, self._handle
        api.ch_spi_queue_clear(handle)
        api.ch_spi_queue_ss(handle, select)
        api.ch_spi_queue_byte(handle, 1, READ_PROPERTY)
        api.ch_spi_queue_byte(handle, 1, SERIAL_NUMBER)
        api.ch_spi_queue_ss(handle, SELECT_NONE)
        api.ch_spi_queue_delay_ns(handle, AFTER_SAMPLE_NS)
        api.ch_spi_queue_ss(handle, select)
        api.ch_spi_queue_byte(handle, SERIAL_BYTES, 0)
        api.ch_spi_queue_ss(handle, SELECT_NONE)
        received, data = api.ch_spi_batch_shift(handle, 2 + SERIAL_BYTES)
        self._checked(received, 'reading serial numbers')
        text = bytes(data)[2:].decode('ascii', 'replace')
        return text if text.startswith(SERIAL_START) else ''

    def _queue_frame(self) -> None:
        """Queue the commands of one frame: each is given to all BioTacs at once, then one after the other is read."""
        api, handle = self._api, self._handle
        words, selections = 1 + len(SELECT), 3 + len(SELECT)
        shifting_ns = (16 * words + 8 * selections) / BITRATE_KHZ * 1e6
        rest_ns = round(1e9 / SLOT_RATE_HZ - shifting_ns - AFTER_SAMPLE_NS - BETWEEN_WORDS_NS - OVERHEAD_NS)
        api.ch_spi_queue_clear(handle)
        for channel in self._layout.slots:
            api.ch_spi_queue_ss(handle, SELECT_ALL)
            api.ch_spi_queue_byte(handle, 1, sampling_command(channel))
            api.ch_spi_queue_byte(handle, ECHO_BYTES - 1, 0)
            api.ch_spi_queue_ss(handle, SELECT_NONE)
            api.ch_spi_queue_delay_ns(handle, AFTER_SAMPLE_NS)
            for select in SELECT:
                api.ch_spi_queue_ss(handle, select)
                api.ch_spi_queue_byte(handle, WORD_BYTES, 0)
            api.ch_spi_queue_ss(handle, SELECT_NONE)
            api.ch_spi_queue_delay_ns(handle, BETWEEN_WORDS_NS + rest_ns)

    def _checked(self, status: int, doing: str) -> int:
        """Return a status, or raise DeviceError if it is one of an error."""
        if status < 0:
            text = self._api.ch_status_string(status)
            raise DeviceError(f'{doing} failed on the Cheetah adapter ({text}, status {status}); replug it')
        return status


# --------------------
# What BioTacs answer to the sampling commands of whole frames: bytes to counts. Independent of link and clock.

ODD_PARITY = np.array([byte.bit_count() % 2 == 1 for byte in range(256)])


class Replies(NamedTuple):
    """Some frames of all BioTacs of a board, in counts; NaN where a word was damaged."""

    pac: NDArray[np.float32]
    slow: NDArray[np.float32]
    damaged: NDArray[np.int64]
    refused: NDArray[np.int64]


def decode(frames: bytes, layout: BioTacLayout, fingers: int) -> Replies:
    """Return what the BioTacs measured in one or several whole frames.

    A word is 12 bits: seven in the upper bits of the first byte, five in the upper bits of the second; bit 0 of each
    byte makes its number of ones odd. A word belongs to the BioTac at its place in the reply, whatever became of
    its neighbours, and to the channel of its slot: what comes back while the command goes out is not relied on.
    """
    size = layout.frame_bytes(fingers)
    if not frames or len(frames) % size:
        raise InvalidData(
            f'{len(frames)} bytes came from the BioTac board; a multiple of {size} is needed '
            f'for {len(layout.slots)} slots of {fingers} BioTacs'
        )
    # (n_frames, n_slots, n_fingers, 2)
    slots = np.frombuffer(frames, np.uint8).reshape(-1, len(layout.slots), ECHO_BYTES + WORD_BYTES * fingers)
    words = slots[:, :, ECHO_BYTES:].reshape(*slots.shape[:2], fingers, WORD_BYTES)
    good = ODD_PARITY[words].all(axis=-1)
    first, second = words[..., 0].astype(np.uint16), words[..., 1]
    values = np.where(good, (first >> 1) * 32 + (second >> 3), np.nan).astype(np.float32)
    refused = np.isin(first << 8 | second, list(ERROR_WORDS)) & ~good
    return Replies(
        pac=values[:, 1::2].reshape(-1, fingers),
        slow=values[:, layout.slow_slots],
        damaged=(~good).sum(axis=(0, 1)),
        refused=refused.sum(axis=(0, 1)),
    )


# --------------------
# The BioTac fingertip as a sensor of the suite.

SILENCE_S = 1.0  # without a whole frame, or without a good word, the board or the finger is not there
MICROSECONDS_PER_S = 1e6
CHEETAH = 'cheetah'
Topics = dict[str, list[TactileSignal]]


class BioTac:
    """Read BioTacs of one board: 'signal' is PAC at 2200 Hz, 'signal_static' all else at 100 Hz, in counts.

    The stamp of a PAC batch is the time of its first sample, one slot (227 µs) after the start of the frame; that of
    a static row is the start of its frame, and its channels were sampled up to a frame later
    (`BioTacLayout.slow_slots`). The device's numbers show losses exactly, its clock gives the times; over an
    interruption the host's clock does. See `texture_core.types.Sensor`.

    Parameters
    ----------
    params
        `device` is the path of a serial bridge, or 'cheetah' for the first Cheetah adapter; `finger` the place of the
        BioTac on its board, from 0.
    now_ns
        The host's clock.
    layout
        Kind of BioTac.
    fingers
        Several places instead of `params.finger`; topics are then 'finger0/signal' and so on.
    link
        Another link to the board than `params.device` names.
    """

    def __init__(
        self,
        params: SensorParams,
        now_ns: Callable[[], int] = time.time_ns,
        *,
        layout: BioTacLayout = LAYOUTS['biotac'],
        fingers: Sequence[int] = (),
        link: SpiLink | None = None,
    ) -> None:
        self._params = params
        self._now_ns = now_ns
        self._layout = layout
        self._signals = signal_makers(layout, layout.pac_rate_hz, layout.frame_rate_hz, params.frame_id)
        self._prefixes = {finger: f'finger{finger}/' for finger in fingers} or {params.finger: ''}
        board = Cheetah(layout) if params.device == CHEETAH else SerialBridge(params.device, layout, params.batch_s)
        self._link = link or board
        self._clock = StreamClock(MICROSECONDS_PER_S, max_drift=self._link.max_drift)
        self._numbers = PacketNumbering(layout.frame_rate_hz)
        self._epoch: int | None = None
        self._last_received_ns: dict[int, int] = {}  # finger: when it last sent a good word; -1 for the board
        self._opened = self._samples = self._damaged = self._refused = 0

    def open(self) -> None:
        """Open the link; DeviceError if it is not there."""
        self._link.open()
        self._opened += 1
        self._last_received_ns = dict.fromkeys([-1, *self._prefixes], self._now_ns())

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for about one frame and return what arrived."""
        frames = self._link.read()
        now_ns = self._now_ns()
        topics: Topics = {topic: [] for topic in self.expected_rates_hz}
        for run in consecutive(frames):
            self._process(run, now_ns, topics)
        self._watch_silence(now_ns)
        return topics

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals; 'samples' and 'lost' are of PAC of one finger, 'damaged_words' and 'refused_words' of all read."""
        return {
            'samples': self._samples,
            'lost': self._numbers.lost * self._layout.pac_per_frame,
            'damaged_words': self._damaged,
            'refused_words': self._refused,
            'reopened': max(0, self._opened - 1),
            'clock_steps': self._clock.steps,
            **self._link.counts,
        }

    @property
    def details(self) -> Mapping[str, str | float]:
        """Serial number of each BioTac that reported it, and how much the device's clock is slow."""
        serials = {f'serial of finger {place}': serial for place, serial in enumerate(self._link.serials) if serial}
        return {**serials, SLOW_CLOCK: PPM * self._clock.drift}

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        rates = {'signal': self._layout.pac_rate_hz, 'signal_static': self._layout.frame_rate_hz}
        return {f'{prefix}{topic}': rate for prefix in self._prefixes.values() for topic, rate in rates.items()}

    @property
    def limits(self) -> Limits:
        """Ends of the 12 bits by topic."""
        return dict.fromkeys(self.expected_rates_hz, (0, FULL_SCALE))

    def _process(self, run: Sequence[SpiFrame], now_ns: int, topics: Topics) -> None:
        """Make batches of consecutive frames, once their times are known."""
        first_frame, last = run[0], run[-1]
        self._check_places(last.fingers)
        self._last_received_ns[-1] = now_ns
        if first_frame.epoch != self._epoch:
            self._epoch = first_frame.epoch
            self._numbers.interrupt()
            self._clock.restart()
        # A frame is sent when its last slot has been sampled.
        self._clock.observe(last.time_us + round(self._layout.frame_s * MICROSECONDS_PER_S), now_ns)
        if not self._clock.settled:
            return
        start_ns = self._clock.time_ns(first_frame.time_us)
        index = self._numbers.place(first_frame.number, len(run), start_ns)
        replies = decode(b''.join(frame.reply for frame in run), self._layout, last.fingers)
        self._samples += len(replies.pac)
        for finger, prefix in self._prefixes.items():
            self._damaged += int(replies.damaged[finger])
            self._refused += int(replies.refused[finger])
            if replies.damaged[finger] == len(run) * len(self._layout.slots):
                continue  # no answer
            self._last_received_ns[finger] = now_ns
            pac, slow = self._signals
            stamp_ns, first = start_ns + round(SLOT_NS), index * self._layout.pac_per_frame
            samples = replies.pac[:, finger : finger + 1]
            topics[f'{prefix}signal'].append(pac(stamp_ns=stamp_ns, first_sample=first, samples=samples))
            samples = replies.slow[:, :, finger]
            topics[f'{prefix}signal_static'].append(slow(stamp_ns=start_ns, first_sample=index, samples=samples))

    def _check_places(self, places: int) -> None:
        missing = [finger for finger in self._prefixes if finger >= places]
        if missing:
            raise DeviceError(
                f"finger {missing[0]} is requested, and the board at '{self._params.device}' has places 0 to "
                f'{places - 1}; set the parameter finger to one of them'
            )

    def _watch_silence(self, now_ns: int) -> None:
        """Raise DeviceError when the board, or every requested finger, has been silent for a while."""
        limit_ns = now_ns - SILENCE_S * NANOSECONDS
        if self._last_received_ns[-1] < limit_ns:
            raise DeviceError(
                f"device '{self._params.device}' is open but sends no complete frames; check that it is a BioTac "
                'bridge and runs, or replug it'
            )
        if all(self._last_received_ns[finger] < limit_ns for finger in self._prefixes):
            places = ' or '.join(str(finger) for finger in self._prefixes)
            raise DeviceError(
                f"no BioTac answers as finger {places} at '{self._params.device}'; "
                'check its plug, and the parameter finger'
            )


def consecutive(frames: Sequence[SpiFrame]) -> Iterator[list[SpiFrame]]:
    """Yield runs of frames that follow each other without a gap."""
    numbered = enumerate(frames)
    for _, run in groupby(numbered, key=lambda item: (item[1].epoch, item[1].fingers, item[1].number - item[0])):
        yield [frame for _, frame in run]

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""SynTouch BioTac: the protocol of its board, read through a serial bridge or a Cheetah adapter, and the sensor."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import DeviceError, InvalidData
from texture_core.framing import Frame, pack
from texture_core.types import NANOSECONDS, TactileSignal
from texture_drivers.health import Limits
from texture_drivers.sensor import SensorParams
from texture_drivers.serial_line import VERSION, FramedSensor, FramedStream, Port

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


LAYOUTS: Mapping[str, BioTacLayout] = {
    'biotac': BioTacLayout(electrodes=19),  # 44 slots, 100 frames/s
    'biotac_sp': BioTacLayout(electrodes=24),  # 54 slots, 81.5 frames/s
}

# A microcontroller samples the board over SPI and streams the replies over a serial line, framed as in
# `texture_core.framing`: the reply to all sampling commands in each frame, and now and then the serial numbers. A
# design of this project, for users without a Cheetah adapter: see docs/sensors.md.
REPLY, SERIALS = 0x42, 0x53  # kinds of frames: 'B' and 'S'


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
SELECT = (0x01, 0x02, 0x04)  # the sockets of a board for three BioTacs
READ_PROPERTY, SERIAL_NUMBER = 0x61, 0x15
SERIAL_BYTES, SERIAL_START = 16, 'BT'
MODE_0 = (0, 0)  # clock idles low, sampled at the first edge
QUEUED_FRAMES = 16  # submitted ahead: the adapter samples on while the host is busy
ADAPTERS = 16


class Cheetah:
    """A Cheetah adapter as a port: it samples frames back to back and delivers them as a bridge does."""

    def __init__(self, layout: BioTacLayout, now_s: Callable[[], float] = time.monotonic) -> None:
        self._layout = layout
        self._now_s = now_s
        self._handle = 0
        try:
            self._api = importlib.import_module(MODULE)
        except ImportError as error:
            raise DeviceError(
                f"the Cheetah adapter needs Total Phase's Python module '{MODULE}' and its library, which cannot be "
                f'imported ({error}); put them on PYTHONPATH, or use a serial bridge as the device'
            ) from error
        try:
            self._handle = self._open_first()
            self._configure()
            serials = [self._serial(select) for select in SELECT]
            self._queue_frame()
            for _ in range(QUEUED_FRAMES):
                self._checked(self._api.ch_spi_async_submit(self._handle), 'submitting commands')
        except DeviceError:
            self.close()
            raise
        self._coming = pack(Frame(SERIALS, VERSION, 0, 0, 1, len(SELECT), ','.join(serials).encode('ascii', 'replace')))
        self._frames = self._first = 0  # frames so far, and the one at which the time began
        self._pause_at: int | None = None
        self._last_s = self._now_s()

    def read(self, wait_s: float) -> bytes:
        """Wait for one frame, however long that is, and return it."""
        size = self._layout.frame_bytes(len(SELECT))
        received, data = self._api.ch_spi_async_collect(self._handle, size)
        self._checked(received, 'collecting replies')
        self._checked(self._api.ch_spi_async_submit(self._handle), 'submitting commands')
        if received != size:
            raise DeviceError(f'the Cheetah adapter returned {received} bytes of {size}; replug it')
        self._note_pauses()
        time_us = round((self._frames - self._first) * self._layout.frame_s * 1e6)
        frame = Frame(REPLY, VERSION, self._frames, time_us, len(self._layout.slots), len(SELECT), bytes(data))
        self._frames += 1
        coming, self._coming = self._coming + pack(frame), b''
        return coming

    def write(self, data: bytes) -> None:
        """Send nothing: it samples unrequested."""

    def close(self) -> None:
        """Let the adapter go."""
        if self._handle:
            self._api.ch_close(self._handle)
            self._handle = 0

    def _note_pauses(self) -> None:
        """Begin the time again behind the frames still queued, when the host was away for longer than they lasted."""
        now_s = self._now_s()
        if now_s - self._last_s > QUEUED_FRAMES * self._layout.frame_s:
            self._pause_at = self._frames + QUEUED_FRAMES
        self._last_s = now_s
        if self._frames == self._pause_at:
            self._first, self._pause_at = self._frames, None

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
        """Return the serial number of the BioTac in a socket, '' if there is none."""
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
    byte makes its number of ones odd. A word belongs to the BioTac at its position in the reply, whatever became of
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

CHEETAH = 'cheetah'
BRIDGE_DRIFT = 5e-3  # the internal oscillator of a microcontroller on USB is right to 0.25 %
CHEETAH_DRIFT = 2e-2  # the slots are made of delays, whose sum is nominal


class BioTac(FramedSensor):
    """Read BioTacs of one board: 'signal' is PAC at 2200 Hz, 'signal_static' all else at 100 Hz, in counts.

    The stamp of a PAC batch is the time of its first sample, one slot (227 µs) after the start of the frame; that of
    a static row is the start of its frame, and its channels were sampled up to a frame later
    (`BioTacLayout.slow_slots`). The device's clock shows losses exactly and gives the times; over an
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
    """

    def __init__(
        self,
        params: SensorParams,
        now_ns: Callable[[], int] = time.time_ns,
        *,
        layout: BioTacLayout = LAYOUTS['biotac'],
        fingers: Sequence[int] = (),
    ) -> None:
        slow = FramedStream(  # its samples are whole frames
            topic='signal_static',
            kind=REPLY,
            sensor=SLOW_SENSOR,
            rate_hz=layout.frame_rate_hz,
            channels=layout.slow_channels,
            units=(UNIT,) * len(layout.slow_channels),
            gains=np.ones(len(layout.slow_channels)),
            offsets=np.zeros(len(layout.slow_channels)),
            sample_s=layout.frame_s,
        )
        max_drift = CHEETAH_DRIFT if params.device == CHEETAH else BRIDGE_DRIFT
        super().__init__(params, now_ns, [slow], max_drift=max_drift)
        self._layout = layout
        self._prefixes = {finger: f'finger{finger}/' for finger in fingers} or {params.finger: ''}
        self._places = 0  # of the board; 0 until its first frame
        self._damaged = self._refused = self._answered = 0
        self._unanswered = 0  # frames since the last one in which a requested finger answered
        self._serials: tuple[str, ...] = ()  # of the BioTac in each socket, '' where there is none

    @property
    def valid_frames(self) -> int:
        """Frames in which a requested finger answered."""
        return self._answered

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals; 'samples' and 'lost' are of PAC of one finger, 'damaged_words' and 'refused_words' of all read."""
        counts, per_frame = super().counts, self._layout.pac_per_frame
        return {
            **counts,
            'samples': counts['samples'] * per_frame,
            'lost': counts['lost'] * per_frame,
            'damaged_words': self._damaged,
            'refused_words': self._refused,
        }

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        rates = {'signal': self._layout.pac_rate_hz, 'signal_static': self._layout.frame_rate_hz}
        return {f'{prefix}{topic}': rate for prefix in self._prefixes.values() for topic, rate in rates.items()}

    @property
    def limits(self) -> Limits:
        """Ends of the 12 bits by topic."""
        return dict.fromkeys(self.expected_rates_hz, (0, FULL_SCALE))

    def restart(self) -> None:
        """Resume after an interruption, with the index according to the host's clock."""
        self._unanswered = self._places = 0
        super().restart()

    def _rows(self, frame: Frame) -> int:
        if frame.kind == SERIALS:
            self._serials = tuple(frame.body.decode('ascii', 'replace').split(','))
            return 0
        return super()._rows(frame)

    def _rows_of(self, stream: FramedStream, frame: Frame) -> int:
        if not frame.columns or frame.columns != (self._places or frame.columns):
            return 0
        if len(frame.body) != frame.rows * (ECHO_BYTES + WORD_BYTES * frame.columns):
            return 0
        if frame.rows != len(self._layout.slots):
            raise DeviceError(
                f"the bridge on '{self._params.device}' samples frames of {frame.rows} slots, and this kind of BioTac "
                f'has {len(self._layout.slots)}; choose the sensor with the right one, or change the bridge'
            )
        missing = [finger for finger in self._prefixes if finger >= frame.columns]
        if missing:
            raise DeviceError(
                f"finger {missing[0]} is requested, and the board at '{self._params.device}' has places 0 to "
                f'{frame.columns - 1}; set the parameter finger to one of them'
            )
        self._places = frame.columns
        return 1

    def _batches(
        self, stream: FramedStream, index: int, stamp_ns: int, data: bytes
    ) -> Iterable[tuple[str, TactileSignal]]:
        """Return the batches of PAC and of the slow channels of each finger that answered."""
        replies = decode(data, self._layout, self._places)
        frames = len(replies.slow)
        self._unanswered += frames
        for finger, prefix in self._prefixes.items():
            self._damaged += int(replies.damaged[finger])
            self._refused += int(replies.refused[finger])
            if replies.damaged[finger] == frames * len(self._layout.slots):
                continue  # no answer
            self._answered, self._unanswered = self._answered + frames, 0
            yield (
                f'{prefix}signal',
                TactileSignal(
                    stamp_ns=stamp_ns + round(SLOT_NS),
                    sensor=PAC_SENSOR,
                    channels=(PAC,),
                    units=(UNIT,),
                    sampling_rate_hz=self._layout.pac_rate_hz,
                    first_sample=index * self._layout.pac_per_frame,
                    samples=replies.pac[:, finger : finger + 1],
                    frame_id=self._params.frame_id,
                ),
            )
            yield (
                f'{prefix}signal_static',
                TactileSignal(
                    stamp_ns=stamp_ns,
                    sensor=stream.sensor,
                    channels=stream.channels,
                    units=stream.units,
                    sampling_rate_hz=stream.rate_hz,
                    first_sample=index,
                    samples=replies.slow[:, :, finger],
                    frame_id=self._params.frame_id,
                ),
            )

    @property
    def details(self) -> Mapping[str, str | float]:
        """Serial number of each BioTac that reported it, and how much the device's clock is slow."""
        serials = {f'serial of finger {place}': serial for place, serial in enumerate(self._serials) if serial}
        return {**serials, **super().details}

    def _open_port(self) -> Port:
        return Cheetah(self._layout) if self._params.device == CHEETAH else super()._open_port()

    def _silence_sentence(self) -> str:
        if self._other_kinds:
            return super()._silence_sentence()
        if not self._unanswered:
            return (
                f"device '{self._params.device}' is open but sends no complete frames; check that it is a BioTac "
                'bridge and runs, or replug it'
            )
        places = ' or '.join(str(finger) for finger in self._prefixes)
        return (
            f"no BioTac answers as finger {places} at '{self._params.device}'; check its plug, and the parameter finger"
        )

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Sound card as a sensor: capture in blocks, and the sensor."""

from __future__ import annotations

import contextlib
import time
from collections import deque
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.errors import DeviceError, InvalidParameter
from texture_core.types import NANOSECONDS, TactileSignal
from texture_drivers.health import Limits
from texture_drivers.sensor import SensorParams, load_settings
from texture_drivers.timing import PPM, SLOW_CLOCK, ArrivalNumbering, Decimator

# --------------------
# Numbers of a sensor on a sound card.

SIGNAL = 'signal'
SENSOR = 'sound_card'
RATE_HZ = 48_000
BLOCK_FRAMES = 480  # in a call: 10 ms at 48 kHz
QUEUED_S = 1.0  # blocks are kept so long for a busy reader
FULL_SCALE = 'FS'  # unit of uncalibrated samples: 1 is the largest


# --------------------
# Blocks of samples from a sound card, through miniaudio: captured in its thread, delivered in order.

CAPTURE_FULL_SCALE = 2.0**15
NULL = 'null'  # the name of a card that is always there and delivers zeros


class AudioBlock(NamedTuple):
    """What miniaudio delivered at once."""

    samples: NDArray[np.float32]
    end_ns: int
    overflowed: bool


class Capture:
    """An opened input of a sound card."""

    def __init__(self, device: str, rate_hz: int, channels: int, now_ns: Callable[[], int]) -> None:
        self._channels = channels
        self._now_ns = now_ns
        self._overflowed = False
        self._blocks: deque[AudioBlock] = deque()
        self._most_blocks = round(QUEUED_S * rate_hz / BLOCK_FRAMES)
        try:
            import miniaudio  # noqa: PLC0415  # optional
        except ImportError as error:
            raise DeviceError(
                f"sound card '{device}' cannot be opened: {error}; install the Python package miniaudio"
            ) from error
        try:
            backends = [miniaudio.Backend.NULL] if device == NULL else None
            self._stream = miniaudio.CaptureDevice(
                input_format=miniaudio.SampleFormat.SIGNED16,  # what every card has
                nchannels=channels,
                sample_rate=rate_hz,
                buffersize_msec=round(1000 * BLOCK_FRAMES / rate_hz),
                device_id=find_card(device, miniaudio.Devices(backends).get_captures()) if device else None,
                backends=backends,
            )
            receiver = self._receive()
            next(receiver)
            self._stream.start(receiver)
        except miniaudio.MiniaudioError as error:
            raise DeviceError(
                f"sound card '{device}' cannot be opened: {error}; check its plug, its rate and number of channels, "
                'and that no other program has it open'
            ) from error

    def take(self) -> Sequence[AudioBlock]:
        """Return the blocks that have come since the last call."""
        return [self._blocks.popleft() for _ in range(len(self._blocks))]

    def close(self) -> None:
        """Stop and close; never raises."""
        with contextlib.suppress(Exception):  # a lost device raises many kinds of errors
            self._stream.close()

    def _receive(self) -> Generator[None, bytes, None]:
        """Keep each block that is sent; runs in miniaudio's thread."""
        while True:
            samples = np.frombuffer((yield), '<i2').reshape(-1, self._channels)
            if len(self._blocks) >= self._most_blocks:
                self._overflowed = True  # the reader is too busy: this block is lost
                continue
            scaled = (samples / CAPTURE_FULL_SCALE).astype(np.float32)
            self._blocks.append(AudioBlock(scaled, self._now_ns(), self._overflowed))
            self._overflowed = False


def find_card(device: str, cards: Sequence[Mapping[str, Any]]) -> Any:
    """Return the identity of the card of a number, or of the first whose name contains a text."""
    names = [str(card['name']) for card in cards]
    found = [number for number, name in enumerate(names) if str(number) == device or device.lower() in name.lower()]
    if not found:
        shown = ', '.join(f'{number}: {name}' for number, name in enumerate(names)) or 'none'
        raise DeviceError(
            f"sound card '{device}' cannot be opened: the cards are {shown}; name one of them, or plug it in"
        )
    return cards[found[0]]['id']


# --------------------
# A contact microphone or accelerometer on a sound card as a sensor of the suite: all its channels on 'signal'.

SILENCE_S = 1.0


@dataclass(frozen=True)
class SoundCardSettings:
    """Parameters of the sound card and of the sensor on its input."""

    rate_hz: int = param(
        RATE_HZ,
        'Sampling rate of the card, such as 44100 or 48000; it must be one that the card has.',
        unit='Hz',
        low=8000,
        high=192_000,
    )
    channels: int = param(1, 'Number of channels that are read, from the first on.', low=1, high=8)
    decimation: int = param(
        3,  # 48 to 16 kHz
        'Factor by which the rate is lowered behind a low-pass; a larger one costs less computing time and '
        'keeps a smaller band, up to 0.34 of the lower rate.',
        low=1,
        high=64,
    )
    unit: str = param(FULL_SCALE, "Unit of the published samples; 'FS' is the full scale of the card.")
    gain: float = param(1.0, 'Value of the full scale in the unit, by which the samples are multiplied; it is signed.')

    def __post_init__(self) -> None:
        if self.rate_hz % self.decimation:
            raise InvalidParameter(
                f"setting 'decimation' is {self.decimation}, and {self.rate_hz} Hz cannot be divided by it; choose a "
                'factor that gives whole hertz'
            )


class SoundCard:
    """Read a sound card. See `texture_core.types.Sensor`.

    Samples come without a number: their order and the host's clock number them, and where the reader was too
    busy, the clock gives how many are missing. They are filtered and decimated in blocks.

    Parameters
    ----------
    params
        `device` is a card's name or a part of it, or its number; '' is the default input, 'null' a card of zeros.
        `config` means `SoundCardSettings`.
    now_ns
        The host's clock.

    Raises
    ------
    UnknownName, InvalidParameter
        If the settings are wrong.
    """

    def __init__(self, params: SensorParams, now_ns: Callable[[], int] = time.time_ns) -> None:
        self._params = params
        self._now_ns = now_ns
        self._settings = settings = load_settings(SoundCardSettings, params.config)
        block_s = max(params.batch_s, BLOCK_FRAMES / settings.rate_hz)
        self._numbering = ArrivalNumbering(float(settings.rate_hz), block_s=block_s)
        self._decimator = Decimator(settings.decimation)
        self._rate_hz = settings.rate_hz / settings.decimation
        self._channels = tuple(f'channel_{number + 1}' for number in range(settings.channels))
        self._capture: Capture | None = None
        self._opened = self._samples = self._lost = self._overflows = 0
        self._next_published: int | None = None  # none yet
        self._silent_s = 0.0

    def open(self) -> None:
        """Open the card; DeviceError if it cannot be."""
        self.close()
        self._capture = Capture(self._params.device, self._settings.rate_hz, self._settings.channels, self._now_ns)
        self._opened += 1
        self._silent_s = 0.0
        self._numbering.interrupt()

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for the length of one batch and return what arrived.

        Raises
        ------
        DeviceError
            If the card is not open, or has delivered nothing for 1 s.
        """
        if self._capture is None:
            raise DeviceError(f"sound card '{self._params.device}' is not open; open it before reading")
        time.sleep(self._params.batch_s)
        blocks = self._capture.take()
        self._watch_silence(alive=bool(blocks))
        batches = [batch for block in blocks for batch in self._place(block)]
        return {SIGNAL: batches} if batches else {}

    def close(self) -> None:
        """Close the card."""
        if self._capture is not None:
            self._capture.close()
            self._capture = None

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples published and lost (at the lower rate), and overflows of a busy host."""
        return {
            'samples': self._samples,
            'lost': self._lost,
            'overflows': self._overflows,
            'reopened': max(0, self._opened - 1),
            'clock_steps': self._numbering.clock.steps,
        }

    @property
    def details(self) -> Mapping[str, float]:
        """How much the card's clock is slow."""
        return {SLOW_CLOCK: PPM * self._numbering.clock.drift}

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Rate at which samples are published: that of the card, divided by the decimation."""
        return {SIGNAL: self._rate_hz}

    @property
    def limits(self) -> Limits:
        """Full scale of the card, but for the last step of 16 bits."""
        full = abs(self._settings.gain) * (1 - 2.0**-15)
        return {SIGNAL: (-full, full)}

    def _place(self, block: AudioBlock) -> list[TactileSignal]:
        """Number, filter and decimate a block; nothing while the clock is not settled."""
        self._overflows += block.overflowed
        missing = self._missing(block) if block.overflowed else 0
        indices = self._numbering.place([(missing, len(block.samples))], block.end_ns)
        if not indices:
            return []
        first, samples = self._decimator.feed(indices[0], block.samples)
        if not len(samples):
            return []
        self._lost += 0 if self._next_published is None else first - self._next_published
        self._next_published = first + len(samples)
        self._samples += len(samples)
        stamp_ns = self._numbering.clock.time_ns(first * self._settings.decimation)
        units = (self._settings.unit,) * len(self._channels)
        scaled, frame_id = samples * self._settings.gain, self._params.frame_id
        return [TactileSignal(stamp_ns, SENSOR, self._channels, units, self._rate_hz, first, scaled, frame_id)]

    def _missing(self, block: AudioBlock) -> int:
        """Return how many samples an overflow has cost: those by which the block is late."""
        if not self._numbering.clock.settled:
            return 0
        due_ns = self._numbering.clock.time_ns(self._numbering.next_index + len(block.samples) - 1)
        return max(0, round((block.end_ns - due_ns) / NANOSECONDS * self._settings.rate_hz))

    def _watch_silence(self, *, alive: bool) -> None:
        self._silent_s = 0.0 if alive else self._silent_s + self._params.batch_s
        if self._silent_s >= SILENCE_S:
            raise DeviceError(
                f"sound card '{self._params.device}' is open and delivers nothing; check its plug, and that no other "
                'program has it open'
            )

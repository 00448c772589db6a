"""A contact microphone or accelerometer on a sound card as a sensor of the suite: all its channels on 'signal'."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from texture_core.errors import DeviceError, InvalidParameter
from texture_core.parameters import param
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_drivers.arrival_numbering import ArrivalNumbering
from texture_drivers.channel_watch import Limits
from texture_drivers.clock import PPM, SLOW_CLOCK
from texture_drivers.decimator import Decimator
from texture_drivers.params import SensorParams
from texture_drivers.settings import load_settings
from texture_drivers.sound_card import tables
from texture_drivers.sound_card.capture import AudioBlock, Capture

SILENCE_S = 1.0


@dataclass(frozen=True)
class SoundCardSettings:
    """Parameters of the sound card and of the sensor on its input."""

    rate_hz: int = param(
        tables.RATE_HZ,
        'Sets the sampling rate of the card, such as 44100 or 48000; it must be one that the card has.',
        unit='Hz',
        low=8000,
        high=192_000,
    )
    channels: int = param(1, 'Sets the number of channels that are read, from the first on.', low=1, high=8)
    decimation: int = param(
        12,
        'Sets by what factor the rate is lowered behind a low-pass; a larger factor costs less computing time and '
        'keeps a smaller band, up to 0.34 of the lower rate.',
        low=1,
        high=64,
    )
    unit: str = param(tables.FULL_SCALE, "Sets the unit of the published samples; 'FS' is the full scale of the card.")
    gain: float = param(
        1.0, 'Sets the value of the full scale in the unit, by which the samples are multiplied; it is signed.'
    )

    def __post_init__(self) -> None:
        if self.rate_hz % self.decimation:
            raise InvalidParameter(
                f"setting 'decimation' is {self.decimation}, and {self.rate_hz} Hz cannot be divided by it; choose a "
                'factor that gives whole hertz'
            )


class SoundCard:
    """Read a sound card. See `texture_core.protocols.Sensor`.

    Samples come without a number: their order and the host's clock number them, and where PortAudio reports an
    overflow, the clock tells how many are missing. They are filtered and decimated in blocks.

    Parameters
    ----------
    params
        `device` is a card's name or a part of it, or its number; '' is the default input. `config` means
        `SoundCardSettings`.
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
        block_s = max(params.batch_s, tables.BLOCK_FRAMES / settings.rate_hz)
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
        return {tables.SIGNAL: batches} if batches else {}

    def close(self) -> None:
        """Close the card."""
        if self._capture is not None:
            self._capture.close()
            self._capture = None

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples published and lost (at the lower rate), overflows of the card or of a busy host."""
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
        return {tables.SIGNAL: self._rate_hz}

    @property
    def limits(self) -> Limits:
        """Full scale of the card, but for the last step of 16 bits."""
        full = abs(self._settings.gain) * (1 - 2.0**-15)
        return {tables.SIGNAL: (-full, full)}

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
        return [
            TactileSignal(
                stamp_ns=stamp_ns,
                sensor=tables.SENSOR,
                channels=self._channels,
                units=(self._settings.unit,) * len(self._channels),
                sampling_rate_hz=self._rate_hz,
                first_sample=first,
                samples=samples * self._settings.gain,
                frame_id=self._params.frame_id,
            )
        ]

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

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""AnySkin, five magnetometers under a skin: protocol and sensor."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.types import TactileSignal
from texture_drivers.health import Limits
from texture_drivers.sensor import SensorParams, load_settings
from texture_drivers.serial_line import SerialSensor
from texture_drivers.timing import PPM, SLOW_CLOCK, ArrivalNumbering, RateMeter

# --------------------
# Numbers of the AnySkin's protocol and streams.
#
# Source: raunaqbhirangi/anyskin @4e5bd4f `arduino/5X_binary_burst_stream/5X_binary_burst_stream.ino`: each turn of the
# loop reads the five magnetometers, sends the four float32 of each, then CR and LF.

MAGNETOMETERS = 5  # of the 5X board
QUANTITIES = 4  # of each magnetometer: temperature, x, y, z
VALUE = np.dtype('<f4')
END = b'\r\n'
LOWEST_TEMPERATURE_C, HIGHEST_TEMPERATURE_C = -20.0, 85.0  # MLX90393 data sheet: where it works
LARGEST_FIELD_UT = 50_000.0  # MLX90393 data sheet: its measurement range
# At the gain and resolution that the vendor's library sets (0.15 µT a count, inferred) 16 bits end here: an axis that
# at that value is saturated.
RANGE_UT = 4_900.0
# The finest steps of an MLX90393 are some tenths of a microtesla and 0.02 °C: what is smaller than this and not 0 is no
# measurement.
SMALLEST = 1e-3

SIGNAL, FIELD_SENSOR, FIELD_UNIT = 'signal', 'anyskin/field', 'µT'
# Until the rate has been measured: the filters of the magnetometers and the I2C bus set it, and the vendor names none.
USUAL_RATE_HZ = 100.0


def frame_bytes(magnetometers: int) -> int:
    """Return the length of a frame: 82 bytes for five magnetometers."""
    return magnetometers * QUANTITIES * VALUE.itemsize + len(END)


def field_channels(magnetometers: int) -> tuple[str, ...]:
    """Return the names of the field's channels: 'm0_x', 'm0_y', 'm0_z', 'm1_x' and so on."""
    return tuple(f'm{number}_{axis}' for number in range(magnetometers) for axis in 'xyz')


# --------------------
# The AnySkin's protocol: bytes to frames. Independent of port and clock.

Values = NDArray[np.float32]
LOCK_FRAMES = 3  # consecutive frames, with nothing between them, that confirm where frames begin


class FrameRun(NamedTuple):
    """Consecutive frames."""

    missing: int
    values: Values


class FrameParser:
    """Turn a byte stream into frames, whatever is lost or added in transmission.

    A frame has no header, number or checksum: only its length, CR LF at its end and the range of its values show it,
    and the values may hold CR LF, too. So a frame is accepted only where three fit in a row, the first of them only
    behind CR LF (a byte more or less at its beginning would change a value and not its end), and, from there on, as
    long as each follows the one before without a byte between. A changed bit that leaves a value in its range cannot
    be seen.
    """

    def __init__(self, magnetometers: int = MAGNETOMETERS) -> None:
        self.frames = 0
        self.refused = 0  # frames that did not fit after their beginnings were known
        self.refused_bytes = 0
        self._size = frame_bytes(magnetometers)
        self._values_shape = (magnetometers, QUANTITIES)
        self._buffer = b''
        self.restart()

    def restart(self) -> None:
        """Forget where frames begin, as after opening the port."""
        self._locked = False
        self._before = b''  # the last two bytes before the buffer
        self._passed: int | None = None  # bytes passed over since the last frame; None before the first one
        self._buffer = b''

    def feed(self, data: bytes) -> list[FrameRun]:
        """Return the frames completed by `data`; what is refused is counted. Keeps fewer bytes than three frames."""
        self._buffer += data
        runs: list[FrameRun] = []
        while self._locked or self._find_start():
            values = self._leading_frames()
            if len(values):
                runs.append(FrameRun(self._missing(), values))
            if len(self._buffer) < self._size:
                break
            self.refused += 1
            self._locked = False
        return runs

    def _missing(self) -> int:
        missing, self._passed = round((self._passed or 0) / self._size), 0
        return missing

    def _leading_frames(self) -> Values:
        """Take the valid frames at the beginning of the buffer."""
        values, valid = self._decode(self._buffer)
        count = len(valid) if valid.all() else int(valid.argmin())
        self._buffer = self._buffer[count * self._size :]
        self._before = END if count else self._before
        self.frames += count
        return values[:count]

    def _find_start(self) -> bool:
        """Drop what comes before three valid frames in a row; return whether there are such."""
        end = self._buffer.find(END, self._size - len(END))
        while end >= 0:
            start = end + len(END) - self._size
            candidates = self._buffer[start : start + LOCK_FRAMES * self._size]
            _, valid = self._decode(candidates)
            if valid.all():
                self._pass_over(start)
                self._locked = len(valid) == LOCK_FRAMES
                if self._locked and self._before != END:
                    self._pass_over(self._size)
                return self._locked
            end = self._buffer.find(END, end + 1)
        self._pass_over(max(0, len(self._buffer) - self._size + 1))
        return False

    def _pass_over(self, count: int) -> None:
        self._before = (self._before + self._buffer[:count])[-len(END) :]
        self._buffer = self._buffer[count:]
        self.refused_bytes += count
        if self._passed is not None:
            self._passed += count

    def _decode(self, data: bytes) -> tuple[Values, NDArray[np.bool_]]:
        """Return the values of the whole frames in `data`, (n, n_magnetometers, 4), and whether each is valid, (n,)."""
        count = len(data) // self._size
        frames = np.frombuffer(data, dtype=np.uint8, count=count * self._size).reshape(count, self._size)
        content, ends = frames[:, : -len(END)], frames[:, -len(END) :]
        values = np.ascontiguousarray(content).view(VALUE).reshape(count, *self._values_shape)
        ended = (ends == np.frombuffer(END, dtype=np.uint8)).all(axis=1)
        return values, ended & in_range(values)


def in_range(values: Values) -> NDArray[np.bool_]:
    """Return whether all values of each frame, (n_frames, n_magnetometers, 4), can have been measured, (n_frames,)."""
    with np.errstate(invalid='ignore'):  # NaN is in no range
        temperature_c, magnitudes = values[..., 0], np.abs(values)
        warm = (temperature_c >= LOWEST_TEMPERATURE_C) & (temperature_c <= HIGHEST_TEMPERATURE_C)
        weak = (magnitudes[..., 1:] <= LARGEST_FIELD_UT).all(axis=(1, 2))
        measured = ((magnitudes >= SMALLEST) | (magnitudes == 0)).all(axis=(1, 2))
    return warm.all(axis=1) & weak & measured


# --------------------
# The AnySkin as a sensor of the suite: the field at each magnetometer on 'signal'.

MAX_DRIFT = 0.02  # the device's pace is that of its loop, not of an oscillator


@dataclass(frozen=True)
class AnySkinSettings:
    """Parameters of the AnySkin or ReSkin board."""

    magnetometers: int = param(
        MAGNETOMETERS, 'Number of magnetometers on the board; it must equal that of the device.',
        low=1, high=16,
    )  # fmt: skip
    rate_hz: float = param(
        0.0,
        'Rate of the board; 0 measures it in the first 2 s, to a whole hertz from 100 Hz on. A model needs the rate '
        'that it was trained at, so set it once it is known.',
        unit='Hz',
        low=0.0,
        high=2000.0,
    )


class AnySkin(SerialSensor):
    """Read an AnySkin or ReSkin; `params.config` means `AnySkinSettings`. See `texture_core.types.Sensor`."""

    def __init__(self, params: SensorParams, now_ns: Callable[[], int] = time.time_ns) -> None:
        super().__init__(params, now_ns)
        settings = load_settings(AnySkinSettings, params.config)
        self._parser = FrameParser(settings.magnetometers)
        self._channels = field_channels(settings.magnetometers)
        self._meter = RateMeter()
        self._rate_hz = settings.rate_hz
        self._numbering = self._make_numbering() if self._rate_hz else None
        self._samples = self._lost = 0
        self._next_published: int | None = None  # none yet

    @property
    def valid_frames(self) -> int:
        """Frames that fitted."""
        return self._parser.frames

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples published and lost, frames that did not fit, bytes passed over, steps of the host's clock."""
        return {
            'samples': self._samples,
            'lost': self._lost,
            'bogus': self._parser.refused,
            'refused_bytes': self._parser.refused_bytes,
            'clock_steps': self._numbering.clock.steps if self._numbering else 0,
            **super().counts,
        }

    @property
    def details(self) -> Mapping[str, str | float]:
        """How much the device is slower than its rate."""
        return {SLOW_CLOCK: PPM * self._numbering.clock.drift if self._numbering else 0.0}

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Rate of the field; the usual one until it has been measured."""
        return {SIGNAL: self._rate_hz or USUAL_RATE_HZ}

    @property
    def limits(self) -> Limits:
        """What a magnetometer can measure."""
        return {SIGNAL: (-RANGE_UT, RANGE_UT)}

    def restart(self) -> None:
        """Resume after an interruption, with the index according to the host's clock."""
        self._parser.restart()
        self._meter.restart()
        if self._numbering:
            self._numbering.interrupt()

    def feed(self, data: bytes, arrival_ns: int) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches in `data`; none in the first 0.1 s of a stream, nor while its rate is measured."""
        runs = self._parser.feed(data)
        if not runs:
            return {}
        blocks = [(run.missing, len(run.values)) for run in runs]
        if self._numbering is None:
            self._rate_hz = self._meter.update(sum(map(sum, blocks)), arrival_ns)
            if self._rate_hz:
                self._numbering = self._make_numbering()
            return {}
        # A batch of each run; none while there are no indices.
        indices = self._numbering.place(blocks, arrival_ns)
        batches = [self._batch(index, run.values) for index, run in zip(indices, runs, strict=False)]
        return {SIGNAL: batches} if batches else {}

    def _make_numbering(self) -> ArrivalNumbering:
        return ArrivalNumbering(self._rate_hz, block_s=self._params.batch_s, max_drift=MAX_DRIFT)

    def _batch(self, index: int, values: Values) -> TactileSignal:
        assert self._numbering is not None
        self._lost += 0 if self._next_published is None else index - self._next_published
        self._next_published = index + len(values)
        self._samples += len(values)
        return TactileSignal(
            stamp_ns=self._numbering.clock.time_ns(index),
            sensor=FIELD_SENSOR,
            channels=self._channels,
            units=(FIELD_UNIT,) * len(self._channels),
            sampling_rate_hz=self._rate_hz,
            first_sample=index,
            samples=values[..., 1:].reshape(len(values), -1).astype(np.float32),
            frame_id=self._params.frame_id,
        )

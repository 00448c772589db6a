"""The AnySkin as a sensor of the suite: the field at each magnetometer on 'signal'."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.parameters import param
from texture_core.signal import TactileSignal
from texture_drivers.anyskin import tables
from texture_drivers.anyskin.protocol import FrameParser, FrameRun, Values
from texture_drivers.arrival_numbering import ArrivalNumbering
from texture_drivers.channel_watch import Limits
from texture_drivers.clock import PPM, SLOW_CLOCK
from texture_drivers.params import SensorParams
from texture_drivers.rate_meter import RateMeter
from texture_drivers.serial_sensor import SerialSensor
from texture_drivers.settings import load_settings

MAX_DRIFT = 0.02  # the device's pace is that of its loop, not of an oscillator
Topics = dict[str, list[TactileSignal]]


@dataclass(frozen=True)
class AnySkinSettings:
    """Parameters of the AnySkin or ReSkin board."""

    magnetometers: int = param(
        tables.MAGNETOMETERS, 'Sets the number of magnetometers on the board; it must equal that of the device.',
        low=1, high=16,
    )  # fmt: skip
    rate_hz: float = param(
        0.0,
        'Sets the rate of the board; 0 measures it in the first two seconds, to a whole hertz. A model needs the rate '
        'that it was trained at, so set it once it is known.',
        unit='Hz',
        low=0.0,
        high=2000.0,
    )
    temperature: bool = param(False, "Publishes the temperature of each magnetometer on the topic 'temperature'.")


class AnySkinDecoder:
    """Decode the frames of an AnySkin; see `texture_drivers.serial_sensor.Decoder`.

    Parameters
    ----------
    settings
        Of the board.
    batch_s
        How often bytes are read.
    frame_id
        For the headers.
    """

    def __init__(self, settings: AnySkinSettings, batch_s: float, frame_id: str = '') -> None:
        self._settings = settings
        self._batch_s = batch_s
        self._frame_id = frame_id
        self._parser = FrameParser(settings.magnetometers)
        self._channels = tables.field_channels(settings.magnetometers)
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
        }

    @property
    def details(self) -> Mapping[str, float]:
        """How much the device is slower than its rate."""
        return {SLOW_CLOCK: PPM * self._numbering.clock.drift if self._numbering else 0.0}

    @property
    def rates_hz(self) -> Mapping[str, float]:
        """Rate of each topic; the usual one until it has been measured."""
        rate_hz = self._rate_hz or tables.USUAL_RATE_HZ
        topics = (tables.SIGNAL, *((tables.TEMPERATURE,) if self._settings.temperature else ()))
        return dict.fromkeys(topics, rate_hz)

    @property
    def limits(self) -> Limits:
        """What a magnetometer can measure."""
        return {tables.SIGNAL: (-tables.RANGE_UT, tables.RANGE_UT)}

    def restart(self) -> None:
        """Go on after an interruption, with the index that the host's clock will tell."""
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
            self._measure(sum(map(sum, blocks)), arrival_ns)
            return {}
        return self._batches(runs, self._numbering.place(blocks, arrival_ns), self._numbering)

    def _measure(self, frames: int, arrival_ns: int) -> None:
        rate_hz = self._meter.update(frames, arrival_ns)
        if rate_hz:
            self._rate_hz = float(max(1, round(rate_hz)))
            self._numbering = self._make_numbering()

    def _make_numbering(self) -> ArrivalNumbering:
        return ArrivalNumbering(self._rate_hz, block_s=self._batch_s, max_drift=MAX_DRIFT)

    def _batches(self, runs: Sequence[FrameRun], indices: Sequence[int], numbering: ArrivalNumbering) -> Topics:
        """Return a batch of each run; none while there are no indices."""
        topics: Topics = {}
        for index, run in zip(indices, runs, strict=False):
            stamp_ns = numbering.clock.time_ns(index)
            self._lost += 0 if self._next_published is None else index - self._next_published
            self._next_published = index + len(run.values)
            self._samples += len(run.values)
            topics.setdefault(tables.SIGNAL, []).append(self._field(stamp_ns, index, run.values))
            if self._settings.temperature:
                topics.setdefault(tables.TEMPERATURE, []).append(self._temperature(stamp_ns, index, run.values))
        return topics

    def _field(self, stamp_ns: int, index: int, values: Values) -> TactileSignal:
        return TactileSignal(
            stamp_ns=stamp_ns,
            sensor=tables.FIELD_SENSOR,
            channels=self._channels,
            units=(tables.FIELD_UNIT,) * len(self._channels),
            sampling_rate_hz=self._rate_hz,
            first_sample=index,
            samples=values[..., 1:].reshape(len(values), -1).astype(np.float32),
            frame_id=self._frame_id,
        )

    def _temperature(self, stamp_ns: int, index: int, values: Values) -> TactileSignal:
        channels = tuple(f'm{number}' for number in range(self._settings.magnetometers))
        return TactileSignal(
            stamp_ns=stamp_ns,
            sensor=tables.TEMPERATURE_SENSOR,
            channels=channels,
            units=(tables.TEMPERATURE_UNIT,) * len(channels),
            sampling_rate_hz=self._rate_hz,
            first_sample=index,
            samples=values[..., 0].astype(np.float32),
            frame_id=self._frame_id,
        )


def anyskin(params: SensorParams, now_ns: Callable[[], int] = time.time_ns) -> SerialSensor:
    """Return the sensor; `params.config` means `AnySkinSettings`.

    Raises
    ------
    UnknownName, InvalidParameter
        If the settings are wrong.
    """
    settings = load_settings(AnySkinSettings, params.config)
    return SerialSensor(params, now_ns, AnySkinDecoder(settings, params.batch_s, params.frame_id))

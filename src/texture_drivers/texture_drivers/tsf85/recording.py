"""Recordings of the vendor's SDK: the CSV that `sensor_quickstart/record_data.py` of robotiq/tactile_sensors writes.

A header, then one line a packet, separated by semicolons: host time in ms; dynamic value of finger 0 and 1; 28 taxels
of finger 0, 28 of finger 1; acceleration of both; rotation of both. The first line holds the baseline of the taxels and
no measurement; unless it was told otherwise, the program has subtracted it from those that follow.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData
from texture_core.files import open_regular
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_drivers.tsf85 import tables
from texture_drivers.tsf85.batch_cutter import IMU, SIGNAL, STATIC
from texture_drivers.tsf85.settings import Tsf85Settings

TAXELS, AXES = tables.STATIC_ROWS * tables.STATIC_COLUMNS, 3
FIRST_COLUMN = 'Time(ms)'
ChannelGroup = tuple[str, tuple[str, ...], tuple[str, ...], float]
DYNAMIC: ChannelGroup = (tables.DYNAMIC_SENSOR, tables.DYNAMIC_CHANNELS, (tables.UNIT,), tables.RATE_HZ)
TAXEL: ChannelGroup = (
    tables.STATIC_SENSOR,
    tables.STATIC_CHANNELS,
    (tables.UNIT,) * TAXELS,
    tables.STATIC_RATE_HZ,
)
MAX_LINE = 10_000  # characters; a number has 25 at most
COLUMNS = 1 + tables.FINGERS * (1 + TAXELS + AXES + AXES)


@dataclass(frozen=True, eq=False)
class VendorRecording:
    """What was recorded, in counts; n lines.

    Parameters
    ----------
    time_ms : (n,)
        When the host polled the packet, since the epoch: coarse, in bursts, and no proof of evenness.
    dynamic : (n, 2)
        Of both fingers, as are the others.
    static : (n, 2, 28)
        Less the baseline, if it was subtracted.
    acceleration, rotation : (n, 2, 3)
    baseline : (2, 28)
    """

    time_ms: Array
    dynamic: Array
    static: Array
    acceleration: Array
    rotation: Array
    baseline: Array

    @property
    def samples(self) -> NDArray[np.intp]:
        """Lines that are samples, (n_samples,): where more than the taxels changed, or not even they.

        New firmware sends an image in a packet of its own, for which the recorder writes the rest a second time.
        """
        changed = np.diff(np.concatenate([self.dynamic, *self._motion()], axis=1), axis=0).any(axis=1)
        new_image = np.diff(self.static, axis=0).any(axis=(1, 2))
        return np.flatnonzero(np.concatenate([[True], changed | ~new_image]))

    @property
    def rate_hz(self) -> float:
        """Samples a second, on the average; far from 1000 it tells of lines that the recorder lost."""
        time_ms = self.time_ms[self.samples]
        return float((len(time_ms) - 1) / (time_ms[-1] - time_ms[0]) * 1000)

    def signals(self, finger: int = 0, settings: Tsf85Settings | None = None) -> Mapping[str, list[TactileSignal]]:
        """Return one finger as the driver would have published it, by topic.

        The file has no stamps of the device: samples are numbered through at 1 kHz from the first one's time on, and
        what the recorder lost goes unseen; see `rate_hz`. Images are taken at ticks of 60 Hz.
        """
        settings = replace(settings or Tsf85Settings(), imu=True, magnetometer=False)
        lines = self.samples
        ticks = lines[np.arange(0, len(lines), tables.RATE_HZ / tables.STATIC_RATE_HZ).astype(int)]
        motion = np.concatenate([values[lines, 3 * finger : 3 * finger + 3] for values in self._motion()], axis=1)
        streams = {
            SIGNAL: (DYNAMIC, self.dynamic[lines, finger, None]),
            STATIC: (TAXEL, self.static[ticks, finger]),
            IMU: ((tables.MOTION_SENSOR, settings.channels, settings.units, tables.RATE_HZ), motion * settings.gains),
        }
        return {topic: [self._batch(stream, samples)] for topic, (stream, samples) in streams.items()}

    def _motion(self) -> tuple[Array, Array]:
        """Return acceleration and rotation, each (n, 6): finger after finger."""
        n = len(self.time_ms)
        return self.acceleration.reshape(n, -1), self.rotation.reshape(n, -1)

    def _batch(self, stream: ChannelGroup, samples: Array) -> TactileSignal:
        sensor, channels, units, rate_hz = stream
        return TactileSignal(
            stamp_ns=round(self.time_ms[0] * NANOSECONDS / 1000),
            sensor=sensor,
            channels=channels,
            units=units,
            sampling_rate_hz=rate_hz,
            first_sample=0,
            samples=samples.astype(np.float32),
        )


def load_vendor_csv(path: Path) -> VendorRecording:
    """Return what the vendor's recorder wrote.

    Raises
    ------
    InvalidData
        If there is no such file, or it is another one.
    """
    try:
        with open_regular(path) as file, io.TextIOWrapper(file, encoding='utf-8-sig') as text:
            names = text.readline(MAX_LINE).strip().split(';')
            lines = (line for line in iter(lambda: text.readline(MAX_LINE), '') if line.strip())
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')  # an empty table is refused below, in our words
                table = np.loadtxt(lines, delimiter=';', ndmin=2)
    except OSError as error:
        raise InvalidData(f"recording '{path}' cannot be read: {error.strerror or error}; give another path") from error
    except ValueError as error:
        raise InvalidData(f"recording '{path}' is not usable: {error}") from error
    if names[0] != FIRST_COLUMN or len(names) != COLUMNS or table.shape[1] != COLUMNS or len(table) < 3:
        raise InvalidData(
            f"recording '{path}' has {len(names)} columns from '{names[0]}' on and {len(table)} lines; a recording of "
            f"the vendor's program has {COLUMNS} from '{FIRST_COLUMN}' on and at least 3 lines"
        )
    if not table[-1, 0] > table[1, 0]:
        raise InvalidData(f"recording '{path}' has times that do not rise; record it again")
    return _recording(table)


def _recording(table: AnyArray) -> VendorRecording:
    fingers = tables.FINGERS
    time_ms, dynamic, static, acceleration, rotation = np.split(
        table, np.cumsum([1, fingers, fingers * TAXELS, fingers * AXES]), axis=1
    )
    taxels = static.reshape(-1, fingers, TAXELS)
    return VendorRecording(
        time_ms=time_ms[1:, 0],
        dynamic=dynamic[1:],
        static=taxels[1:],
        acceleration=acceleration[1:].reshape(-1, fingers, AXES),
        rotation=rotation[1:].reshape(-1, fingers, AXES),
        baseline=taxels[0],
    )

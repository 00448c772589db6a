# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recording in a file as a sensor: readers of recordings, and the player."""

from __future__ import annotations

import io
import struct
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from texture_core.config import Arrays, open_regular, param, read_array
from texture_core.errors import DeviceError, InvalidData
from texture_core.types import NANOSECONDS, AnyArray, Array, Samples, TactileSignal
from texture_drivers.sensor import SensorParams, load_settings

# --------------------
# The signals of a recording in a file.


class FileRecording(NamedTuple):
    """Samples from a file."""

    samples: Samples
    rate_hz: float | None = None
    channels: tuple[str, ...] = ()


# --------------------
# Read a recording from a table of text.

TIME_COLUMNS = ('time_s', 'time', 't')
MAX_COLUMNS = 10_000


MAX_LINE = 16 * MAX_COLUMNS
UNEVEN = 0.1  # deviation of a time step from their median above which a recording is not evenly sampled


def load_csv(file: BinaryIO) -> FileRecording:
    """Return a table: one column for each channel, comma, semicolon or blanks between, names in the first line or none.

    A column `time_s` gives the rate and is no channel. Lines with # are passed over.

    Raises
    ------
    ValueError
        If names and numbers do not fit, or times are uneven.
    """
    text = io.TextIOWrapper(file, encoding='utf-8-sig')
    first = next(_lines(text), '')
    delimiter = next((sign for sign in ',;' if sign in first), None)
    names = [name.strip().strip('"') for name in first.strip().split(delimiter)]
    named = not all(_is_number(name) for name in names)
    text.seek(0)
    lines = _lines(text)
    if named:
        next(lines, None)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # an empty table is refused below, in our words
        table = np.loadtxt(lines, delimiter=delimiter, ndmin=2, dtype=np.float64)
    if not named:
        return FileRecording(table)
    if table.size and table.shape[1] != len(names):
        raise ValueError(f'its first line has {len(names)} names and the others {table.shape[1]} numbers')
    time = next((i for i, name in enumerate(names) if name.lower() in TIME_COLUMNS), None)
    if time is None or not table.size:
        return FileRecording(table, None, tuple(names))
    del names[time]
    return FileRecording(np.delete(table, time, axis=1), rate_from_times(table[:, time]), tuple(names))


def _lines(text: TextIO) -> Iterator[str]:
    """Yield the lines of a table that hold something; one that never ends is refused while it is read."""
    while line := text.readline(MAX_LINE + 1):
        if len(line) > MAX_LINE:
            raise ValueError(f'it has a line of more than {MAX_LINE} characters; that is not a table')
        if line.strip() and not line.startswith('#'):
            yield line


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def rate_from_times(time_s: Array) -> float:
    """Return the rate of evenly spaced times, (n,); ValueError if they are not."""
    steps = np.diff(time_s)
    if not len(steps) or not np.median(steps) > 0:
        raise ValueError('its times do not rise; leave the column out and set `rate_hz`')
    if np.abs(steps / np.median(steps) - 1).max() > UNEVEN:
        raise ValueError(
            f'its times are uneven (steps of {steps.min():.4g} to {steps.max():.4g} s); resample it, or leave the '
            'column out and set `rate_hz`'
        )
    return float(len(steps) / (time_s[-1] - time_s[0]))


# --------------------
# Recordings in files that other programs write: CSV, WAV, NumPy.

# What the readers of numpy and scipy raise at files that are damaged or something else, found by trying.
READ_ERRORS = (
    ValueError,
    KeyError,
    EOFError,
    ArithmeticError,
    MemoryError,
    NotImplementedError,
    UnboundLocalError,
    TypeError,
    struct.error,
)


def load_recording(path: Path) -> FileRecording:
    """Return what is recorded in a .csv, .wav, .npy or .npz file; no file can run code."""
    if path.suffix.lower() not in LOADERS:
        raise InvalidData(f"recording '{path}' ends in '{path.suffix}'; allowed are {', '.join(LOADERS)}")
    try:
        with open_regular(path) as file:
            recording = LOADERS[path.suffix.lower()](file)
    except OSError as error:
        raise InvalidData(f"recording '{path}' cannot be read: {error.strerror or error}; give another path") from error
    except READ_ERRORS as error:
        raise InvalidData(f"recording '{path}' is not usable: {error}") from error
    if recording.samples.ndim != 2 or 0 in recording.samples.shape:
        raise InvalidData(
            f"recording '{path}' holds an array of shape {recording.samples.shape}; (n_samples, n_channels) is needed"
        )
    if recording.channels and len(recording.channels) != recording.samples.shape[1]:
        raise InvalidData(
            f"recording '{path}' names {len(recording.channels)} channels and has {recording.samples.shape[1]}; "
            'one name for each is needed'
        )
    if recording.rate_hz is not None and not 0 < recording.rate_hz < np.inf:
        raise InvalidData(f"recording '{path}' has a rate of {recording.rate_hz} Hz; one above 0 is needed")
    return recording


def load_wav(file: BinaryIO) -> FileRecording:
    """Return a WAV file; whole numbers are scaled so that full scale is 1."""
    from scipy.io import wavfile  # noqa: PLC0415 – no other recording and no device needs scipy

    with warnings.catch_warnings():
        warnings.simplefilter('ignore', wavfile.WavFileWarning)  # chunks of no interest
        rate_hz, samples = wavfile.read(file)
    if samples.dtype == np.uint8:  # WAV's only unsigned format
        samples = samples.astype(np.int16) - 128
        full_scale = 128.0
    else:
        full_scale = -float(np.iinfo(samples.dtype).min) if samples.dtype.kind == 'i' else 1.0
    return FileRecording(_columns(samples) / full_scale, float(rate_hz))


def load_npy(file: BinaryIO) -> FileRecording:
    """Return an array of shape (n_samples, n_channels) or (n_samples,)."""
    return FileRecording(_columns(read_array(file)))


def load_npz(file: BinaryIO) -> FileRecording:
    """Return the array `samples`; `rate_hz` and `channels` next to it are used if present.

    Raises
    ------
    ValueError
        If there is no array of real numbers called `samples`.
    """
    arrays = Arrays(file)
    if 'samples' not in arrays:
        raise ValueError(f"it holds {', '.join(arrays.names) or 'nothing'}; an array called 'samples' is needed")
    rate_hz = float(arrays['rate_hz']) if 'rate_hz' in arrays else None
    channels = tuple(str(name) for name in np.atleast_1d(arrays['channels'])) if 'channels' in arrays else ()
    return FileRecording(_columns(arrays['samples']), rate_hz, channels)


def _columns(values: AnyArray) -> Samples:
    if values.dtype.kind not in 'iuf':
        raise ValueError(f'it holds values of type {values.dtype}; real numbers are needed')
    samples: Samples = values.astype(np.float64, copy=False)
    return samples[:, None] if samples.ndim == 1 else samples


LOADERS: Mapping[str, Callable[[BinaryIO], FileRecording]] = {
    '.csv': load_csv,
    '.wav': load_wav,
    '.npy': load_npy,
    '.npz': load_npz,
}


# --------------------
# A recording as a sensor of the suite.

UNKNOWN_RATE_HZ = 1.0  # until the file is open
LONGEST_DELAY_S = 1.0  # after a longer stall of the machine the rest comes later, and not all at once


@dataclass(frozen=True)
class FileSettings:
    """How a recording is played; its path is the `device`."""

    rate_hz: float = param(
        0.0, 'Sampling rate of every channel; 0 takes the rate that the file states.', unit='Hz', low=0.0, high=1e6
    )
    speed: float = param(
        1.0, 'Playback rate relative to real time; 0: as fast as it can be read.', low=0.0, high=1000.0
    )
    loop: bool = param(False, 'Repeats the file from the beginning at its end.')
    topic: str = param('signal', 'Topic on which the samples are published.', choices=('signal', 'signal_static'))
    unit: str = param('', 'Unit of the published samples; the file does not state one.')


class FilePlayer:
    """Play a file, from its beginning at each opening. See `texture_core.types.Sensor`.

    The stamps are those of the recording, beginning at the time of opening: at another speed than 1 they do not go with
    the host's clock.
    """

    def __init__(self, params: SensorParams, now_ns: Callable[[], int] = time.time_ns) -> None:
        self._params = params
        self._settings = load_settings(FileSettings, params.config)
        self._now_ns = now_ns
        self._rate_hz = self._settings.rate_hz or UNKNOWN_RATE_HZ
        self._samples: NDArray[np.float32] | None = None  # while open
        self._channels: tuple[str, ...] = ()
        self._per_batch = 1
        self._opened = self._played = self._times_played = 0
        self._start_ns = 0  # of this opening
        self._first_index = self._position = 0  # index of the first sample of this opening; samples since then

    def open(self) -> None:
        """Load the file and begin; the index continues, with a jump as long as the player was closed.

        Raises
        ------
        DeviceError
            If there is no such file, or it is no recording.
        """
        recording = self._load()
        now_ns = self._now_ns()
        if self._opened:
            self._first_index += max(self._position, self._due(now_ns))
        self._opened += 1
        self._start_ns, self._position = now_ns, 0
        self._rate_hz = self._settings.rate_hz or recording.rate_hz or UNKNOWN_RATE_HZ
        self._per_batch = max(1, round(self._params.batch_s * self._rate_hz))
        self._samples = recording.samples.astype(np.float32)
        self._channels = recording.channels or tuple(f'channel_{i + 1}' for i in range(self._samples.shape[1]))

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for the length of one batch and return what is due; nothing after the end.

        Raises
        ------
        DeviceError
            If the recording is not open.
        """
        samples = self._samples
        if samples is None:
            raise DeviceError(f"recording '{self._params.device}' is not open; open it before reading")
        if self._settings.speed == 0 and self._has_more(samples):
            return {self._settings.topic: [self._batch(samples)]}
        time.sleep(self._params.batch_s)
        due = min(self._due(self._now_ns()), self._position + round(LONGEST_DELAY_S * self._pace_hz))
        batches = []
        while self._has_more(samples) and self._position + self._per_batch <= due:
            batches.append(self._batch(samples))
        return {self._settings.topic: batches}

    def close(self) -> None:
        """Stop."""
        self._samples = None

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples played, and how often the recording was played to its end."""
        return {
            'samples': self._played,
            'lost': 0,
            'reopened': max(0, self._opened - 1),
            'times played': self._times_played,
        }

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Rate at which samples come."""
        return {self._settings.topic: self._pace_hz}

    @property
    def _pace_hz(self) -> float:
        return self._rate_hz * (self._settings.speed or 1.0)

    def _load(self) -> FileRecording:
        try:
            recording = load_recording(Path(self._params.device).expanduser())
        except InvalidData as error:
            raise DeviceError(str(error)) from error
        if not (self._settings.rate_hz or recording.rate_hz):
            raise DeviceError(f"recording '{self._params.device}' has no rate; set `rate_hz` in the settings")
        return recording

    def _has_more(self, samples: NDArray[np.float32]) -> bool:
        return self._position < len(samples) or self._settings.loop

    def _due(self, now_ns: int) -> int:
        """Return how many samples should have been played since the opening."""
        return round((now_ns - self._start_ns) / NANOSECONDS * self._pace_hz)

    def _batch(self, samples: NDArray[np.float32]) -> TactileSignal:
        """Return the next batch, which never goes over the end."""
        begin = self._position % len(samples)
        played = samples[begin : begin + self._per_batch]
        batch = TactileSignal(
            stamp_ns=self._start_ns + round(self._position / self._rate_hz * NANOSECONDS),
            sensor=f'file/{Path(self._params.device).stem}',
            channels=self._channels,
            units=(self._settings.unit,) * len(self._channels),
            sampling_rate_hz=self._rate_hz,
            first_sample=self._first_index + self._position,
            samples=played,
            frame_id=self._params.frame_id,
        )
        self._position += len(played)
        self._played += len(played)
        self._times_played += begin + len(played) == len(samples)
        return batch

"""A recording as a sensor of the suite."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import DeviceError, InvalidData
from texture_core.parameters import param
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_drivers.file.file_recording import FileRecording
from texture_drivers.file.recording import load_recording
from texture_drivers.params import SensorParams
from texture_drivers.settings import load_settings

UNKNOWN_RATE_HZ = 1.0  # until the file is open
LONGEST_DELAY_S = 1.0  # after a longer stall of the machine the rest comes later, and not all at once


@dataclass(frozen=True)
class FileSettings:
    """How a recording is played; its path is the `device`."""

    rate_hz: float = param(
        0.0,
        'Sets the sampling rate of every channel; 0 takes the rate that the file states.',
        unit='Hz',
        low=0.0,
        high=1e6,
    )
    speed: float = param(
        1.0,
        'Sets how many times faster than real time the file is played; 0 plays it as fast as it can be read.',
        low=0.0,
        high=1000.0,
    )
    loop: bool = param(False, 'Starts the file again from the beginning when its end is reached.')
    topic: str = param(
        'signal', 'Sets the topic on which the samples are published.', choices=('signal', 'signal_static')
    )
    unit: str = param('', 'Sets the unit of the published samples; the file does not state one.')


class FilePlayer:
    """Play a file, from its beginning at each opening. See `texture_core.protocols.Sensor`.

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
        """Load the file and begin; the index goes on, with a jump as long as the player was closed.

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
            raise DeviceError(
                f"recording '{self._params.device}' does not tell its rate; set `rate_hz` in the settings"
            )
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

"""Scans as plain arrays, such as simulated ones, cut into the windows that a recipe asks for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array, Samples
from texture_core.errors import InvalidData
from texture_estimation.search.labelled_windows import LabelledWindows
from texture_features.feature import WindowBatch
from texture_features.windowing.windows import WindowParams

# Of a sample: lengths in seconds are seldom exact.
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class ArrayStream:
    """Scans of one input.

    Parameters
    ----------
    samples : (n_scans, n_samples, n_channels)
    rate_hz
        Sampling rate.
    channels
        Name of each channel; () where nothing names them.
    """

    samples: Samples
    rate_hz: float
    channels: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SlideArrays:
    """Equally long scans of known surfaces; called with window parameters it gives their windows.

    Parameters
    ----------
    streams
        By topic.
    labels : (n_scans,) of text
        Surface of each scan.
    speed_m_s, force_n : (n_scans,)
        As the exploration tells them.

    Examples
    --------
    >>> stream = ArrayStream(np.zeros((2, 100, 1)), rate_hz=100.0)
    >>> slides = SlideArrays({'signal': stream}, np.array(['cork', 'felt']), np.full(2, 0.05), np.ones(2))
    >>> slides(WindowParams(length_s=0.5, hop_s=0.5)).labels.tolist()  # two windows of each
    ['cork', 'cork', 'felt', 'felt']
    """

    streams: Mapping[str, ArrayStream]
    labels: NDArray[np.str_]
    speed_m_s: Array
    force_n: Array
    _known: dict[WindowParams, LabelledWindows] = field(default_factory=dict, repr=False)

    def of(self, chosen: NDArray[np.bool_]) -> SlideArrays:
        """Return some of the scans; `chosen` is (n_scans,).

        Parameters
        ----------
        chosen : (n_slides,) bool
            Which are kept.
        """
        streams = {topic: replace(stream, samples=stream.samples[chosen]) for topic, stream in self.streams.items()}
        return SlideArrays(streams, self.labels[chosen], self.speed_m_s[chosen], self.force_n[chosen])

    def __call__(self, windows: WindowParams) -> LabelledWindows:
        """Return the windows, scan by scan.

        Raises
        ------
        InvalidData
            If a scan is shorter than a window.
        """
        if windows not in self._known:
            self._known[windows] = self._cut(windows)
        return self._known[windows]

    def _cut(self, windows: WindowParams) -> LabelledWindows:
        duration_s = min(stream.samples.shape[1] / stream.rate_hz for stream in self.streams.values())
        count = int((duration_s - windows.skip_s - windows.length_s) / windows.hop_s + ROUNDING) + 1
        if duration_s - windows.skip_s < windows.length_s - ROUNDING:
            raise InvalidData(
                f'scans of {duration_s:g} s have no window of {windows.length_s:g} s after {windows.skip_s:g} s; '
                'use shorter windows or longer scans'
            )
        speed, force = np.repeat(self.speed_m_s, count), np.repeat(self.force_n, count)
        inputs = {
            topic: WindowBatch(
                _cut_stream(stream, windows, count), stream.rate_hz, speed, force, channels=stream.channels
            )
            for topic, stream in self.streams.items()
        }
        groups = np.array([f'{number:06d}' for number in range(len(self.labels))])
        return LabelledWindows(inputs, np.repeat(self.labels, count), np.repeat(groups, count))


def _cut_stream(stream: ArrayStream, windows: WindowParams, count: int) -> Samples:
    length = round(windows.length_s * stream.rate_hz)
    starts = [round((windows.skip_s + number * windows.hop_s) * stream.rate_hz) for number in range(count)]
    cut = np.stack([stream.samples[:, start : start + length] for start in starts], axis=1)
    return cut.reshape(-1, *cut.shape[2:])

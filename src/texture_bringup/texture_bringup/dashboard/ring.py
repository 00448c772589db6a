"""The newest samples of one stream, and how they are drawn with few numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texture_core.signal import TactileSignal

MAX_SAMPLES = 100_000


class Ring:
    """Keep the newest samples of the first channel of a stream.

    Parameters
    ----------
    length_s
        So much is kept; never more than `MOST_SAMPLES`.
    """

    def __init__(self, length_s: float) -> None:
        self._length_s = length_s
        self._samples: NDArray[np.float64] = np.zeros(0)
        self._at = 0
        self._next: int | None = None
        self.rate_hz = 0.0
        self.sensor = ''
        self.channel = ''
        self.unit = ''
        self.lost = 0

    def update(self, signal: TactileSignal) -> None:
        """Append a batch; a stream of another sensor or rate starts again, lost samples leave a gap of NaN."""
        if (signal.sensor, signal.sampling_rate_hz) != (self.sensor, self.rate_hz):
            self._begin(signal)
        gap = 0 if self._next is None else max(0, signal.first_sample - self._next)
        self._next = signal.next_sample
        self.lost += gap
        fresh = signal.samples[:, 0].astype(np.float64)
        if gap:
            fresh = np.concatenate([np.full(min(gap, len(self._samples)), np.nan), fresh])
        self._append(fresh[-len(self._samples) :])

    def newest(self, length_s: float) -> NDArray[np.float64]:
        """Return the newest samples, (n_samples,), oldest first; NaN where none came yet.

        Parameters
        ----------
        length_s
            Length of the stretch.

        Returns
        -------
        (n_samples,)
            In the unit of the signal.
        """
        count = min(len(self._samples), round(length_s * self.rate_hz))
        return np.roll(self._samples, -self._at)[len(self._samples) - count :]

    def _begin(self, signal: TactileSignal) -> None:
        size = int(np.clip(round(self._length_s * signal.sampling_rate_hz), 1, MAX_SAMPLES))
        self._samples = np.full(size, np.nan)
        self._at, self._next = 0, None
        self.rate_hz, self.sensor = signal.sampling_rate_hz, signal.sensor
        self.channel, self.unit = signal.channels[0], signal.common_unit

    def _append(self, fresh: NDArray[np.float64]) -> None:
        places = (self._at + np.arange(len(fresh))) % len(self._samples)
        self._samples[places] = fresh
        self._at = (self._at + len(fresh)) % len(self._samples)


def envelope(samples: NDArray[np.float64], points: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and the greatest sample of `points` stretches: no peak is lost, however few are drawn.

    Parameters
    ----------
    samples : (n_samples,)

    Returns
    -------
    low, high : (points,), or as many as there are samples; NaN where there is none
    """
    points = min(points, len(samples))
    if points == 0:
        return np.zeros(0), np.zeros(0)
    edges = np.linspace(0, len(samples), points, endpoint=False).astype(int)
    low = np.fmin.reduceat(samples, edges)
    high = np.fmax.reduceat(samples, edges)
    return low, high


def spectrum_db(samples: NDArray[np.float64], bins: int) -> NDArray[np.float64]:
    """Return the amplitude from 0 Hz to half the rate in dB of one unit, the greatest of each bin; empty if gaps.

    A sine of amplitude 1 reads 0 dB (Hann window, its gain taken out).

    Parameters
    ----------
    samples : (n_samples,)

    Returns
    -------
    (bins,), or fewer if there are few samples
    """
    if len(samples) < 16 or not np.isfinite(samples).all():
        return np.zeros(0)
    window = np.hanning(len(samples))
    amplitude = 2.0 * np.abs(np.fft.rfft(window * (samples - samples.mean()))) / window.sum()
    bins = min(bins, len(amplitude))
    edges = np.linspace(0, len(amplitude), bins, endpoint=False).astype(int)
    levels: NDArray[np.float64] = 20.0 * np.log10(np.maximum(np.maximum.reduceat(amplitude, edges), 1e-6))
    return levels

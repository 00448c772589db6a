# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Materials by surface texture (Jamali & Sammut 2010): peaks grown from regions, naive Bayes.

What the paper describes and what is done here, element by element:

run
    :Paper: Down to about 1 N, straight at a constant speed, up (V.C). Speed and length are not given.
    :Here: Preset `jamali`: 0.05 m/s for 2 s.
signals
    :Paper: Four PVDF films and four strain gauges at 2.5 kHz, low-pass of 500 Hz (III, V.B).
    :Here: The same: all eight channels.
contact
    :Paper: Cut by hand, "the entire interval" (IV.A).
    :Here: Steady sliding alone, by the states of the exploration or found in the signal.
peaks
    :Paper: Algorithm 1: equal regions by energy, neighbours joined; their number is not given (IV.A).
    :Here: `RegionPeaks` with 32 regions: the frequency of the largest coefficient of each peak (IV.B).
learner
    :Paper: Naive Bayes of Weka (IV.B, VI).
    :Here: scikit-learn's `GaussianNB`: normal distributions of standardised features.
baseline
    :Paper: "Average amplitude", "averaging the signals of each sensor" in the middle third (VI).
    :Here: `MeanAmplitude`, the mean of `|s|`, the reading nearest to the words and to 65.75 %.
future work
    :Paper: Short-term Fourier and wavelet transform, symbols (VII), without figures.
    :Here: Left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.types import Array
from texture_features.features.spectral import amplitudes_of
from texture_features.windows import WindowBatch


@dataclass(frozen=True)
class RegionPeaks:
    """Frequency (Hz) of the largest Fourier coefficient in each of the peaks that the regions of highest energy form.

    The paper takes "the Fourier coefficients" in one place and "one frequency for each peak" in another; the latter is
    meant here.

    Source: Jamali & Sammut 2010, Algorithm 1.
    """

    per_channel: ClassVar[bool] = True

    peaks: int = param(3, 'Number of peaks; those that the spectrum lacks have frequency 0.', low=1, high=64)
    regions: int = param(32, 'Number of equal regions into which the spectrum is divided.', low=2, high=4096)
    order: str = param(
        'intensity',
        "How the peaks are ranked: 'intensity' as found, by their strongest region; by 'frequency', the lowest first.",
        choices=('intensity', 'frequency'),
    )
    points: int = param(2048, 'FFT length in samples; a shorter window is zero-padded.', low=8, high=1 << 20)

    @property
    def names(self) -> tuple[str, ...]:
        """Frequency of each peak in turn; peaks are numbered from 1."""
        return tuple(f'{number + 1}/frequency_hz' for number in range(self.peaks))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the frequency of each peak."""
        amplitudes, step_hz = amplitudes_of(windows, self.points)
        bins = region_peaks(amplitudes, self.peaks, self.regions, by_frequency=self.order == 'frequency')
        return bins * step_hz


def region_peaks(spectrum: Array, count: int, regions: int, *, by_frequency: bool = False) -> Array:
    """Return the bin of the largest coefficient in each peak, 0 for those that are lacking.

    Regions are taken in the order of their energy, of equal ones the lowest first. One that touches no peak opens a new
    one; one that touches a peak widens it, and one that touches two makes them one. This ends when there are `count`
    peaks. If there never are, it ends where there first were most: going on would only merge them.
    """
    regions = min(regions, max(1, spectrum.shape[-1] - 1))
    starts = 1 + np.arange(regions) * (spectrum.shape[-1] - 1) // regions
    energies = np.add.reduceat(spectrum * spectrum, starts, axis=-1)
    rank = np.argsort(np.argsort(-energies, axis=-1, kind='stable'), axis=-1, kind='stable')
    taken = rank <= _last_step(rank, count)[..., None]
    opens = taken.copy()
    opens[..., 1:] &= ~taken[..., :-1]
    peak = np.where(taken, np.cumsum(opens, axis=-1) - 1, -1)
    widths = np.diff(np.append(starts, spectrum.shape[-1]))
    bins = _largest(spectrum[..., 1:], np.repeat(peak, widths, axis=-1), count)
    found = bins if by_frequency else _first_step(peak, rank, count)
    order = np.argsort(np.where(bins > 0, found, np.inf), axis=-1, kind='stable')
    return np.asarray(np.take_along_axis(bins, order, axis=-1))


def _last_step(rank: NDArray[np.intp], count: int) -> NDArray[np.intp]:
    """Return at which step the growing ends, (...), given at which step each region is taken, (..., regions)."""
    steps = np.arange(rank.shape[-1])
    # Regions taken less neighbours both taken is the number of separate peaks; a pair is complete with its later one.
    complete = np.maximum(rank[..., 1:], rank[..., :-1])
    pairs = np.add.reduce(complete[..., None] <= steps, axis=-2)
    peaks = np.minimum(steps + 1 - pairs, count)
    return peaks.argmax(axis=-1)


def _largest(inside: Array, owner: NDArray[np.intp], count: int) -> Array:
    """Return the bin of the largest coefficient of each peak, (..., count), given the peak of each bin from 1 on."""
    bins = np.zeros((*inside.shape[:-1], count))
    for number in range(count):
        heights = np.where(owner == number, inside, 0.0)
        best = heights.argmax(axis=-1)
        present = np.take_along_axis(heights, best[..., None], axis=-1)[..., 0] > 0
        bins[..., number] = np.where(present, best + 1, 0)
    return bins


def _first_step(peak: NDArray[np.intp], rank: NDArray[np.intp], count: int) -> Array:
    """Return at which step the first, and so strongest, region of each peak was taken, (..., count)."""
    steps = [np.where(peak == number, rank, rank.shape[-1]).min(axis=-1) for number in range(count)]
    return np.stack(steps, axis=-1).astype(np.float64)


@dataclass(frozen=True)
class MeanAmplitude:
    """Mean of `|s|` of each channel, in its unit: the plainest measure of how it vibrates.

    The source says "average amplitude of the signal over a fixed window" and "averaging the signals of each sensor".

    Source: Jamali & Sammut 2010, section VI (the baseline there).
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean of the absolute signal."""
        return np.add.reduce(np.abs(windows.rows), axis=-1, keepdims=True) / windows.rows.shape[-1]

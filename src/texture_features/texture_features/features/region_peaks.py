"""Peaks of the spectrum, grown from the regions of highest energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.spectrum import amplitudes_of


@dataclass(frozen=True)
class RegionPeaks:
    """Frequency (Hz) of the largest Fourier coefficient in each of the peaks that the regions of highest energy form.

    The paper takes "the Fourier coefficients" in one place and "one frequency for each peak" in another: `heights`
    gives the amplitudes of the coefficients, too.

    Source: Jamali & Sammut 2010, Algorithm 1.

    Examples
    --------
    >>> tone = np.sin(2 * np.pi * 125.0 * np.arange(2048) / 1000.0)[:, None]
    >>> RegionPeaks(peaks=1)(WindowBatch(tone, rate_hz=1000.0)).item()
    125.0
    """

    per_channel: ClassVar[bool] = True

    peaks: int = param(3, 'Number of peaks; those that the spectrum lacks have frequency 0.', low=1, high=64)
    regions: int = param(32, 'Number of equal regions into which the spectrum is divided.', low=2, high=4096)
    order: str = param(
        'intensity',
        "How the peaks are ranked: 'intensity' as found, by their strongest region; by 'frequency', the lowest first.",
        choices=('intensity', 'frequency'),
    )
    heights: bool = param(False, 'Returns the amplitude of each peak in addition to its frequency.')
    points: int = param(2048, 'FFT length in samples; a shorter window is zero-padded.', low=8, high=1 << 20)

    @property
    def names(self) -> tuple[str, ...]:
        """Frequency of each peak in turn, with its amplitude if that is wanted; peaks are numbered from 1."""
        reported = ('frequency_hz', 'amplitude') if self.heights else ('frequency_hz',)
        return tuple(f'{number + 1}/{what}' for number in range(self.peaks) for what in reported)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the frequency of each peak, each followed by its amplitude if that is wanted."""
        amplitudes, step_hz = amplitudes_of(windows, self.points)
        bins = region_peaks(amplitudes, self.peaks, self.regions, by_frequency=self.order == 'frequency')
        if not self.heights:
            return bins * step_hz
        heights = np.where(bins > 0, np.take_along_axis(amplitudes, bins.astype(np.intp), axis=-1), 0.0)
        return np.stack((bins * step_hz, heights), axis=-1).reshape(*bins.shape[:-1], -1)


def region_peaks(spectrum: Array, count: int, regions: int, *, by_frequency: bool = False) -> Array:
    """Return the bin of the largest coefficient in each peak, 0 for those that are lacking.

    Regions are taken in the order of their energy, of equal ones the lowest first. One that touches no peak opens a new
    one; one that touches a peak widens it, and one that touches two makes them one. This ends when there are `count`
    peaks. If there never are, it ends where there first were most: going on would only merge them.

    Parameters
    ----------
    spectrum : (..., n_bins)
        Not negative; bin 0 is left out.
    count
        Number of peaks wanted.
    regions
        Number of equal parts, at most as many as there are bins.
    by_frequency
        Whether the peaks are ranked by their frequency, and not by their strongest region.

    Returns
    -------
    (..., count)
        As whole numbers; ranked by the strongest region of each peak, or by frequency.
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
    last: NDArray[np.intp] = peaks.argmax(axis=-1)
    return last


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

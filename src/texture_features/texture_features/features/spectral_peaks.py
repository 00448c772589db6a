"""The highest peaks of the spectrum, at least some distance apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch
from texture_features.spectra.spectrum import amplitudes_of


@dataclass(frozen=True)
class SpectralPeaks:
    """Frequency (Hz) and amplitude of the highest peaks of the Fourier transform.

    With 2048 points there are 1024 steps from 0 Hz to half the sampling rate, as in the paper (500 Hz there). Peaks
    that the spectrum lacks come last in either order; of equally high ones the lowest comes first.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.B.

    Examples
    --------
    >>> time_s = np.arange(2048) / 1024.0
    >>> tones = (np.sin(2 * np.pi * 50.0 * time_s) + 3 * np.sin(2 * np.pi * 200.0 * time_s))[:, None]
    >>> SpectralPeaks(peaks=2)(WindowBatch(tones, rate_hz=1024.0))[0].round(3).tolist()
    [200.0, 3.0, 50.0, 1.0]
    """

    per_channel: ClassVar[bool] = True

    peaks: int = param(
        5, 'Number of peaks; those that the spectrum lacks have frequency and amplitude 0.', low=1, high=64
    )
    gap_hz: float = param(
        10.0,
        'Sets the smallest distance between two peaks; a larger one suppresses side peaks.',
        unit='Hz',
        low=0.0,
        high=1e6,
    )
    order: str = param('intensity', 'Order in which the peaks are returned.', choices=('intensity', 'frequency'))
    points: int = param(2048, 'FFT length in samples; a shorter window is zero-padded.', low=8, high=1 << 20)

    @property
    def names(self) -> tuple[str, ...]:
        """Frequency and amplitude of each peak."""
        return tuple(f'{number + 1}/{what}' for number in range(self.peaks) for what in ('frequency_hz', 'amplitude'))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return frequency and amplitude of each peak in turn."""
        amplitudes, step_hz = amplitudes_of(windows, self.points)
        bins, heights = highest_peaks(amplitudes, self.peaks, self.gap_hz / step_hz)
        values = np.stack((bins * step_hz, heights), axis=-1)
        if self.order == 'frequency':
            values = by_frequency(values)
        return values.reshape(*values.shape[:-2], -1)


def by_frequency(peaks: Array) -> Array:
    """Return peaks, the one of the lowest frequency first and those that are lacking last.

    Parameters
    ----------
    peaks : (..., n_peaks, 2)
        Frequency (Hz) and amplitude of each; amplitude 0 for a peak that is lacking.

    Returns
    -------
    (..., n_peaks, 2)
        The same in another order.
    """
    found = np.where(peaks[..., 1:] > 0, peaks[..., :1], np.inf)
    ordered: Array = np.take_along_axis(peaks, np.argsort(found, axis=-2, kind='stable'), axis=-2)
    return ordered


def highest_peaks(spectrum: Array, count: int, gap: float) -> tuple[Array, Array]:
    """Return bins and heights of the highest local maxima, highest first; 0 and 0 for those that are lacking.

    Parameters
    ----------
    spectrum : (..., n_bins)
        Not negative.
    count
        Number of peaks wanted.
    gap
        A maximum closer than so many bins to a higher one is left out.

    Returns
    -------
    two arrays of shape (..., count)

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.B.
    """
    left = np.zeros_like(spectrum)
    middle = spectrum[..., 1:-1]
    is_peak = (middle > spectrum[..., :-2]) & (middle >= spectrum[..., 2:])
    left[..., 1:-1] = np.where(is_peak, middle, 0.0)
    bins, heights = np.zeros((2, *spectrum.shape[:-1], count))
    index = np.arange(spectrum.shape[-1])
    for number in range(count):
        best = left.argmax(axis=-1)[..., None]
        height = np.take_along_axis(left, best, axis=-1)
        heights[..., number] = height[..., 0]
        bins[..., number] = np.where(height > 0, best, 0)[..., 0]
        left[np.abs(index - best) < max(gap, 1.0)] = 0.0
    return bins, heights

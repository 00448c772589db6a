# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Materials by surface texture (Jamali & Sammut 2010): peaks grown from regions, naive Bayes.

What the paper says and what is done here, element by element:

run
    Paper: Down to about 1 N, straight at a constant speed, up (V.C). Speed and length are not told.
    Here: Preset `jamali`: 0.05 m/s for 2 s.
signals
    Paper: Four PVDF films and four strain gauges at 2.5 kHz, low-pass of 500 Hz (III, V.B).
    Here: The same: all eight channels.
contact
    Paper: Cut by hand, "the entire interval" (IV.A).
    Here: Steady sliding alone, by the states of the exploration or found in the signal.
peaks
    Paper: Algorithm 1: equal regions by energy, neighbours joined; their number is not told (IV.A).
    Here: `RegionPeaks` with 32 regions: the frequency of the largest coefficient of each peak (IV.B).
learner
    Paper: Naive Bayes of Weka (IV.B, VI).
    Here: scikit-learn's `GaussianNB`: normal distributions of standardised features.
baseline
    Paper: "Average amplitude", "averaging the signals of each sensor" in the middle third (VI).
    Here: `MeanAmplitude`, the mean of |s|, the reading nearest to the words and to 65.75 %.
future work
    Paper: Short-term Fourier and wavelet transform, symbols (VII), without figures.
    Here: `jamali-stft`, `-wavelets`, `-symbols`; what of them is taken is ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, permutations
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
    """Mean of |s| of each channel, in its unit: the plainest measure of how it vibrates.

    The source says "average amplitude of the signal over a fixed window" and "averaging the signals of each sensor".

    Source: Jamali & Sammut 2010, section VI (the baseline there).
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean of the absolute signal."""
        return np.add.reduce(np.abs(windows.rows), axis=-1, keepdims=True) / windows.rows.shape[-1]


# Scaling filter of Daubechies' wavelet with four vanishing moments: Daubechies 1992, table 6.1, to double precision.
DB4 = np.array([
    0.23037781330885523, 0.7148465705525415, 0.6308807679295904, -0.02798376941698385,
    -0.18703481171888114, 0.030841381835986965, 0.032883011666982945, -0.010597401784997278,
])  # fmt: skip
# The wavelet filter is the scaling filter backwards with alternating signs.
FILTERS = np.stack((DB4, DB4[::-1] * np.array([1.0, -1.0] * 4)), axis=1)


@dataclass(frozen=True)
class WaveletEnergy:
    """Logarithm of the mean power in each octave of Daubechies' wavelet 'db4', the finest first, and in the rest.

    Octave k reaches about from rate / 2^(k+1) to rate / 2^k. A window is continued periodically, after its last sample
    is repeated where their number is odd. Octaves that a window is too short for hold no power.
    """

    per_channel: ClassVar[bool] = True

    octaves: int = param(6, 'Number of octaves of the wavelet transform; more reach lower frequencies.', low=1, high=20)
    floor: float = param(
        1e-20, 'Power added before the logarithm, so that silence gives a finite value, unit².', low=1e-300, high=1e300
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Number of the octave, from 1, and 'rest' for what lies below the last."""
        return (*(str(octave + 1) for octave in range(self.octaves)), 'rest')

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(power + floor)."""
        rows = windows.centred_rows
        return np.log(wavelet_energies(rows, self.octaves) / rows.shape[-1] + self.floor)


def wavelet_energies(rows: Array, octaves: int) -> Array:
    """Return the sum of squares of the coefficients of each octave, the finest first, and of the rest."""
    energies = np.zeros((*rows.shape[:-1], octaves + 1))
    for octave in range(octaves):
        if rows.shape[-1] == 1:
            break
        both = _halve(rows)
        detail = both[..., 1]
        energies[..., octave] = np.add.reduce(detail * detail, axis=-1)
        rows = np.ascontiguousarray(both[..., 0])
    energies[..., -1] = np.add.reduce(rows * rows, axis=-1)
    return energies


def _halve(rows: Array) -> Array:
    """Return the two halves of the spectrum of rows at half the rate, (..., ceil(n_samples / 2), 2)."""
    half = (rows.shape[-1] + 1) // 2
    taps = np.minimum((2 * np.arange(half)[:, None] + np.arange(len(DB4)) - 3) % (2 * half), rows.shape[-1] - 1)
    return np.take(rows, taps, axis=-1) @ FILTERS


_PATTERNS = {length: tuple(permutations(range(length))) for length in range(2, 6)}


@dataclass(frozen=True)
class OrdinalPatterns:
    """Share of each order of `length` samples, `delay` apart, such as rising, falling or peaked.

    Neither an offset nor a gain of the sensor changes it. Of equal samples the earlier counts as the lower; a window
    too short for one pattern has 0 everywhere.

    Source: Bandt & Pompe 2002.
    """

    per_channel: ClassVar[bool] = True

    length: int = param(4, 'Number of samples in a pattern; there are factorial(length) patterns.', low=2, high=5)
    delay: int = param(
        2,
        'Distance between the samples of a pattern, in samples; a larger one describes lower frequencies.',
        low=1,
        high=10_000,
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Rank of each sample of the pattern from the lowest, 0: '012' rises."""
        return tuple(''.join(map(str, ranks)) for ranks in permutations(range(self.length)))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the shares."""
        rows = windows.rows
        count = len(_PATTERNS[self.length])
        symbols = _symbols(rows, self.length, self.delay)
        if not symbols.shape[-1]:
            return np.zeros((*rows.shape[:-1], count))
        of_row = np.arange(symbols.size // symbols.shape[-1]).reshape(*symbols.shape[:-1], 1)
        found = np.bincount((symbols + count * of_row).ravel(), minlength=count * of_row.size)
        return found.reshape(*rows.shape[:-1], count) / symbols.shape[-1]


def _symbols(rows: Array, length: int, delay: int) -> NDArray[np.intp]:
    """Return the number of the pattern that begins at each sample, (..., n_samples - (length - 1) · delay)."""
    count = max(0, rows.shape[-1] - (length - 1) * delay)
    samples = [rows[..., item * delay : item * delay + count] for item in range(length)]
    code = np.zeros((*rows.shape[:-1], count), dtype=np.intp)
    for bit, (earlier, later) in enumerate(combinations(range(length), 2)):
        code |= (samples[earlier] > samples[later]).astype(np.intp) << bit
    return _pattern_of_code(length)[code]


@lru_cache
def _pattern_of_code(length: int) -> NDArray[np.intp]:
    """Return the number of the pattern whose falling pairs are the bits of each code; codes of no pattern give 0."""
    table = np.zeros(1 << (length * (length - 1) // 2), dtype=np.intp)
    for number, ranks in enumerate(_PATTERNS[length]):
        pairs = enumerate(combinations(ranks, 2))
        table[sum((earlier > later) << bit for bit, (earlier, later) in pairs)] = number
    return table

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
    Here: `RegionPeaks` with 32 regions: the frequency of the largest coefficient of each peak (IV.B); `…-heights`
        has the coefficients, too.
learner
    Paper: Naive Bayes of Weka (IV.B, VI).
    Here: `NaiveBayes` with normal distributions; `…-heights` counts in bins that were tuned on recordings.
baseline
    Paper: "Average amplitude", "averaging the signals of each sensor" in the middle third (VI).
    Here: `MeanAmplitude`, the mean of |s|, the reading nearest to the words and to 65.75 %; the experiment has the
        others.
future work
    Paper: Short-term Fourier and wavelet transform, symbols (VII), without figures.
    Here: `jamali-stft`, `-wavelets`, `-symbols`; what of them is taken is ours.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, permutations
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.types import Array
from texture_estimation.learners.learner import (
    UNCALIBRATED,
    Codes,
    Fitted,
    Predictor,
    assign_folds,
    held_out_scores,
    log_softmax,
    standardisation,
)
from texture_estimation.learners.sklearn_learner import SklearnPredictor, packed
from texture_features.features.spectral import amplitudes_of
from texture_features.windows import WindowBatch


@dataclass(frozen=True)
class RegionPeaks:
    """Frequency (Hz) of the largest Fourier coefficient in each of the peaks that the regions of highest energy form.

    The paper takes "the Fourier coefficients" in one place and "one frequency for each peak" in another: `heights`
    gives the amplitudes of the coefficients, too.

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


AVERAGED: Mapping[str, Callable[[WindowBatch], Array]] = {
    'deviation': lambda windows: np.abs(windows.centred_rows),
    'magnitude': lambda windows: np.abs(windows.rows),
    'signal': lambda windows: windows.rows,
}


@dataclass(frozen=True)
class MeanAmplitude:
    """Mean amplitude of each channel, in its unit: the plainest measure of how it vibrates.

    The source says "average amplitude of the signal over a fixed window" and "averaging the signals of each sensor",
    which can be read as the mean of |s - mean(s)|, of |s| or of s itself.

    Source: Jamali & Sammut 2010, section VI (the baseline there).
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    of: str = param(
        'deviation',
        "What is averaged: 'deviation' takes |s - mean(s)|, 'magnitude' takes |s|, 'signal' takes s itself.",
        choices=tuple(AVERAGED),
    )
    logarithm: bool = param(False, 'Returns the logarithm of the absolute amplitude instead of the amplitude itself.')
    floor: float = param(
        1e-10,
        'Amplitude added before the logarithm, so that silence gives a finite value, unit.',
        low=1e-300,
        high=1e300,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the mean, or the logarithm of its absolute value."""
        rows = AVERAGED[self.of](windows)
        amplitudes: Array = np.add.reduce(rows, axis=-1, keepdims=True) / rows.shape[-1]
        return np.log(np.abs(amplitudes) + self.floor) if self.logarithm else amplitudes


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


FOLDS = 5


@dataclass(frozen=True)
class NaiveBayes:
    """Each feature is distributed for each label independently of the others.

    Source: Jamali & Sammut 2010, section IV.B.
    """

    smoothing: float = param(
        1e-9,
        'Variance added to each class, as a fraction of the variance over all classes; a larger one smooths more.',
        low=1e-12,
        high=1.0,
    )
    bins: int = param(
        0,
        'Number of equally filled histogram bins per feature; 0 takes normal distributions.',
        low=0,
        high=1000,
    )

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        n_labels = int(y.max()) + 1
        split = assign_folds(y, groups, FOLDS)
        parameters = self._fit(X, y, n_labels)
        if split is None:
            return Fitted(parameters, None, UNCALIBRATED)
        held_out = held_out_scores(
            lambda held: self.predictor(self._fit(X[~held], y[~held], n_labels)), X, split[0], n_labels
        )
        return Fitted(parameters, held_out, f'not calibrated; growth from {split[1]}')

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Predictor:
        """Return the predictor made from the stored parameters."""
        if 'edges' not in parameters:
            return SklearnPredictor.of_packed(**parameters)
        edges, log_shares, log_priors = (parameters[name] for name in ('edges', 'log_shares', 'log_priors'))

        def predict(X: Array) -> Array:
            shares = log_shares[np.arange(len(edges)), bins_of(X, edges)]
            return log_softmax(np.add.reduce(shares, axis=-2) + log_priors)

        return predict

    def _fit(self, X: Array, y: Codes, n_labels: int) -> dict[str, Any]:
        return self._counted(X, y, n_labels) if self.bins else self._normal(X, y, n_labels)

    def _counted(self, X: Array, y: Codes, n_labels: int) -> dict[str, Any]:
        edges = np.quantile(X, np.arange(1, self.bins) / self.bins, axis=0).T
        places = bins_of(X, edges)
        counts = np.ones((X.shape[1], self.bins, n_labels))  # none is impossible because it never occurred
        np.add.at(counts, (np.arange(X.shape[1]), places, y[:, None]), 1.0)
        log_priors = np.log(np.bincount(y, minlength=n_labels) / len(y))
        return {
            'edges': edges,
            'log_shares': np.log(counts / counts.sum(axis=1, keepdims=True)),
            'log_priors': log_priors,
        }

    def _normal(self, X: Array, y: Codes, n_labels: int) -> dict[str, Any]:
        from sklearn.naive_bayes import GaussianNB  # noqa: PLC0415  # scikit-learn takes a second to import

        mean, scale = standardisation(X)
        bayes = GaussianNB(var_smoothing=0.0).fit((X - mean) / scale, y)
        bayes.var_ += self.smoothing  # of variance 1; of constant features, too, where scikit-learn would add nothing
        stored = packed(bayes, 'GaussianNB')
        return {'packed': stored, 'mean': mean, 'scale': scale, 'n_labels': n_labels, 'floor': 0.0}


def bins_of(values: Array, edges: Array) -> Codes:
    """Return how many edges, (n_features, n_edges), each value lies above, (..., n_features)."""
    return np.count_nonzero(values[..., None] > edges, axis=-1)

"""Onset of motion from the shift of the spectrum while the finger accelerates.

At half the speed all lines of a texture stand at half the frequency. So the spectrum at steady speed, squeezed by the
speed of the moment, tells what each short window of the ramp should hold, and the most likely moment of setting off is
taken (Whittle's likelihood: the powers of a spectrum are exponentially distributed about their means).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.ndimage import convolve1d
from scipy.signal import welch

from texture_core.arrays import AnyArray, Array, Samples
from texture_features.segmentation.cell_power import TINY, highpass, highpass_gain, median_centred

# What a vibration channel senses, and the powers of the speed with which the amplitude of one and the same wave of a
# texture then grows: films that hold their charge and hydrophones feel the force, differentiating channels its change.
# A change grows as the speed, and where waves rise towards the corner of a high-pass, faster.
MEASURED_QUANTITIES: Mapping[str, tuple[float, ...]] = {
    'force': (0.0,),
    'change': (1.0, 1.5),
    'either': (0.0, 0.5, 1.0, 1.5),
}
WINDOW_S, STEADY_WINDOW_S = 0.05, 0.25
MIN_STEADY = 8  # samples, for a spectrum
HOPS_PER_WINDOW, ONSETS_PER_HOP = 5, 4
# Windows that overlap tell much of the same: a Hann window weighs as much as two thirds of its length.
NEW_IN_WINDOW = 1.5 / HOPS_PER_WINDOW
SHARES = np.linspace(0.0, 1.0, 41)  # of the steady speed
# Multiples of the band at which the spectrum above it is looked at.
ABOVE = np.geomspace(1.2, 1000.0, 12)
# Of a line, through a Hann window: power at offsets of quarters of a bin, up to two bins.
QUARTERS = 4
OFFSETS = np.arange(-2 * QUARTERS, 2 * QUARTERS + 1) / QUARTERS
HANN = np.square(np.sinc(OFFSETS) + 0.5 * np.sinc(OFFSETS - 1.0) + 0.5 * np.sinc(OFFSETS + 1.0))
HANN /= HANN.sum()
# Points of a window at which the speed is looked at, and what they weigh in it.
POINTS = (np.arange(20) + 0.5) / 20
POINT_WEIGHTS = np.sin(np.pi * POINTS) ** 4 / (np.sin(np.pi * POINTS) ** 4).sum()
# One value in a hundred is of something else, of any power over nine decades (20 nats).
ANYTHING = float(np.log(0.01 / 20))
MIN_POWER = 0.01  # of the noise


@dataclass(frozen=True)
class OnsetModel:
    """How a finger gains speed, and what its vibration channels make of it.

    Parameters
    ----------
    rate_hz
        Sampling rate.
    rest : (n_channels,)
        Power of each channel at rest.
    ramp_s
        Time in which the speed grows, in proportion to time.
    quantity
        One of `MEASURED_QUANTITIES`.
    smooth_s
        What changes over longer is no vibration.

    Examples
    --------
    >>> model = OnsetModel(2000.0, np.ones(1), ramp_s=0.2, quantity='force', smooth_s=0.05)
    >>> steady = np.random.default_rng(0).standard_normal((1000, 1))
    >>> model.find(steady, np.zeros(1000, dtype=bool), steady, (0.0, 0.4))  # nothing is known: the middle of the range
    0.2
    """

    rate_hz: float
    rest: Array
    ramp_s: float
    quantity: str
    smooth_s: float

    def find(self, around: Samples, known: NDArray[np.bool_], steady: Samples, between_s: tuple[float, float]) -> float:
        """Return when the finger sets off, s from the first sample: the mean over what is likely.

        All moments of the range, and all ways to grow, are equally likely beforehand; so the middle of the range is
        returned where nothing is known.

        Parameters
        ----------
        around : (n_samples, n_channels)
            Vibration around the onset.
        known : (n_samples,)
            Which samples count.
        steady : (n_steady, n_channels)
            Vibration at steady speed.
        between_s
            Range in which the onset is sought; it may begin before the first sample.

        Returns
        -------
        float
            Time of the onset, s from the first sample of `around`.
        """
        length = HOPS_PER_WINDOW * max(1, round(WINDOW_S * self.rate_hz / HOPS_PER_WINDOW))
        hop = length // HOPS_PER_WINDOW
        step_s = hop / ONSETS_PER_HOP / self.rate_hz
        onsets = np.arange(round(between_s[0] / step_s), round(between_s[1] / step_s) + 1)  # in steps
        starts = np.flatnonzero(_whole(known, length)[::hop])  # in hops
        if not len(starts) or len(steady) < MIN_STEADY:
            return float(onsets.mean()) * step_s
        vibration = highpass(around, self.rate_hz, self.smooth_s) / np.sqrt(self.rest)
        powers = _spectra(vibration[(starts * hop)[:, None] + np.arange(length)])
        fit = _fit(powers, self._expected(steady, length, self.ramp_s / step_s))  # (n_ways, n_windows, n_ages)
        ages = np.clip((starts + HOPS_PER_WINDOW) * ONSETS_PER_HOP - onsets[:, None], 0, fit.shape[2] - 1)
        total = NEW_IN_WINDOW * fit[:, np.arange(len(starts)), ages].sum(axis=-1)  # (n_ways, n_onsets)
        likely = np.exp(total - total.max()).sum(axis=0)
        return float(likely @ onsets / likely.sum()) * step_s

    def _expected(self, steady: Samples, length: int, ramp: float) -> Array:
        """Return the power expected in windows by their age, (n_ways, n_ages, n_bins).

        Age, in steps: 0 for a window that ends as the finger sets off, the last for one that begins as it is at speed.
        `length` is that of a window, in samples, `ramp` that of the ramp, in steps.
        """
        steady_length = min(len(steady), round(STEADY_WINDOW_S * self.rate_hz))
        frequency_hz, density = welch(
            median_centred(steady), self.rate_hz, nperseg=steady_length, detrend='linear', axis=0
        )
        passed = highpass_gain(frequency_hz, self.rate_hz, self.smooth_s)
        noise = 1.0 / max(float(passed.mean()) * self.rate_hz / 2, TINY)  # white: its density
        texture = np.maximum(density / self.rest - noise, 0.0).mean(axis=1)
        bins_hz = np.fft.rfftfreq(length, 1.0 / self.rate_hz)
        squeezed = self._squeezed(frequency_hz, texture, bins_hz)
        window = HOPS_PER_WINDOW * ONSETS_PER_HOP
        ages = np.arange(window + math.ceil(ramp) + 1)
        shares = np.clip((ages[:, None] - window * (1.0 - POINTS)) / max(ramp, TINY), 0.0, 1.0)
        at = np.rint(shares * (len(SHARES) - 1)).astype(int)
        sensed = SHARES ** (2.0 * np.array(MEASURED_QUANTITIES[self.quantity])[:, None])
        ways = (sensed[:, None, :, None] * squeezed).reshape(-1, len(SHARES), len(bins_hz))
        measured = np.einsum('wapf,p->waf', ways[:, at], POINT_WEIGHTS)
        rest = noise * highpass_gain(bins_hz, self.rate_hz, self.smooth_s)
        expected: Array = np.maximum(self.rate_hz / 2 * (rest + measured), MIN_POWER)
        return expected

    def _squeezed(self, frequency_hz: Array, texture: Array, bins_hz: AnyArray) -> Array:
        """Return the density at `SHARES` of the speed, as windows see it at their frequencies: (2, n_shares, n_bins).

        What lies above the band at steady speed comes into it at less, and is unknown: nothing in the first, and in
        the second as much as below the edge of the sensor's filters, falling with the square of the frequency.
        """
        half_hz = self.rate_hz / 2
        lines_hz = np.clip((np.arange(len(texture) + 1) - 0.5) * frequency_hz[1], 0.0, half_hz)
        bands = QUARTERS * (len(bins_hz) - 1) + 1
        bands_hz = np.clip((np.arange(bands + 1) - 0.5) * bins_hz[1] / QUARTERS, 0.0, half_hz)
        edge = float(texture[len(texture) // 2 : 3 * len(texture) // 4 + 1].mean())
        above = edge * half_hz * (1.0 - 1.0 / ABOVE)
        squeezed = np.zeros((2, len(SHARES), bands))  # what does not move is not measured
        for i, share in enumerate(SHARES[1:], start=1):
            passed = texture * highpass_gain(share * frequency_hz, self.rate_hz, self.smooth_s)
            below = np.concatenate([[0.0], np.cumsum(passed * np.diff(lines_hz))])
            squeezed[0, i] = np.diff(np.interp(bands_hz, share * lines_hz, below))
            far_hz, all_below = np.append(lines_hz, half_hz * ABOVE), np.append(below, below[-1] + above)
            squeezed[1, i] = np.diff(np.interp(bands_hz, share * far_hz, all_below))
        return np.asarray(convolve1d(squeezed / np.diff(bands_hz), HANN, mode='mirror')[:, :, ::QUARTERS])


def _whole(known: NDArray[np.bool_], length: int) -> NDArray[np.bool_]:
    """Return whether the window that begins at each sample is known as a whole."""
    if len(known) < length:
        return np.zeros(0, dtype=bool)
    return np.asarray(sliding_window_view(known, length).all(axis=-1))


def _spectra(windows: Samples) -> Array:
    """Return the mean power over the channels at each frequency, 1 for white noise of power 1: (n_windows, n_bins)."""
    transforms = np.fft.rfft(windows * _hann(windows.shape[1])[:, None], axis=1)
    powers: Array = np.square(np.abs(transforms)).mean(axis=2)
    return powers


def _hann(length: int) -> Array:
    """Return a Hann window of power 1."""
    window = np.hanning(length + 2)[1:-1]
    unit: Array = window / np.sqrt(np.square(window).sum())
    return unit


def _fit(powers: Array, expected: Array) -> Array:
    """Return the log-likelihood of each window at each age, (n_ways, n_windows, n_ages)."""
    ratio = np.maximum(powers, MIN_POWER)[:, None, :] / expected[:, None]
    fit: Array = np.maximum(np.log(ratio) - ratio, ANYTHING).sum(axis=-1)
    return fit

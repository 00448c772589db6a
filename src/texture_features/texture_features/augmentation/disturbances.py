"""Disturbances of the windows of one slide: one kind at a time, by a strength."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

import numpy as np
from scipy.signal import resample_poly

from texture_core.arrays import Array

BURST_S = 0.01  # samples are lost by the packet
CURVE_TERMS = 5  # of the random response of another finger over frequency
RATIO_LIMIT = 40  # numerator and denominator of a speed ratio: the resampling filter grows with them


@dataclass(frozen=True, eq=False)
class SlideWindows:
    """Windows of one input over one slide.

    Parameters
    ----------
    samples : (n_windows, n_samples, n_channels)
    rate_hz
        Sampling rate.
    starts_s : (n_windows,)
        Start of each window after that of the first.
    vibration
        Whether this is the vibration input; gain, loss of samples, clipping and the response of a finger act on it.

    Examples
    --------
    >>> windows = SlideWindows(np.ones((4, 100, 2)), 1000.0, 0.1 * np.arange(4), vibration=True)
    >>> amplify(windows, 3.0, np.random.default_rng(0)).mean().item(), windows.rms.tolist()
    (3.0, [0.0, 0.0])
    """

    samples: Array
    rate_hz: float
    starts_s: Array
    vibration: bool

    @property
    def mean(self) -> Array:
        """Mean of each channel over the slide, (n_channels,)."""
        mean: Array = self.samples.mean(axis=(0, 1))
        return mean

    @property
    def rms(self) -> Array:
        """Root mean square of each channel about its mean over the slide, (n_channels,)."""
        rms: Array = self.samples.std(axis=(0, 1))
        return rms


class Disturbance(Protocol):
    """Changes windows as a disturbance of some strength would."""

    def __call__(self, windows: SlideWindows, strength: float, rng: np.random.Generator, /) -> Array:
        """Return the samples of the windows with the disturbance.

        Parameters
        ----------
        windows
            Windows of one input.
        strength
            How strong; each disturbance says in which unit.
        rng
            Source of all that is random.

        Returns
        -------
        (n_windows, n_samples, n_channels)
            In the unit of the signal.
        """


def at_speed(windows: SlideWindows, speed: float, count: int) -> Array:
    """Return the first `count` samples of each window as they are at a multiple of the speed.

    The windows must hold at least speed · count samples.

    Parameters
    ----------
    windows
        Windows of one input.
    speed
        Multiple of the speed at which they were recorded, > 0.
    count
        Number of samples of each window to return.

    Returns
    -------
    (n_windows, count, n_channels)
        Resampled and band-limited; the sampling rate stays.
    """
    longer = windows.samples
    ratio = Fraction(1.0 / speed).limit_denominator(RATIO_LIMIT)
    if ratio != 1:
        longer = resample_poly(longer, ratio.numerator, ratio.denominator, axis=1, padtype='line')
    resampled: Array = longer[:, :count]
    return resampled


def add_noise(windows: SlideWindows, strength: float, rng: np.random.Generator) -> Array:
    """Add white noise with a multiple, the strength, of the root mean square of the slide."""
    return windows.samples + strength * windows.rms * rng.standard_normal(windows.samples.shape)


def amplify(windows: SlideWindows, strength: float, _rng: np.random.Generator) -> Array:
    """Multiply the vibration by the strength; slow channels stay as they are."""
    return strength * windows.samples if windows.vibration else windows.samples


def add_drift(windows: SlideWindows, strength: float, _rng: np.random.Generator) -> Array:
    """Add an offset that grows by a multiple of the root mean square of the slide per second, from window to window."""
    times = windows.starts_s[:, None] + np.arange(windows.samples.shape[1]) / windows.rate_hz
    return windows.samples + strength * windows.rms * times[..., None]


def hold_lost(windows: SlideWindows, strength: float, rng: np.random.Generator) -> Array:
    """Replace a fraction of the vibration, by bursts of 10 ms, by the last value before; slow channels stay.

    The first sample of a window is never lost.
    """
    n_windows, n_samples, _ = windows.samples.shape
    if not windows.vibration:
        return windows.samples
    burst = max(1, round(BURST_S * windows.rate_hz))
    lost = np.repeat(rng.random((n_windows, -(-n_samples // burst))) < strength, burst, axis=1)[:, :n_samples]
    lost[:, 0] = False
    last = np.maximum.accumulate(np.where(lost, 0, np.arange(n_samples)), axis=1)
    held: Array = np.take_along_axis(windows.samples, last[..., None], axis=1)
    return held


def clip(windows: SlideWindows, strength: float, _rng: np.random.Generator) -> Array:
    """Limit the vibration to a multiple of its root mean square about the mean; slow channels stay as they are."""
    if not windows.vibration:
        return windows.samples
    limit = strength * windows.rms
    return np.clip(windows.samples, windows.mean - limit, windows.mean + limit)


def low_pass(windows: SlideWindows, strength: float, _rng: np.random.Generator) -> Array:
    """Filter the vibration by a low-pass of first order whose cut-off is a multiple of the sampling rate.

    Slow channels stay as they are.
    """
    if not windows.vibration:
        return windows.samples
    n_samples = windows.samples.shape[1]
    pole = math.exp(-2.0 * math.pi * strength)
    response = (1.0 - pole) / (1.0 - pole * np.exp(-2j * math.pi * np.fft.rfftfreq(n_samples)))
    deviation = windows.samples - windows.mean
    return windows.mean + np.fft.irfft(np.fft.rfft(deviation, axis=1) * response[:, None], n_samples, axis=1)


def other_finger(windows: SlideWindows, strength: float, rng: np.random.Generator) -> Array:
    """Filter the vibration by a smooth random response with this standard deviation in dB; shift slow channels.

    The mean over the slide stays for vibration; of slow channels the gains and offsets change.
    """
    n_channels = windows.samples.shape[2]
    deviation = windows.samples - windows.mean
    if not windows.vibration:
        gains = np.exp(0.05 * strength * rng.standard_normal(n_channels))
        return windows.mean + gains * deviation + 3.0 * strength * rng.standard_normal(n_channels)
    response = smooth_response(windows.samples.shape[1] // 2 + 1, strength, rng)
    filtered = np.fft.irfft(np.fft.rfft(deviation, axis=1) * response[:, None], windows.samples.shape[1], axis=1)
    return windows.mean + filtered


def smooth_response(count: int, strength_db: float, rng: np.random.Generator) -> Array:
    """Return a smooth random amplitude response over `count` frequencies from 0 to half the rate.

    Parameters
    ----------
    count
        Number of frequencies, the first at 0 Hz, the last at half the sampling rate.
    strength_db
        Standard deviation of the response, dB.
    rng
        Source of the response.

    Returns
    -------
    (count,)
        Factors of the amplitude, 1 for no change.
    """
    frequencies = np.linspace(0.0, 1.0, count)
    terms = np.cos(np.pi * np.arange(CURVE_TERMS)[:, None] * frequencies)
    curve = rng.standard_normal(CURVE_TERMS) @ terms / math.sqrt(3.0)  # standard deviation about 1
    response: Array = 10.0 ** (strength_db * curve / 20.0)
    return response


@dataclass(frozen=True)
class StrengthRange:
    """A disturbance, and its smallest and largest strength on which early stopping is fitted.

    Parameters
    ----------
    disturbance
        None for a change of speed, which needs longer windows.
    weakest, strongest
        From harmless to useless.

    Examples
    --------
    >>> gain = StrengthRange(amplify, 0.4, 2.5)
    >>> 0.4 <= gain.draw(np.random.default_rng(0)) <= 2.5
    True
    """

    disturbance: Disturbance | None
    weakest: float
    strongest: float

    def draw(self, rng: np.random.Generator) -> float:
        """Return a strength, uniform in its logarithm."""
        return math.exp(rng.uniform(math.log(self.weakest), math.log(self.strongest)))


DISTURBANCES: Mapping[str, StrengthRange] = {
    'speed': StrengthRange(None, 0.35, 2.2),
    'gain': StrengthRange(amplify, 0.4, 2.5),
    'noise': StrengthRange(add_noise, 0.003, 0.3),
    'finger': StrengthRange(other_finger, 0.3, 5.0),
    'drift': StrengthRange(add_drift, 0.1, 10.0),
    'held': StrengthRange(hold_lost, 0.003, 0.3),
    'clipped': StrengthRange(clip, 0.7, 4.0),
    'low-pass': StrengthRange(low_pass, 0.1, 1.0),
}
KINDS = tuple(DISTURBANCES)

"""What can go wrong with a signal, one thing at a time and by degrees."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfilter_zi

from texture_benchmarks.robustness.speed_resampling import at_other_speed
from texture_core.arrays import Array

BURST_S = 0.01  # samples are lost by the packet

# (samples (n, n_channels), rate in Hz, strength, random) -> samples
Change = Callable[[Array, float, float, np.random.Generator], Array]


@dataclass(frozen=True)
class Degradation:
    """One thing that gets worse.

    Parameters
    ----------
    change
        Makes the samples of a slide as bad as the strength says; at `nothing` it returns them as they are.
    strengths
        From `nothing` on, worse and worse.
    axis
        What the strength is, with its unit.
    loses
        Whether samples become NaN: windows that hold one are not cut, and count as not recognised.
    of_windows
        Whether the strength is the length of the tested windows, of that trained, and the samples stay as they are.
    of_the_world
        Whether it happens before sampling, so that the samples of the sensor are changed and not those of a lower rate.
    """

    change: Change
    strengths: Sequence[float]
    axis: str
    loses: bool = False
    of_windows: bool = False
    of_the_world: bool = False

    @property
    def nothing(self) -> float:
        """The strength at which nothing changes."""
        return self.strengths[0]


def rms(samples: Array) -> Array:
    """Return the root mean square of each channel about its mean, (n_channels,).

    Parameters
    ----------
    samples : (n_samples, n_channels)

    Returns
    -------
    (n_channels,)
        In the unit of the samples.
    """
    spread: Array = samples.std(axis=0)
    return spread


def _noisy(samples: Array, _rate_hz: float, strength: float, rng: np.random.Generator) -> Array:
    return samples + strength * rms(samples) * rng.standard_normal(samples.shape)


def _amplified(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    return strength * samples


def _drifting(samples: Array, rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    seconds = np.arange(len(samples))[:, None] / rate_hz
    return samples + strength * rms(samples) * seconds


def _worn(samples: Array, rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    """Low-pass of first order with the strength as its cut-off, Hz, at rest at the first sample."""
    if math.isinf(strength):
        return samples
    pole = math.exp(-2.0 * math.pi * strength / rate_hz)
    b, a = [1.0 - pole], [1.0, -pole]
    worn: Array = lfilter(b, a, samples, axis=0, zi=lfilter_zi(b, a)[:, None] * samples[:1])[0]
    return worn


def _lost(samples: Array, rate_hz: float, strength: float, rng: np.random.Generator) -> Array:
    return np.where(_gaps(len(samples), rate_hz, strength, rng)[:, None], math.nan, samples)


def _held(samples: Array, rate_hz: float, strength: float, rng: np.random.Generator) -> Array:
    gaps = _gaps(len(samples), rate_hz, strength, rng)
    gaps[0] = False
    last_there = np.maximum.accumulate(np.where(gaps, 0, np.arange(len(samples))))
    held: Array = samples[last_there]
    return held


def _gaps(count: int, rate_hz: float, share: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return which samples are missing, (count,), whole bursts at a time."""
    burst = max(1, round(BURST_S * rate_hz))
    return np.repeat(rng.random(-(-count // burst)) < share, burst)[:count]


def _clipped(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    if math.isinf(strength):
        return samples
    middle, limit = samples.mean(axis=0), strength * rms(samples)
    return np.clip(samples, middle - limit, middle + limit)


def _hurried(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    """Return the way at another speed: less of it in the same time, or all of it in less."""
    return samples if strength == 1.0 else at_other_speed(samples, 1.0, strength)[: len(samples)]


def _unchanged(samples: Array, _rate_hz: float, _strength: float, _rng: np.random.Generator) -> Array:
    return samples


_OF_RMS = "in the slide's rms"
DEGRADATIONS: Mapping[str, Degradation] = {
    'white noise': Degradation(_noisy, (0.0, 0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 2.0), f'rms of the noise, {_OF_RMS}'),
    'lower gain': Degradation(_amplified, (1.0, 0.95, 0.9, 0.8, 0.7, 0.5, 0.35, 0.25), 'gain'),
    'higher gain': Degradation(_amplified, (1.0, 1.05, 1.1, 1.25, 1.5, 2.0, 3.0, 4.0), 'gain'),
    'offset drift': Degradation(_drifting, (0.0, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0), f'drift per second, {_OF_RMS}'),
    'wear': Degradation(
        _worn, (math.inf, 2000.0, 1000.0, 500.0, 300.0, 200.0, 100.0, 20.0), 'cut-off (Hz)', of_the_world=True
    ),
    'lost samples': Degradation(_lost, (0.0, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05), 'share lost', loses=True),
    'losses hidden': Degradation(
        _held, (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.2, 0.5), 'share replaced by the last value'
    ),
    'clipping': Degradation(_clipped, (math.inf, 4.0, 3.0, 2.0, 1.5, 1.0, 0.5, 0.2), f'limit, {_OF_RMS}'),
    'shorter windows': Degradation(
        _unchanged, (1.0, 0.9, 0.8, 0.6, 0.5, 0.4, 0.2, 0.1), 'length of the window, of that trained', of_windows=True
    ),
    'slower than trained': Degradation(
        _hurried, (1.0, 0.98, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5), 'speed, of that trained', of_the_world=True
    ),
    'faster than trained': Degradation(
        _hurried, (1.0, 1.02, 1.05, 1.1, 1.25, 1.5, 1.75, 2.0), 'speed, of that trained', of_the_world=True
    ),
}


def breakdown(strengths: Sequence[float], shares: Sequence[float], kept: float) -> float | None:
    """Return the strength at which a curve first falls below so much of its start; None if it never does.

    Between two strengths it is taken for a straight line; after an infinite one, the next strength is returned.

    Parameters
    ----------
    strengths : (n,)
        Rising; the first is no disturbance.
    shares : (n,)
        Share recognised at each.
    kept
        Fraction of the first share.

    Returns
    -------
    float or None
        In the unit of the strengths.
    """
    limit = kept * shares[0]
    below = next((index for index, share in enumerate(shares) if share < limit), 0)
    if not below:
        return None
    before, after = strengths[below - 1], strengths[below]
    if math.isinf(before):
        return after
    fallen = (shares[below - 1] - limit) / (shares[below - 1] - shares[below])
    return before + fallen * (after - before)

"""The profile across ridges that all have the same pitch, as its Fourier series."""

from __future__ import annotations

import math

import numpy as np

from texture_core.arrays import Array

MIN_TRANSFER = 1e-3  # a harmonic blurred to less than this share is left out
SHAPES = ('sine', 'square')


def profile(across_m: Array, blur_m: Array, pitch_m: float, shape: str, duty: float) -> Array:
    """Return the height of ridges one unit high, less its mean, (..., n).

    Harmonic n is weakened by exp(−(2π·n·blur/pitch)²/2), the transfer function of the Gaussian.

    Parameters
    ----------
    across_m : (..., n)
        Place across the ridges; 0 is the middle of one.
    blur_m : (..., n) or (..., 1)
    pitch_m, shape, duty
        Of the ridges; a square one takes the share `duty` of the pitch.

    Returns
    -------
    (..., n)
        From -1 to 1.
    """
    cosine = np.cos(2 * np.pi / pitch_m * across_m)
    first_share = np.exp(-0.5 * (2 * np.pi * blur_m / pitch_m) ** 2)
    amplitudes = _amplitudes(pitch_m, shape, duty, float(blur_m.min(initial=pitch_m)))
    height = amplitudes[0] * first_share * cosine
    if len(amplitudes) == 1:
        return np.asarray(height)
    twice, wave, before = 2 * cosine, cosine, np.ones_like(cosine)
    share, ratio, square = first_share, first_share**3, first_share**2
    for amplitude in amplitudes[1:]:
        # cos((n+1)φ) = 2·cos φ·cos nφ − cos((n−1)φ) and q^((n+1)²) = q^(n²)·q^(2n+1): far cheaper than cos and exp.
        wave, before = twice * wave - before, wave
        share, ratio = share * ratio, ratio * square
        height += amplitude * share * wave
    return np.asarray(height)


def _amplitudes(pitch_m: float, shape: str, duty: float, blur_m: float) -> list[float]:
    """Return the amplitudes of the harmonics that are measured at all, from the first on."""
    if shape == 'sine':
        return [0.5]
    finest = pitch_m / (2 * np.pi * blur_m) * math.sqrt(-2 * math.log(MIN_TRANSFER))
    orders = range(1, max(2, math.ceil(finest)))
    return [2 / (np.pi * order) * math.sin(np.pi * order * duty) for order in orders]

"""The spectrum of windows over waves per metre of the surface: frequency over speed, so that no speed moves a line."""

from __future__ import annotations

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch
from texture_features.spectra.spectrum import hann

PADDING = 4  # lines stand so much closer than the window alone resolves, and bands may be narrower than a line


def spatial_log_bands(windows: WindowBatch, edges_per_m: Array, floor: float) -> Array:
    """Return log(mean density + floor) between edges of spatial frequency.

    The whole window is tapered and transformed at once: for its few waves there is nothing to average. A band beyond
    half the sampling rate holds the density there.

    Parameters
    ----------
    windows
        What is described. NaN comes back where the speed is unknown or not above 0: what stands still has no waves.
    edges_per_m : (n_bands + 1,)
        Waves per metre, rising.
    floor
        unit² m.

    Returns
    -------
    (..., n_channels, n_bands)
    """
    rows = windows.centred_rows
    n_samples = rows.shape[-1]
    points = PADDING << (n_samples - 1).bit_length()
    lines = np.fft.rfft(rows * hann(n_samples), points, axis=-1)
    density = lines.real**2 + lines.imag**2
    density *= 2.0 / (windows.rate_hz * float(np.square(hann(n_samples)).sum()))
    speed = np.asarray(windows.speed_m_s, dtype=np.float64)
    moving = speed > 0.0
    scale = np.where(moving, speed, 1.0)[..., None, None]
    per_hz = _mean_between(density, edges_per_m * scale * (points / windows.rate_hz))
    # The same power on a stretch that is narrower by the speed: unit²/Hz · m/s = unit² m.
    logarithm: Array = np.log(per_hz * scale + floor)
    return np.where(moving[..., None, None], logarithm, np.nan)


def mean_subtracted(log_bands: Array) -> Array:
    """Return log bands less their mean over the bands: how hard and how fast the finger presses is mostly level.

    Parameters
    ----------
    log_bands : (..., n_bands)

    Returns
    -------
    (..., n_bands)
        Of zero mean.
    """
    shape: Array = log_bands - np.add.reduce(log_bands, axis=-1, keepdims=True) / log_bands.shape[-1]
    return shape


def _mean_between(density: Array, edges: Array) -> Array:
    """Return the mean of a density, (..., n_lines), between fractions of lines, (..., n_edges)."""
    last = density.shape[-1] - 1
    at = np.broadcast_to(np.clip(edges, 0.0, last), (*density.shape[:-1], edges.shape[-1]))
    total = np.zeros_like(density)
    np.cumsum(0.5 * (density[..., 1:] + density[..., :-1]), axis=-1, out=total[..., 1:])
    low = np.minimum(at.astype(np.intp), last - 1)
    below = np.take_along_axis(total, low, axis=-1)
    above = np.take_along_axis(total, low + 1, axis=-1)
    summed = below + (at - low) * (above - below)
    width = np.diff(at, axis=-1)
    inside = width > 0.0
    mean: Array = np.where(inside, np.diff(summed, axis=-1) / np.where(inside, width, 1.0), density[..., -1:])
    return np.maximum(mean, 0.0)

"""The spectrum of windows as lines: mean density and frequency of each, of the signal or of what it is the rate of."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from texture_core.arrays import Array
from texture_features.feature import WindowBatch
from texture_features.spectra.spectrum import mean_densities


def welch_spectrum(windows: WindowBatch, points: int, rate_of_change: bool) -> tuple[Array, Array]:
    """Return the mean density of each line above 0 Hz, (..., n_channels, n_lines), and its frequency, (n_lines,) Hz.

    Parameters
    ----------
    windows
        What is described.
    points
        Samples of a segment; segments overlap by a half, lines are rate / points apart.
    rate_of_change
        The signal is the rate of change of what touches, as a dynamic capacitive channel gives it: the density of the
        integral is returned, by split by (2πf)².

    Returns
    -------
    (..., n_channels, n_lines)
        Density, unit²/Hz; for a rate of change that of its integral.
    (n_lines,)
        Frequencies, Hz.
    """
    segment = 2 * (points // 2)
    hertz, integration = _lines(segment, windows.rate_hz)
    densities = windows.shared(
        ('line_spectrum', segment),
        lambda: mean_densities(windows.centred_rows, windows.rate_hz, segment, segment // 2, len(hertz)),
    )
    if rate_of_change:
        whole = densities
        densities = windows.shared(('line_spectrum', segment, 'signal_energy'), lambda: whole * integration)
    return densities, hertz


def at_reference_speed(hertz: Array, windows: WindowBatch, speed_m_s: float) -> Array:
    """Return at which frequencies the lines would stand at another speed, (..., 1, n_lines); 0 m/s: where they stand.

    A wave of the surface met at f is met at f · speed_m_s / v at that speed; NaN if that is unknown or not above 0.

    Parameters
    ----------
    hertz : (n_lines,)
        Frequencies at the speed of each window, Hz.
    windows
        What is described; their speeds are used.
    speed_m_s
        The other speed; 0 returns the frequencies unchanged.

    Returns
    -------
    (..., 1, n_lines), or (n_lines,) for 0 m/s
        Hz.
    """
    if not speed_m_s:
        return hertz
    return windows.shared(
        ('at_reference_speed', speed_m_s, len(hertz)),
        lambda: hertz * (speed_m_s / windows.moving_m_s[..., None, None]),
    )


def force_normalised(log_power: Array, windows: WindowBatch, exponent: float) -> Array:
    """Return a log power, (..., n_channels, n_values), less what it owes to the force, exponent · log(force).

    On a soft round finger (Hertz) the stiffness grows with the cube root of the force, so the power with force^(2/3).

    Parameters
    ----------
    log_power : (..., n_channels, n_values)
    windows
        What is described; their forces are used.
    exponent
        Power of the force with which the power of the vibration grows; 0 returns `log_power` unchanged.

    Returns
    -------
    (..., n_channels, n_values)
        NaN where the force is unknown.
    """
    if not exponent:
        return log_power
    less: Array = log_power - exponent * np.log(np.asarray(windows.force_n))[..., None, None]
    return less


@lru_cache(maxsize=64)
def _lines(segment: int, rate_hz: float) -> tuple[Array, Array]:
    """Return the frequency of each line, (segment / 2,) Hz, and the share of its density that its integral has."""
    hertz: Array = np.arange(1, segment // 2 + 1, dtype=np.float64) * (rate_hz / segment)
    integration: Array = 1.0 / (2.0 * np.pi * hertz) ** 2
    for array in (hertz, integration):
        array.flags.writeable = False
    return hertz, integration

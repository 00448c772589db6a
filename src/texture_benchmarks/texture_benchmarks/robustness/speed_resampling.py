"""Slides as they would be at other speeds: the same way over the surface in another time."""

from __future__ import annotations

from fractions import Fraction

from scipy.signal import resample_poly

from texture_core.arrays import Array

FINEST = 1000  # of the ratio of two speeds


def at_other_speed(samples: Array, speed_m_s: float, wanted_m_s: float) -> Array:
    """Return samples (n, n_channels) taken at one speed as they would be at another, at the same rate.

    What frequency does to the sensor and to friction stays that of the speed they were taken at.

    Parameters
    ----------
    samples : (n, n_channels)
    speed_m_s
        Speed at which they were taken.
    wanted_m_s
        The other speed.

    Returns
    -------
    (n · speed_m_s / wanted_m_s, n_channels)
        In the unit of the samples.
    """
    ratio = Fraction(speed_m_s / wanted_m_s).limit_denominator(FINEST)
    values: Array = resample_poly(samples, ratio.numerator, ratio.denominator, axis=0, padtype='line')
    return values

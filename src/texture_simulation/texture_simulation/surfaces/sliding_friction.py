"""Friction that only ever slides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.stribeck import steady_force_n
from texture_simulation.trajectory import Trajectory, before_first

CREEP_M_S = 1e-3  # below about this speed friction builds up, so that nothing jumps where a slide begins


@dataclass(frozen=True)
class SlidingFriction:
    """A Stribeck curve without memory: the skin is pulled along as at a steady speed, and never hangs.

    For surfaces on which nothing sticks, hundreds of times cheaper than `StickSlip`.

    Raises
    ------
    InvalidParameter
        If friction is lower at rest than in fast sliding.
    """

    static: float = param(0.6, 'Sets the coefficient of friction of slow sliding.', low=0.0, high=5.0)
    kinetic: float = param(0.5, 'Sets the coefficient of kinetic friction of fast sliding.', low=1e-3, high=5.0)
    stribeck_m_s: float = param(
        0.05,
        'Sets the Stribeck speed over which friction falls from static to kinetic; a larger value falls more slowly.',
        unit='m/s',
        low=1e-4,
        high=10.0,
    )
    viscous_s_m: float = param(
        0.0, 'Sets the growth of the coefficient of friction per speed.', unit='s/m', low=0.0, high=100.0
    )
    force_coupling: float = param(
        0.2,
        'Sets the measured force per tangential force on the skin; a larger value shows friction more strongly.',
        low=-10.0,
        high=10.0,
    )

    def __post_init__(self) -> None:
        self.curve()

    def curve(self) -> StickSlip:
        """Return the same curve as that of bristles."""
        return StickSlip(self.static, self.kinetic, self.stribeck_m_s, self.viscous_s_m, bristle_s_m=0.0)


class SlidingDrag:
    """Follow a finger that slides along a path; what lies between the blocks is continuous.

    Parameters
    ----------
    friction
        Of the surface.
    rate_hz
        Points of the path a second.
    """

    def __init__(self, friction: SlidingFriction, rate_hz: float) -> None:
        self._curve = friction.curve()
        self._force_coupling = friction.force_coupling
        self._rate_hz = rate_hz
        self._before: tuple[Array, Array] | None = None

    def advance(self, path: Trajectory) -> Array:
        """Return the force that the sensor senses, (..., n) N: of one sign, whichever way the finger goes."""
        if not len(path):
            return np.zeros_like(path.x_m)
        x_m, y_m = self._before or before_first(path)
        self._before = path.x_m[..., -1:], path.y_m[..., -1:]
        speed_m_s = np.hypot(np.diff(path.x_m, prepend=x_m), np.diff(path.y_m, prepend=y_m)) * self._rate_hz
        built_up = speed_m_s / np.hypot(speed_m_s, CREEP_M_S)
        force_coupling: Array = (
            self._force_coupling
            * np.maximum(path.force_n, 0.0)
            * built_up
            * steady_force_n(self._curve, speed_m_s, 1.0)
        )
        return force_coupling

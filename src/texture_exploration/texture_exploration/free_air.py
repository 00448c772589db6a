"""Find out whether the finger is in free air, from the force while it rises."""

from __future__ import annotations

import math

from texture_exploration.arms.protocol import Vector

SMOOTHING_S = 0.02  # time constant over which the force is averaged: noise is no contact


class FreeAir:
    """Tell whether nothing touches the finger, whatever the offset of its force sensor.

    In contact the force changes while the finger rises: a stiffness k times the rise. Free air is proven by a rise
    through which the force stays the same, and until the force changes again. So a contact of at least
    `steady_n / rise_m` is noticed. A force sensor that was never zeroed does not matter, as only changes count.

    Parameters
    ----------
    rise_m
        The rise that proves it, m.
    steady_n
        A change of the force by more than this is contact, N.
    """

    def __init__(self, rise_m: float, steady_n: float) -> None:
        self._rise_m = rise_m
        self._steady_n = steady_n
        self._force_n = math.nan  # smoothed
        self._time_ns = 0
        self._start: Vector | None = None  # from where the rise counts
        self._start_n = math.nan
        self.proven = False

    def presume_contact(self) -> None:
        """Forget the proof: the finger was pressed on something, or nobody looked."""
        self._start = None
        self._force_n = math.nan
        self.proven = False

    def update(self, time_ns: int, position: Vector, force_n: float) -> bool:
        """Take note of a state of the arm in the frame of the surface, and return whether free air is proven.

        Parameters
        ----------
        time_ns
            When it was measured.
        position : (3,)
            m, z away from the surface.
        force_n
            Along the normal, N.

        Returns
        -------
        bool
            Whether free air is proven.
        """
        self._smooth(time_ns, force_n)
        start = self._start
        # Written so that NaN is a change too.
        if start is None or not abs(self._force_n - self._start_n) <= self._steady_n:
            self._restart(position)
        elif not self.proven:
            self._rise(start, position)
        return self.proven

    def _smooth(self, time_ns: int, force_n: float) -> None:
        passed_s, self._time_ns = (time_ns - self._time_ns) * 1e-9, time_ns
        if math.isfinite(self._force_n):
            force_n = self._force_n - (force_n - self._force_n) * math.expm1(-max(0.0, passed_s) / SMOOTHING_S)
        self._force_n = force_n

    def _restart(self, position: Vector) -> None:
        self._start, self._start_n = position, self._force_n
        self.proven = False

    def _rise(self, start: Vector, position: Vector) -> None:
        """Count the rise from the lowest place; a finger that goes sideways may follow a slope."""
        x, y, z = (at - begin for at, begin in zip(position, start, strict=True))
        if z < 0.0 or math.hypot(x, y) > self._rise_m:
            self._start = position
        self.proven = z >= self._rise_m

"""Stiffness of a contact, estimated while the force rises."""

from __future__ import annotations

import math

SOFTEST_N_M = 50.0
MIN_POINTS = 3
MOST_POINTS = 25  # more make a short rise no surer: what is left is no noise
RECENT_SHARE = 0.5  # of the force, from which on points count
MIN_RISE_N = 0.1  # of the force at the default of `TOUCHING_N`, before a stiffness can be told from noise
TOUCHING_N = 0.03


class StiffnessEstimate:
    """Estimate how stiff a contact is, by the slope of force over height while the force rises: least squares.

    Parameters
    ----------
    touching_n
        A smaller force is none; it must exceed the noise of the force sensor.
    """

    def __init__(self, touching_n: float = TOUCHING_N) -> None:
        self._touching_n = touching_n
        self._min_rise_n = MIN_RISE_N * touching_n / TOUCHING_N
        self.value_n_m = math.nan
        self.restart()

    @property
    def empty(self) -> bool:
        """Whether this contact has just begun."""
        return not self._points

    def restart(self) -> None:
        """The contact ended: forget the points, not the value."""
        self.fixed = False  # for the rest of this contact
        self._points: list[tuple[float, float]] = []

    def update(self, height_m: float, force_n: float) -> None:
        """Take a point; those before the contact are passed over."""
        if self.fixed or force_n < self._touching_n or not self._presses_on(height_m, force_n):
            return
        self._points.append((height_m, force_n))
        # A finger is the stiffer the harder it is pressed: what counts is how stiff it is now.
        highest_n = max(force_n for _, force_n in self._points)
        recent_n = min(RECENT_SHARE * highest_n, highest_n - 1.5 * self._min_rise_n)
        self._points = [point for point in self._points if point[1] >= recent_n]
        # The slope of many points is as sure over a shorter rise: its error falls with their root.
        rise_n = (highest_n - self._points[0][1]) * math.sqrt(min(MOST_POINTS, len(self._points)) / MIN_POINTS)
        if len(self._points) >= MIN_POINTS and rise_n > self._min_rise_n:
            self.value_n_m = max(SOFTEST_N_M, self._slope())

    def _presses_on(self, height_m: float, force_n: float) -> bool:
        """Return whether the finger is deeper or presses harder than before; by the force alone noise would choose."""
        if not self._points:
            return True
        before_m, before_n = self._points[-1]
        # A force that stays the same to the last bit may be frozen: no contact is that soft.
        return force_n > before_n or (height_m < before_m and force_n != before_n)

    def _slope(self) -> float:
        count = len(self._points)
        z_mean = sum(z for z, _ in self._points) / count
        f_mean = sum(f for _, f in self._points) / count
        spread = sum((z - z_mean) ** 2 for z, _ in self._points)
        shared = sum((z - z_mean) * (f - f_mean) for z, f in self._points)
        return -shared / spread if spread > 0 else math.nan

"""How late an arm follows a normal velocity, measured while it comes down above the surface."""

from __future__ import annotations

import math

LONGEST_S = 0.15  # a longer lag is not told apart from an arm that does not move
SAMPLES = 10  # of which the mean counts
CHANGED = 0.02  # share by which a velocity differs from the one before
SLOWEST_M_S = 1e-5


class LagEstimate:
    """Estimate the lag from how far the finger is behind the way that was asked for.

    From rest the arm is asked for a constant velocity v. After t it has been asked for W = v·t and, following a lag d
    late, has gone v·(t − d): so d = (W − gone) / v, whatever the shape of the start, once it has lasted longer than d.

    Attributes
    ----------
    value_s : float
        The lag; NaN until it is measured. It stays until the next start from rest has lasted long enough.
    """

    def __init__(self) -> None:
        self.value_s = math.nan
        self._asked_m_s = 0.0
        self._rest_m = math.nan  # height at rest; NaN if the present velocity did not begin at rest
        self._way_m = 0.0
        self._constant_s = math.inf  # nobody has asked for anything yet
        self._lags_s: list[float] = []

    def update(self, height_m: float, asked_m_s: float, dt_s: float) -> None:
        """Take what was measured now, and what is asked for from now on.

        Parameters
        ----------
        height_m
            Of the finger, as measured.
        asked_m_s
            Normal velocity.
        dt_s
            Time since the last call, in which the velocity of that call was asked for.
        """
        self._way_m += self._asked_m_s * dt_s
        self._constant_s += dt_s
        if self._asked_m_s == 0.0:
            self._at_rest(height_m)
        elif self._constant_s > LONGEST_S and not math.isnan(self._rest_m):
            self._add((self._way_m - (height_m - self._rest_m)) / self._asked_m_s)
        if abs(asked_m_s - self._asked_m_s) > CHANGED * abs(self._asked_m_s):
            self._change(asked_m_s)

    def _at_rest(self, height_m: float) -> None:
        # Before, it may still be moving.
        self._rest_m = height_m if self._constant_s > LONGEST_S else math.nan
        self._way_m = 0.0

    def _add(self, lag_s: float) -> None:
        # Later samples would add the error of the speed itself.
        if len(self._lags_s) < SAMPLES:
            self._lags_s.append(min(LONGEST_S, max(0.0, lag_s)))
            if len(self._lags_s) == SAMPLES:
                self.value_s = sum(self._lags_s) / SAMPLES

    def _change(self, asked_m_s: float) -> None:
        if self._asked_m_s != 0.0:
            self._rest_m = math.nan
        self._asked_m_s = asked_m_s if abs(asked_m_s) >= SLOWEST_M_S else 0.0
        self._constant_s = 0.0
        self._lags_s = []

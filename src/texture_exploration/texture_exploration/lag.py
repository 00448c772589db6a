"""How late an arm follows a normal velocity, measured above the surface, and how late its force, at the first touch."""

from __future__ import annotations

import math
from collections import deque

LONGEST_S = 0.15  # a longer lag is not told apart from an arm that does not move
SAMPLES = 10  # of which the mean counts
CHANGED = 0.02  # share by which a velocity differs from the one before
SLOWEST_M_S = 1e-5
BLOCK = 5  # samples of which the mean is compared with that of the ones before
STOPPED = 0.03  # share of the first speed below which a finger stands
RISING = 4.0  # times its noise that a mean must rise to count


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


class ForceLag:
    """Measure how late the force follows the finger: it is told to stop, and the force goes on rising for the lag.

    Attributes
    ----------
    value_s : float
        How long the force rose after the finger stood, s; NaN until that is known.
    """

    def __init__(self, noise_n: float) -> None:
        self.value_s = math.nan
        self._noise_n = noise_n
        self._samples: deque[tuple[float, float]] = deque(maxlen=2 * BLOCK)  # height and force
        self._first_m = math.nan  # way of a block as it began to stop
        self._stood_s = self._rose_s = math.nan
        self._time_s = 0.0

    def update(self, height_m: float, force_n: float, dt_s: float) -> bool:
        """Take a sample; return whether it is over: the force is constant, or it never stopped to rise.

        Parameters
        ----------
        height_m, force_n
            As measured, while zero velocity is asked for.
        dt_s
            Time since the last call.
        """
        self._time_s += dt_s
        self._samples.append((height_m, force_n))
        if self._time_s > 4 * LONGEST_S:
            return True  # it does not stand still: nothing can be told
        if len(self._samples) >= BLOCK and len({force_n for _, force_n in list(self._samples)[-BLOCK:]}) == 1:
            return True  # without any noise: constant or frozen, which a movement shows
        if len(self._samples) < 2 * BLOCK:
            return False
        went_m, rose_n = (
            (sum(row[of] for row in list(self._samples)[BLOCK:]) - sum(row[of] for row in list(self._samples)[:BLOCK]))
            / BLOCK
            for of in (0, 1)
        )
        if math.isnan(self._first_m):
            self._first_m = max(abs(went_m), SLOWEST_M_S * dt_s)
        if rose_n > RISING * self._noise_n * math.sqrt(2.0 / BLOCK):
            self._rose_s = self._time_s
        if math.isnan(self._stood_s):
            if abs(went_m) > STOPPED * self._first_m:
                return False
            self._stood_s = self._rose_s = self._time_s
        lag_s = self._rose_s - self._stood_s
        if lag_s > LONGEST_S or self._time_s - self._rose_s > 2 * BLOCK * dt_s:
            self.value_s = lag_s
            return True
        return False

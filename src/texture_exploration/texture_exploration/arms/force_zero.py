"""Zero a force sensor that cannot do so itself: in free air, at rest."""

from __future__ import annotations

from collections import deque

import numpy as np

from texture_core.arrays import Array
from texture_exploration.arms.protocol import Vector
from texture_exploration.free_air import FreeAir

CALM_NS = 100_000_000  # an arm with lag may still move so long after it was told to stand still
AVERAGED_NS = 100_000_000  # of readings whose mean becomes the zero
READINGS = 200


class ForceZero:
    """Remember what the sensor shows in free air.

    Free air is proven by a rise through which the force stays the same (`texture_exploration.free_air`). At rest after
    such a rise the mean of the readings becomes the new zero; any contact, and any command to press, asks for a new
    rise first.

    Parameters
    ----------
    rise_m, steady_n
        See `FreeAir`.

    Attributes
    ----------
    zeroed : bool
        Whether there is a zero.
    offset_n : (3,)
        What the sensor shows in free air, in its own frame; zeros before.
    zeroings : int
        How often the sensor was zeroed.
    """

    def __init__(self, rise_m: float, steady_n: float) -> None:
        self._air = FreeAir(rise_m, steady_n)
        self._readings: deque[Array] = deque(maxlen=READINGS)
        self._rest_ns: int | None = None
        self.zeroed = False
        self.offset_n: Array = np.zeros(3)
        self.zeroings = 0

    @property
    def in_free_air(self) -> bool:
        """Whether nothing touches the finger, as far as is proven."""
        return self._air.proven

    def forget(self) -> None:
        """The sensor or the arm was lost for a while: nothing is known any more."""
        self.zeroed = False
        self.presume_contact()

    def presume_contact(self) -> None:
        """The finger presses, or was told to: the next zero needs another rise."""
        self._air.presume_contact()
        self._rest_ns = None
        self._readings.clear()

    def update(self, time_ns: int, position: Vector, normal_n: float, reading_n: Array, *, moving: bool) -> None:
        """Take a reading.

        Parameters
        ----------
        time_ns
            When it came.
        position : (3,)
            Of the finger in the surface frame, m.
        normal_n
            Its component along the normal, zeroed or not: only changes count.
        reading_n : (3,)
            Without the weight of the tool, in the frame of the sensor, not zeroed.
        moving
            Whether the arm is commanded to move.
        """
        if not self._air.update(time_ns, position, normal_n) or moving:
            self._rest_ns = None
            self._readings.clear()
            return
        if self._rest_ns is None:
            self._rest_ns = time_ns
        rested_ns = time_ns - self._rest_ns
        if rested_ns >= CALM_NS:
            self._readings.append(reading_n)
        if rested_ns >= CALM_NS + AVERAGED_NS:
            self._take_zero()

    def _take_zero(self) -> None:
        self.offset_n = np.mean(np.array(self._readings), axis=0)
        self.zeroed = True
        self.zeroings += 1
        self.presume_contact()

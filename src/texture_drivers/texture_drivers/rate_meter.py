"""Measure the rate of a stream that does not tell it, by when its samples arrive."""

from __future__ import annotations

from texture_core.signal import NANOSECONDS
from texture_drivers.clock import Arrival, supporting_slope

MEASURED_S = 2.0  # with arrivals seen each 10 ms, the error of a rate of 100 Hz is some 0.1 Hz
LEAST_ARRIVALS = 20


class RateMeter:
    """Count samples until their rate is certain.

    A sample arrives late by a varying delay but never early, so the period is the slope of the line just below all
    arrivals (see `clock.StreamClock`).
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget what has arrived."""
        self._samples = 0
        self._arrivals: list[Arrival] = []  # samples so far, and when the last of them was there

    def update(self, samples: int, arrival_ns: int) -> float:
        """Take note of samples that have just arrived; return the rate, Hz, or 0.0 while it is not certain."""
        self._samples += samples
        self._arrivals.append(Arrival(float(self._samples), float(arrival_ns - self._first_ns(arrival_ns))))
        elapsed_ns = self._arrivals[-1].delay_ns
        if elapsed_ns < MEASURED_S * NANOSECONDS or len(self._arrivals) < LEAST_ARRIVALS:
            return 0.0
        return NANOSECONDS / supporting_slope(self._arrivals)

    def _first_ns(self, arrival_ns: int) -> int:
        if not self._arrivals:
            self._start_ns = arrival_ns
        return self._start_ns

"""Losses in a stream that neither stamps nor counts its samples, known by how late they arrive."""

from __future__ import annotations

from collections import deque

from texture_core.signal import NANOSECONDS


class UnseenLoss:
    """Tell how many samples of a stream of constant rate were lost.

    Whatever comes after a lost sample seems late by its time, and stays so. A busy host makes some arrivals late, but
    not all of half a second: what was kept back arrives in one burst, whose last sample is in time. So what the least
    late arrival of the end of such a stretch is late by has been lost.

    Parameters
    ----------
    rate_hz
        Nominal rate of the stream.
    window_s
        All arrivals must have been late for so long.
    min_duration_s
        Lateness below this is none; it is also what may be lost without being noticed.
    """

    def __init__(self, rate_hz: float, *, window_s: float = 0.5, min_duration_s: float = 0.01) -> None:
        self._rate_hz = rate_hz
        self._window_ns = window_s * NANOSECONDS
        self._end_ns = 0.2 * self._window_ns
        self._min_duration_ns = min_duration_s * NANOSECONDS
        self.restart()

    def restart(self) -> None:
        """Forget what was late."""
        self._since_ns: int | None = None
        self._newest: deque[tuple[int, int]] = deque()  # arrival, lateness

    def lost(self, late_ns: int, arrival_ns: int) -> int:
        """Return how many samples are known to be lost now that one has arrived.

        Parameters
        ----------
        late_ns
            How much later than expected it was there.
        arrival_ns
            When.
        """
        if late_ns <= self._min_duration_ns:
            self.restart()
            return 0
        if self._since_ns is None:
            self._since_ns = arrival_ns
        self._newest.append((arrival_ns, late_ns))
        while arrival_ns - self._newest[0][0] > self._end_ns:
            self._newest.popleft()
        if arrival_ns - self._since_ns < self._window_ns:
            return 0
        least_late_ns = min(late for _, late in self._newest)
        self.restart()
        return round(least_late_ns / NANOSECONDS * self._rate_hz)

"""Give packets that carry their number its running index."""

from __future__ import annotations

from texture_core.signal import NANOSECONDS


class PacketNumbering:
    """Give each packet its index: a jump is what was lost, over an interruption by the time that passed.

    Parameters
    ----------
    rate_hz
        Nominal rate of the packets.
    """

    def __init__(self, rate_hz: float) -> None:
        self.lost = 0
        self._rate_hz = rate_hz
        self._next_index = 0
        self._next_ns: int | None = None  # when the next packet should start
        self._next_number: int | None = None  # none after an interruption

    def interrupt(self) -> None:
        """Forget the device's numbers: they begin again."""
        self._next_number = None

    def place(self, number: int, count: int, start_ns: int) -> int:
        """Return the index of the first of `count` packets that follow each other.

        Parameters
        ----------
        number
            The device's number of the first packet.
        count
            How many packets there are.
        start_ns
            When the first one began.

        Returns
        -------
        int
            Index of the first of them, from 0 on.
        """
        skipped = 0
        if self._next_number is not None:
            skipped = number - self._next_number
        elif self._next_ns is not None:
            skipped = max(0, round((start_ns - self._next_ns) / NANOSECONDS * self._rate_hz))
        self.lost += skipped
        index = self._next_index + skipped
        self._next_index = index + count
        self._next_number = number + count
        self._next_ns = start_ns + round(count / self._rate_hz * NANOSECONDS)
        return index

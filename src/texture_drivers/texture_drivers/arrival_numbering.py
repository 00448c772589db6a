"""Number and time the samples of a stream that neither counts nor stamps them, by when they arrive."""

from __future__ import annotations

import copy
from collections.abc import Sequence

from texture_drivers.clock import StreamClock
from texture_drivers.unseen_loss import UnseenLoss

BLOCKS_LATE = 1.5  # a block may come so late by the pace at which it is read, and nothing is lost


class ArrivalNumbering:
    """Give blocks of samples their running index: a jump is what was lost.

    Losses that the protocol shows are given by the caller. Others are known half a second later, by all samples being
    late from then on (see `UnseenLoss`); over an interruption the host's clock shows how much is missing.

    Parameters
    ----------
    rate_hz
        Rate of the stream.
    block_s
        How often arrivals are observed; what is late by less than 1.5 of it, and by less than 1.5 samples, is no loss.
    max_drift
        By what share the device's clock may be wrong.
    """

    def __init__(self, rate_hz: float, *, block_s: float, max_drift: float = 5e-3) -> None:
        self.clock = StreamClock(rate_hz, max_drift=max_drift)
        self.next_index = 0
        self._losses = UnseenLoss(rate_hz, min_duration_s=BLOCKS_LATE * max(block_s, 1 / rate_hz))
        self._interrupted = False
        self._clock_before: StreamClock | None = None  # before an interruption, until the clock is settled again

    def interrupt(self) -> None:
        """Forget what belongs to the stream so far: another one begins."""
        self._interrupted = True

    def place(self, blocks: Sequence[tuple[int, int]], arrival_ns: int) -> list[int]:
        """Return the index of the first sample of each block.

        Parameters
        ----------
        blocks
            Of each block that has just arrived: samples missing before it, and samples in it; at least one block.
        arrival_ns
            When they were there.

        Returns
        -------
        list of int
            Empty while the clock is not settled: then no time is known.
        """
        if self._interrupted:
            self._resume()
        indices = []
        for missing, samples in blocks:
            indices.append(self.next_index + missing)
            self.next_index += missing + samples
        unseen = self._unseen(self.next_index - 1, arrival_ns)
        self.clock.observe(self.next_index - 1 + unseen, arrival_ns)
        skipped = unseen + self._skipped(self.next_index - 1 + unseen)
        self.next_index += skipped
        return [index + skipped for index in indices] if self.clock.settled else []

    def _resume(self) -> None:
        """Number on after an interruption, and keep the clock of before for telling what was lost in it."""
        self._interrupted = False
        if self.clock.settled:
            self._clock_before = copy.copy(self.clock)
        self.clock.restart()
        self._losses.restart()

    def _unseen(self, index: int, arrival_ns: int) -> int:
        """Return how many samples must have been lost before those that have just arrived."""
        if not self.clock.settled or self._clock_before is not None:
            return 0
        return self._losses.lost(arrival_ns - self.clock.time_ns(index), arrival_ns)

    def _skipped(self, index: int) -> int:
        """Return how many samples an interruption has cost that is over now; known once the clock is settled again."""
        if self._clock_before is None or not self.clock.settled:
            return 0
        skipped = max(0, round(self._clock_before.index_at(self.clock.time_ns(index))) - index)
        self._clock_before = None
        self.clock.skip(skipped)
        return skipped

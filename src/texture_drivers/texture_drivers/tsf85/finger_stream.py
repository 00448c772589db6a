"""One finger of a TSF-85: its sample frames become numbered, timed batches."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

from texture_core.signal import TactileSignal
from texture_drivers.clock import StreamClock
from texture_drivers.sample_counter import SampleCounter
from texture_drivers.tsf85 import tables
from texture_drivers.tsf85.batch_cutter import IMU, SIGNAL, STATIC, BatchCutter
from texture_drivers.tsf85.sample_frames import SampleFrame
from texture_drivers.tsf85.settings import Tsf85Settings
from texture_drivers.unseen_loss import UnseenLoss


class FingerStream:
    """Number the sample frames of one finger by the device's stamps, time them by the host's clock, cut batches.

    Where the firmware sends no stamps, the host's clock also tells what was lost, half a second later.

    Parameters
    ----------
    layout
        Kind of fingertip.
    settings
        Of the inertial sensors.
    static_rate_hz
        Rate of the taxel images as published; 0: that of the layout.
    frame_id
        For the headers.
    """

    def __init__(
        self,
        layout: tables.Tsf85Layout = tables.TSF85,
        settings: Tsf85Settings | None = None,
        static_rate_hz: float = 0.0,
        frame_id: str = '',
    ) -> None:
        settings = Tsf85Settings() if settings is None else settings
        self.clock = StreamClock(tables.RATE_HZ)
        self.counter = SampleCounter()
        self.cutter = BatchCutter(layout, settings, static_rate_hz or layout.static_rate_hz, frame_id, self.clock)
        self._losses = UnseenLoss(tables.RATE_HZ)
        self._waiting: list[SampleFrame] = []
        self._interrupted = False
        self._clock_before: StreamClock | None = None  # before an interruption, until the clock is settled again

    @property
    def rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        rates = {SIGNAL: tables.RATE_HZ, STATIC: self.cutter.static_rate_hz}
        return {**rates, IMU: tables.RATE_HZ} if self.cutter.has_motion else rates

    def interrupt(self) -> None:
        """Forget what belongs to the stream so far: another one begins."""
        self._interrupted = True
        self._waiting = []

    def place(self, frames: Sequence[SampleFrame], arrival_ns: int) -> Mapping[str, list[TactileSignal]]:
        """Return the batches, by topic, that the sets make which have just arrived."""
        if not frames:
            return {}
        if self._interrupted:
            self._resume()
        waiting = [*self._waiting, *frames]
        indices, restarted = self.counter.place([item.stamp_ms for item in waiting])
        self._waiting = waiting[len(indices) :]
        if restarted:
            self.interrupt()
        if not indices:
            return {}
        missing = self._unseen(waiting[: len(indices)], indices[-1], arrival_ns)
        self.clock.observe(indices[-1] + missing, arrival_ns)
        skipped = missing + self._skipped(indices[-1] + missing)
        return self.cutter.cut([index + skipped for index in indices], waiting[: len(indices)])

    def _resume(self) -> None:
        """Number on after an interruption, and keep the clock of before for telling what was lost in it."""
        self._interrupted = False
        if self.clock.settled:
            self._clock_before = copy.copy(self.clock)
        self.clock.restart()
        self.counter.interrupt()

    def _unseen(self, frames: Sequence[SampleFrame], index: int, arrival_ns: int) -> int:
        """Return how many samples must have been lost before these, which have no stamps, and number on behind them."""
        stamped = any(item.stamp_ms is not None for item in frames)
        if stamped or not self.clock.settled or self._clock_before is not None:
            self._losses.restart()
            return 0
        missing = self._losses.lost(arrival_ns - self.clock.time_ns(index), arrival_ns)
        self.counter.skip(missing)
        return missing

    def _skipped(self, index: int) -> int:
        """Return how many samples an interruption has cost that is over now, and number on behind them.

        That is known when the clock is settled again and not before: what arrives first may be long on its way.
        """
        if self._clock_before is None or not self.clock.settled:
            return 0
        skipped = max(0, round(self._clock_before.index_at(self.clock.time_ns(index))) - index)
        self._clock_before = None
        self.counter.skip(skipped)
        self.clock.skip(skipped)
        return skipped

"""One finger of a TSF-85: its sample frames become numbered, timed batches."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

import numpy as np

from texture_core.arrays import Array
from texture_core.signal import TactileSignal
from texture_drivers.clock import StreamClock
from texture_drivers.sample_counter import SampleCounter
from texture_drivers.tsf85 import tables
from texture_drivers.tsf85.sample_frames import SampleFrame
from texture_drivers.tsf85.settings import Tsf85Settings
from texture_drivers.unseen_loss import UnseenLoss

IMAGE_HOLD_S = 0.25  # an image older than this is no measurement of now
SIGNAL, STATIC, IMU = 'signal', 'signal_static', 'imu'


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


class BatchCutter:
    """Batch numbered sample frames: a new batch wherever the index jumps, and taxel images at a constant rate."""

    def __init__(
        self,
        layout: tables.Tsf85Layout,
        settings: Tsf85Settings,
        static_rate_hz: float,
        frame_id: str,
        clock: StreamClock,
    ) -> None:
        self.samples = 0
        self.lost = 0
        self.images = 0
        self.repeated_images = 0  # published although no other image had come since the tick before
        self.static_rate_hz = static_rate_hz
        self._layout = layout
        self._frame_id = frame_id
        self._clock = clock
        self._motion_channels, self._motion_units = settings.channels, settings.units
        self._motion_gains: Array = settings.gains
        self._next_index: int | None = None  # none published yet
        self._image: tuple[int, ...] | None = None
        self._image_index = 0
        self._last_published: tuple[int, ...] | None = None
        self._tick = 0
        self._frames_per_tick = tables.RATE_HZ / static_rate_hz

    @property
    def has_motion(self) -> bool:
        """Whether the inertial sensors are published."""
        return bool(self._motion_channels)

    def cut(self, indices: Sequence[int], frames: Sequence[SampleFrame]) -> Mapping[str, list[TactileSignal]]:
        """Return the batches by topic; nothing while the clock is not settled."""
        if not self._clock.settled:
            return {}
        batches: dict[str, list[TactileSignal]] = {SIGNAL: [], STATIC: [], IMU: []}
        for first, members in _runs(indices, frames):
            if first != self._next_index:
                self._jump(first)
            self._next_index = first + len(members)
            self.samples += len(members)
            batches[SIGNAL].append(self._dynamic(first, members))
            batches[STATIC].extend(self._images(first, members))
            batches[IMU].extend(self._motion(first, members))
        return batches

    def _jump(self, first: int) -> None:
        self.lost += 0 if self._next_index is None else first - self._next_index
        self._tick = math.ceil(first / self._frames_per_tick)

    def _images(self, first: int, members: Sequence[SampleFrame]) -> Iterator[TactileSignal]:
        for index, item in enumerate(members, first):
            if item.image is not None:
                self._image, self._image_index = item.image, index
            while self._tick * self._frames_per_tick <= index:
                if self._image is not None and index - self._image_index <= IMAGE_HOLD_S * tables.RATE_HZ:
                    yield self._static(self._tick, self._image)
                self._tick += 1

    def _dynamic(self, first: int, members: Sequence[SampleFrame]) -> TactileSignal:
        return TactileSignal(
            stamp_ns=self._clock.time_ns(first),
            sensor=tables.DYNAMIC_SENSOR,
            channels=tables.DYNAMIC_CHANNELS,
            units=(tables.UNIT,),
            sampling_rate_hz=tables.RATE_HZ,
            first_sample=first,
            samples=np.array([item.dynamic for item in members], dtype=np.float32)[:, None],
            frame_id=self._frame_id,
        )

    def _motion(self, first: int, members: Sequence[SampleFrame]) -> Iterator[TactileSignal]:
        """Yield the inertial values, unless the device has sent none of them."""
        counts = np.array([item.motion for item in members])
        if not self.has_motion or np.isnan(counts).all():
            return
        yield TactileSignal(
            stamp_ns=self._clock.time_ns(first),
            sensor=tables.MOTION_SENSOR,
            channels=self._motion_channels,
            units=self._motion_units,
            sampling_rate_hz=tables.RATE_HZ,
            first_sample=first,
            samples=(counts * self._motion_gains).astype(np.float32),
            frame_id=self._frame_id,
        )

    def _static(self, tick: int, image: tuple[int, ...]) -> TactileSignal:
        self.images += 1
        self.repeated_images += image == self._last_published
        self._last_published = image
        return TactileSignal(
            stamp_ns=self._clock.time_ns(tick * self._frames_per_tick),
            sensor=tables.STATIC_SENSOR,
            channels=self._layout.static_channels,
            units=(tables.UNIT,) * len(self._layout.static_channels),
            sampling_rate_hz=self.static_rate_hz,
            first_sample=tick,
            samples=np.array([image], dtype=np.float32),
            frame_id=self._frame_id,
        )


def _runs(indices: Sequence[int], frames: Sequence[SampleFrame]) -> Iterator[tuple[int, list[SampleFrame]]]:
    """Yield the first index and the sets of each run without a gap."""
    numbered = enumerate(zip(indices, frames, strict=True))
    for _, run in groupby(numbered, key=lambda item: item[1][0] - item[0]):
        members = [numbered_frame for _, numbered_frame in run]
        yield members[0][0], [item for _, item in members]

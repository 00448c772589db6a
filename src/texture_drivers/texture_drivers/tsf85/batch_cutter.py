"""Cut the samples of a finger into batches of signals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

import numpy as np

from texture_core.arrays import Array
from texture_core.signal import TactileSignal
from texture_drivers.clock import StreamClock
from texture_drivers.tsf85 import tables
from texture_drivers.tsf85.sample_frames import SampleFrame
from texture_drivers.tsf85.settings import Tsf85Settings

IMAGE_HOLD_S = 0.25  # an image older than this is no measurement of now
SIGNAL, STATIC, IMU = 'signal', 'signal_static', 'imu'


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

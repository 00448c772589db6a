"""Place the blocks of a stream in time and note what is missing between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from texture_core.signal import NANOSECONDS, TactileSignal
from texture_drivers.block_counter import BlockCounter
from texture_drivers.clock import StreamClock
from texture_drivers.framed_stream import SAMPLE, FramedStream

MICROSECONDS = 1_000_000


class StreamBlock(NamedTuple):
    """The samples of one frame, with unwrapped time."""

    time_us: int
    rows: int
    lost_frames: int
    data: bytes


class StreamTracker:
    """Follow one stream: number its blocks and make batches of them."""

    def __init__(self, stream: FramedStream, frame_id: str) -> None:
        self.stream = stream
        self.samples = 0  # published
        self.lost = 0  # between the first one published and the last
        self._frame_id = frame_id
        self._counter = BlockCounter(stream.rate_hz, stream.sensor)
        self._due_ns: int | None = None  # when the next sample would have come, had there been no interruption
        self._published: int | None = None  # index after the last one

    @property
    def overrun(self) -> int:
        """Samples that the device itself left out."""
        return self._counter.overrun

    def end_us(self, block: StreamBlock) -> int:
        """Return the device's time of a block's last sample."""
        return block.time_us + round((block.rows - 1) * MICROSECONDS / self.stream.rate_hz)

    def interrupt(self, clock: StreamClock) -> None:
        """Note by the old clock when the next sample is due."""
        if self._counter.next_us is not None and clock.settled:
            self._due_ns = clock.time_ns(self._counter.next_us)
        self._counter.resume(0)

    def batches(self, blocks: Sequence[StreamBlock], clock: StreamClock) -> list[TactileSignal]:
        """Return the batches that consecutive blocks make: a new one wherever samples are missing."""
        if self._due_ns is not None:
            missing_ns = clock.time_ns(blocks[0].time_us) - self._due_ns
            self._counter.resume(max(0, round(missing_ns * self.stream.rate_hz / NANOSECONDS)))
            self._due_ns = None
        runs: list[tuple[int, int, list[bytes]]] = []
        for block in blocks:
            expected = self._counter.next_index
            index = self._counter.place(block.time_us, block.rows, block.lost_frames)
            if not runs or index != expected:
                runs.append((index, block.time_us, []))
            runs[-1][2].append(block.data)
        return [self._batch(index, clock.time_ns(time_us), b''.join(data)) for index, time_us, data in runs]

    def _account(self, index: int, samples: int) -> None:
        """Count samples that are published, and those that are missing before them."""
        self.lost += 0 if self._published is None else index - self._published
        self._published = index + samples
        self.samples += samples

    def _batch(self, index: int, stamp_ns: int, data: bytes) -> TactileSignal:
        counts: NDArray[np.int16] = np.frombuffer(data, dtype=SAMPLE).reshape(-1, len(self.stream.channels))
        self._account(index, len(counts))
        return TactileSignal(
            stamp_ns=stamp_ns,
            sensor=self.stream.sensor,
            channels=self.stream.channels,
            units=self.stream.units,
            sampling_rate_hz=self.stream.rate_hz,
            first_sample=index,
            samples=(counts * self.stream.gains + self.stream.offsets).astype(np.float32),
            frame_id=self._frame_id,
        )

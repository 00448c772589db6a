"""The recent samples of one stream, found again by their running index."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Samples
from texture_core.signal import NANOSECONDS, TactileSignal

# A sample belongs to a window from a thousandth of a sample before its start on: stamps are rounded to nanoseconds.
INDEX_TOLERANCE = 1e-3


class SampleBuffer:
    """Samples of one numbering, rate and set of channels; lost ones are NaN, old ones are forgotten.

    Parameters
    ----------
    signal
        The first batch.
    keep_s
        A sample is kept until a batch arrives that begins so much later.

    Examples
    --------
    >>> batch = TactileSignal(0, 'finger', ('pac',), (), 1000.0, 0, np.array([[1.0], [2.0]], dtype=np.float32))
    >>> buffer = SampleBuffer(batch, keep_s=1.0)
    >>> later = TactileSignal(3_000_000, 'finger', ('pac',), (), 1000.0, 3, np.array([[4.0]], dtype=np.float32))
    >>> buffer.append(later), buffer.take(0, 4)[:, 0].tolist()  # the third sample is missing
    (1, [1.0, 2.0, nan, 4.0])
    """

    def __init__(self, signal: TactileSignal, keep_s: float) -> None:
        self.rate_hz = signal.sampling_rate_hz
        self.channels = signal.channels
        self.sensor = signal.sensor
        self.first_sample = signal.first_sample
        self.next_sample = signal.first_sample
        self._keep = math.ceil(keep_s * self.rate_hz)
        self._rows: NDArray[np.float32] = np.empty((2 * len(signal.samples), len(self.channels)), dtype=np.float32)
        self._origin = signal.first_sample  # index of row 0
        self._marks: deque[tuple[int, int, int]] = deque()  # index, start and end time of each batch that is kept
        self.append(signal)

    @property
    def end_ns(self) -> int:
        """When the newest batch ended."""
        return self._marks[-1][2]

    def continued_by(self, signal: TactileSignal) -> bool:
        """Whether the batch carries on this numbering, with or without a loss before it."""
        return (
            signal.first_sample >= self.next_sample
            and signal.sampling_rate_hz == self.rate_hz
            and signal.channels == self.channels
        )

    def append(self, signal: TactileSignal) -> int:
        """Append a batch; return how many samples were lost before it."""
        lost = signal.first_sample - self.next_sample
        self._forget(signal.first_sample - self._keep)
        self._make_room(signal.next_sample)
        row = signal.first_sample - self._origin
        self._rows[self.next_sample - self._origin : row] = np.nan
        self._rows[row : row + len(signal.samples)] = signal.samples
        self.next_sample = signal.next_sample
        self._marks.append((signal.first_sample, signal.stamp_ns, signal.end_ns))
        return lost

    def anchor(self, time_ns: int) -> tuple[int, int] | None:
        """Return index and stamp of the first batch that ends after `time_ns`, if there is one."""
        if self._marks[-1][2] <= time_ns:
            return None
        return next((index, stamp) for index, stamp, end in self._marks if end > time_ns)

    def index_at(self, time_ns: int, anchor: tuple[int, int]) -> int:
        """Return the index of the first sample at or after a time, reckoned from the anchor."""
        index, stamp = anchor
        return index + math.ceil((time_ns - stamp) * self.rate_hz / NANOSECONDS - INDEX_TOLERANCE)

    def time_of(self, index: float) -> int:
        """Return when a sample, or a place between two, was taken, ns: reckoned from its batch, or the nearest kept."""
        batch = max(0, bisect_right(self._marks, index, key=lambda mark: mark[0]) - 1)
        first, stamp, _ = self._marks[batch]
        return stamp + round((index - first) / self.rate_hz * NANOSECONDS)

    def take(self, first_sample: int, count: int) -> Samples:
        """Return a copy of samples that are kept, (count, n_channels) float64.

        Parameters
        ----------
        first_sample
            Running index of the first one.
        count
            How many.

        Returns
        -------
        (count, n_channels)
            Lost samples are NaN.
        """
        row = first_sample - self._origin
        return self._rows[row : row + count].astype(np.float64)

    def _forget(self, before: int) -> None:
        """Forget samples with an index below `before`; those already lost by then are not stored at all."""
        if before <= self.first_sample:
            return
        self.first_sample = before
        self.next_sample = max(self.next_sample, before)
        while self._marks and self._marks[0][0] < before:
            self._marks.popleft()

    def _make_room(self, until: int) -> None:
        if until - self._origin <= len(self._rows):
            return
        kept = self._rows[self.first_sample - self._origin : self.next_sample - self._origin]
        needed = 2 * (until - self.first_sample)
        rows = self._rows if needed <= len(self._rows) else np.empty((needed, len(self.channels)), dtype=np.float32)
        rows[: len(kept)] = kept  # numpy copies overlapping memory correctly
        self._rows, self._origin = rows, self.first_sample


class BufferedStream:
    """The runs of one topic: a new one begins when the numbering restarts or the rate or channels change.

    One that ended is kept as long as a sample, and no more than `MAX_BUFFERS` are.

    Examples
    --------
    >>> stream = BufferedStream(keep_s=1.0)
    >>> batch = TactileSignal(0, 'finger', ('pac',), (), 1000.0, 0, np.zeros((10, 1), dtype=np.float32))
    >>> stream.add(batch), stream.add(batch), stream.restarts  # index 0 again: the sensor was started again
    (True, True, 1)
    """

    MAX_BUFFERS = 4

    def __init__(self, keep_s: float) -> None:
        self.buffers: deque[SampleBuffer] = deque(maxlen=self.MAX_BUFFERS)
        self.lost_samples = 0
        self.restarts = 0
        self._keep_s = keep_s

    def add(self, signal: TactileSignal) -> bool:
        """Add a batch; return whether it began a new run."""
        while len(self.buffers) > 1 and signal.stamp_ns - self.buffers[0].end_ns > self._keep_s * NANOSECONDS:
            self.buffers.popleft()
        if self.buffers and self.buffers[-1].continued_by(signal):
            self.lost_samples += self.buffers[-1].append(signal)
            return False
        self.restarts += bool(self.buffers)
        self.buffers.append(SampleBuffer(signal, self._keep_s))
        return True

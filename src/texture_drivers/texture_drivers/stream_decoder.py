"""Streams of samples on a framed serial line: numbered, timed, in physical units. Knows no port.

Each frame (see `texture_core.framing`) carries `rows` consecutive samples of `columns` channels as int16, little
endian, row after row; its kind tells the stream, its time is that of the first row.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from texture_core.framing import TIME_BITS, CounterUnwrapper, Frame, FrameDecoder
from texture_core.signal import TactileSignal
from texture_drivers.channel_watch import Limits
from texture_drivers.clock import PPM, SLOW_CLOCK, StreamClock
from texture_drivers.framed_stream import SAMPLE, FramedStream
from texture_drivers.stream_tracker import MICROSECONDS, StreamBlock, StreamTracker

LONGEST_STEP_US = 10 * MICROSECONDS  # a clock that leaps further is another one; the host's clock tells the gap


class StreamDecoder:
    """Decode the bytes of a framed serial line into the batches of its streams, by topic.

    Frames of other kinds are passed over, so that other traffic may share the line. All streams are timed by one clock.

    Parameters
    ----------
    streams
        What is expected.
    frame_id
        For the headers.
    """

    def __init__(self, streams: Sequence[FramedStream], frame_id: str = '') -> None:
        self.malformed = 0  # frames that passed the checksum and hold another number of bytes than they say
        self.other_frames = 0  # frames of other kinds
        self.restarts = 0  # of the device's clock
        self.deframer = FrameDecoder()
        self.clock = StreamClock(MICROSECONDS)
        self.trackers = {stream.kind: StreamTracker(stream, frame_id) for stream in streams}
        self._time = CounterUnwrapper(TIME_BITS)
        self._latest_us: dict[int, int] = {}  # time of the last block of each kind
        self._newest_us = 0

    @property
    def valid_frames(self) -> int:
        """Frames that passed the checksum, of any kind."""
        return self.deframer.frames

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals: samples published and lost, frames refused or passed over, and new beginnings."""
        trackers = self.trackers.values()
        return {
            'samples': sum(tracker.samples for tracker in trackers),
            'lost': sum(tracker.lost for tracker in trackers),
            'left out by the device': sum(tracker.overrun for tracker in trackers),
            'bogus': self.deframer.bad_frames + self.malformed,
            'repeated frames': self.deframer.repeated,
            'other frames': self.other_frames,
            'device restarts': self.restarts,
            'clock_steps': self.clock.steps,
        }

    @property
    def details(self) -> Mapping[str, float]:
        """How much the device's clock is slow."""
        return {SLOW_CLOCK: PPM * self.clock.drift}

    @property
    def rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        return {tracker.stream.topic: tracker.stream.rate_hz for tracker in self.trackers.values()}

    @property
    def limits(self) -> Limits:
        """Lowest and highest sample by topic: those of an int16."""
        return {tracker.stream.topic: tracker.stream.limits for tracker in self.trackers.values()}

    def restart(self) -> None:
        """Go on after an interruption, with the index that the host's clock will tell."""
        self.deframer.restart()
        self._restart_streams()

    def feed(self, data: bytes, arrival_ns: int) -> Mapping[str, Sequence[TactileSignal]]:
        """Return the batches in `data`, which has just arrived; none in the first 0.1 s of a stream.

        Raises
        ------
        DeviceError
            If the device sends another version, other channels or another rate than expected.
        """
        blocks = self._blocks(self.deframer.feed(data))
        if not blocks:
            return {}
        newest_us = max(self.trackers[kind].end_us(found[-1]) for kind, found in blocks.items())
        if newest_us >= self._newest_us:  # an older block of a slower stream tells nothing new
            self.clock.observe(newest_us, arrival_ns)
            self._newest_us = newest_us
        if not self.clock.settled:
            return {}
        return {
            self.trackers[kind].stream.topic: self.trackers[kind].batches(found, self.clock)
            for kind, found in blocks.items()
        }

    def _restart_streams(self) -> None:
        for tracker in self.trackers.values():
            tracker.interrupt(self.clock)
        self.clock.restart()
        self._time = CounterUnwrapper(TIME_BITS)
        self._latest_us = {}
        self._newest_us = 0

    def _blocks(self, frames: Sequence[Frame]) -> dict[int, list[StreamBlock]]:
        """Return the blocks of each stream; those before a restart of the device's clock are given up."""
        blocks: dict[int, list[StreamBlock]] = {}
        for frame in frames:
            if not self._fits(frame):
                continue
            if self._has_restarted(frame):
                self.restarts += 1
                self._restart_streams()
                blocks = {}
            time_us = self._latest_us[frame.kind] = self._time.advance(frame.time_us)
            blocks.setdefault(frame.kind, []).append(StreamBlock(time_us, frame.rows, frame.lost, frame.body))
        return blocks

    def _has_restarted(self, frame: Frame) -> bool:
        """Return whether the device's clock went back, within one stream, or leapt."""
        if self._time.value is None:
            return False
        step_us = self._time.step(frame.time_us)
        moved_back = self._time.value + step_us < self._latest_us.get(frame.kind, self._time.value + step_us)
        return moved_back or abs(step_us) > LONGEST_STEP_US

    def _fits(self, frame: Frame) -> bool:
        tracker = self.trackers.get(frame.kind)
        if tracker is None:
            self.other_frames += 1
            return False
        tracker.stream.check(frame)
        if not frame.rows or frame.rows * frame.columns * SAMPLE.itemsize != len(frame.body):
            self.malformed += 1
            return False
        return True

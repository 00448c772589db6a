"""Exploration states made from the signals themselves, where no explorer tells them or they are wrong."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Mapping

import numpy as np

from texture_core.arrays import Array, Samples
from texture_core.exploration import ExplorationState, Phase
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_features.segmentation.cell_power import baseline_power, cell_power
from texture_features.segmentation.segments import SegmentationParams, SlidingInterval, find_sliding
from texture_features.windowing.sample_buffer import BufferedStream, SampleBuffer

PERIOD_S = 0.1
KEEP_S = 20.0
KEEP_NS = round(KEEP_S * NANOSECONDS)
WHOLE_S = 1e6
MOTION = 'detected'


class SlideSegmenter:
    """Turn signal batches into exploration states: `slide` while the finger slides, `lift` when it has ended.

    A state is returned once what it covers is certain: a ramp and a bridge (0.4 s by default) after it was measured.
    The sensor's noise is estimated at rest, so let the finger rest at first, or give `noise_rms`.

    Parameters
    ----------
    params
        How sliding is found.
    fast, slow
        Topics of the vibration and of the pressure; batches of other topics are ignored.
    exploration_id
        What the ids of the slides begin with.
    keep_s
        How much signal is looked at.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> samples = 0.01 * rng.standard_normal((3000, 1)).astype(np.float32)
    >>> samples[1000:2000] += rng.standard_normal((1000, 1))  # vibration from 1 s to 2 s
    >>> segmenter = SlideSegmenter(SegmentationParams(ramp_s=0.01, quantity='force'))
    >>> states = segmenter.add_signal('signal', TactileSignal(0, 'finger', ('pac',), (), 1000.0, 0, samples))
    >>> [state.phase.value for state in states + segmenter.finish()]
    ['slide', 'lift']
    """

    def __init__(
        self,
        params: SegmentationParams,
        fast: str = 'signal',
        slow: str = 'signal_static',
        exploration_id: str = 'detected',
        keep_s: float = KEEP_S,
    ) -> None:
        self._params = params
        self._streams = {fast: BufferedStream(keep_s), slow: BufferedStream(keep_s)}
        self._fast, self._slow = fast, slow
        self._name = exploration_id
        self._slides = 0
        self._reported_ns = 0  # up to here everything is reported
        self._sliding = False
        self._due_ns = 0
        self._rest: Array = np.empty(0)

    def add_signal(self, topic: str, signal: TactileSignal) -> list[ExplorationState]:
        """Add a batch; return the states that are now beyond doubt."""
        states = self.collect(topic, signal)
        if topic != self._fast or not len(signal.samples) or 0 <= self._due_ns - signal.end_ns < KEEP_NS:
            return states
        self._due_ns = signal.end_ns + round(PERIOD_S * NANOSECONDS)
        doubt_s = self._params.ramp_s + self._params.max_gap_s
        return states + self._report(signal.end_ns - round(doubt_s * NANOSECONDS))

    def collect(self, topic: str, signal: TactileSignal) -> list[ExplorationState]:
        """Add a batch without looking at what it brings yet; return what is left of a numbering that ends with it."""
        if topic not in self._streams or not len(signal.samples):
            return []
        buffers = self._streams[topic].buffers
        ends = topic == self._fast and bool(buffers) and not buffers[-1].continued_by(signal)
        states = self.finish() if ends else []
        self._streams[topic].add(signal)
        return states

    def finish(self) -> list[ExplorationState]:
        """Return what is left of a recording."""
        buffers = self._streams[self._fast].buffers
        return self._report(buffers[-1].time_of(buffers[-1].next_sample), over=True) if buffers else []

    def _report(self, sure_ns: int, *, over: bool = False) -> list[ExplorationState]:
        """Return the states up to `sure_ns`."""
        states: list[ExplorationState] = []
        for start_ns, end_ns in self._spans(self._streams[self._fast].buffers[-1]):
            if end_ns <= self._reported_ns or start_ns >= sure_ns:
                continue
            # A little more of a slide that has been reported to its end is doubt about that end, not another slide.
            if (
                not self._sliding
                and end_ns - max(start_ns, self._reported_ns) < self._params.min_duration_s * NANOSECONDS
            ):
                continue
            self._slides += not self._sliding
            begun_ns = self._reported_ns if self._sliding else max(start_ns, self._reported_ns)
            self._reported_ns = min(end_ns, sure_ns)
            states.append(self._state(begun_ns, Phase.SLIDE, self._reported_ns - begun_ns))
            self._sliding = end_ns > sure_ns and not over
            if not self._sliding:
                states.append(self._state(self._reported_ns, Phase.LIFT))
        if self._sliding and not states:  # what was measured as sliding turned out to have ended before
            self._sliding = False
            states.append(self._state(self._reported_ns, Phase.LIFT))
        return states

    def _spans(self, buffer: SampleBuffer) -> list[tuple[int, int]]:
        """Return start and end of the sliding in what is kept of a run, ns."""
        begin_ns = buffer.time_of(buffer.first_sample)
        spans = [(found.start_s, found.end_s) for found in self._find(buffer, begin_ns)]
        first, rate_hz = buffer.first_sample, buffer.rate_hz
        return [(buffer.time_of(first + a * rate_hz), buffer.time_of(first + b * rate_hz)) for a, b in spans]

    def _watch_rest(self, fast: Samples, rate_hz: float) -> None:
        """Keep the lowest power of each channel as that at rest."""
        _, powers = cell_power(fast, rate_hz, self._params.cell_s, self._params.smooth_s)
        if len(powers):
            quiet = baseline_power(powers)
            self._rest = np.minimum(self._rest, quiet) if quiet.shape == self._rest.shape else quiet

    def _find(self, buffer: SampleBuffer, begin_ns: int) -> list[SlidingInterval]:
        fast = buffer.take(buffer.first_sample, buffer.next_sample - buffer.first_sample)
        self._watch_rest(fast, buffer.rate_hz)
        slow = self._streams[self._slow].buffers
        if not slow:
            return find_sliding(fast, buffer.rate_hz, self._params, rest=self._rest)
        pressure = slow[-1].take(slow[-1].first_sample, slow[-1].next_sample - slow[-1].first_sample)
        from_s = (slow[-1].time_of(slow[-1].first_sample) - begin_ns) / NANOSECONDS
        return find_sliding(
            fast, buffer.rate_hz, self._params,
            slow=pressure, slow_rate_hz=slow[-1].rate_hz, slow_from_s=from_s, rest=self._rest,
        )  # fmt: skip

    def _state(self, stamp_ns: int, phase: Phase, steady_ns: int = 0) -> ExplorationState:
        return ExplorationState(
            stamp_ns, f'{self._name}/{self._slides:03d}', MOTION, phase, steady_s=steady_ns / NANOSECONDS
        )


def segment_recording(
    signals: Mapping[str, Iterable[TactileSignal]], params: SegmentationParams, exploration_id: str = 'detected'
) -> list[ExplorationState]:
    """Return the states of the slides in a recording, a `slide` and a `lift` each, found with all of it in view.

    Parameters
    ----------
    signals
        The batches of `signal`, and of `signal_static` if there is one, in their order.
    params
        How sliding is found.
    exploration_id
        What the ids of the slides begin with.

    Returns
    -------
    list of ExplorationState
        In the order of time.
    """
    segmenter = SlideSegmenter(params, exploration_id=exploration_id, keep_s=WHOLE_S)
    tracks = [[(batch.stamp_ns, topic, batch) for batch in batches] for topic, batches in signals.items()]
    in_order = heapq.merge(*tracks, key=lambda item: item[0])
    states = [state for _, topic, batch in in_order for state in segmenter.collect(topic, batch)]
    return states + segmenter.finish()

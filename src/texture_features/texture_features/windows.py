# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Windows of a signal while the finger slides, cut and in batches: buffers, axes, coverage, what a feature is."""

from __future__ import annotations

import cmath
import dataclasses
import heapq
import math
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, partial
from operator import itemgetter
from typing import Any, ClassVar, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import NANOSECONDS, Array, ExplorationState, Phase, Samples, TactileSignal, Window

T = TypeVar('T')

# --------------------
# Windows in batches, and what a feature is: a stateless function of them, with named values.


@dataclass(frozen=True, eq=False)
class WindowBatch:
    """One window, or many of one rate and length: the leading axes count the windows.

    Parameters
    ----------
    samples : (..., n_samples, n_channels) float64
        Finite.
    rate_hz
        Sampling rate, > 0.
    speed_m_s, force_n : (...)
        Mean speed and normal force in each window; NaN if unknown.
    tangential_force_n : (...)
        Mean force of the surface against the direction of travel; NaN if unknown.
    joined
        The same stretches of time of other inputs, for features that join several; of the same leading axes.
    channels
        Name of each channel; () where nothing names them.

    Examples
    --------
    >>> batch = WindowBatch(np.arange(6.0).reshape(3, 2), rate_hz=1000.0)
    >>> batch.rows.tolist(), batch.centred_rows.tolist()
    ([[0.0, 2.0, 4.0], [1.0, 3.0, 5.0]], [[-2.0, 0.0, 2.0], [-2.0, 0.0, 2.0]])
    """

    samples: Samples
    rate_hz: float
    speed_m_s: Array = field(default_factory=lambda: np.array(np.nan))
    force_n: Array = field(default_factory=lambda: np.array(np.nan))
    joined: tuple[WindowBatch, ...] = ()
    channels: tuple[str, ...] = ()
    tangential_force_n: Array = field(default_factory=lambda: np.array(np.nan))
    _memo: dict[Hashable, Any] = field(default_factory=dict, init=False, repr=False)  # none of what it replaces

    def __post_init__(self) -> None:
        if self.samples.ndim < 2 or 0 in self.samples.shape[-2:]:
            raise InvalidData(
                f'windows to describe have samples of shape {self.samples.shape}; '
                '(..., n_samples, n_channels) with at least one of each is needed'
            )

    @property
    def rows(self) -> Array:
        """The samples as (..., n_channels, n_samples), contiguous.

        Sums along the last axis have the same rounding for one window as for many, and are fast.
        """
        return np.ascontiguousarray(self.samples.swapaxes(-1, -2))

    @property
    def centred_rows(self) -> Array:
        """The rows less their mean."""
        return self.shared('centred_rows', lambda: centred(self.rows))

    @property
    def moving_m_s(self) -> Array:
        """The speed, (...); NaN where it is unknown or not above 0."""
        return self.shared('moving_m_s', lambda: np.where(np.greater(self.speed_m_s, 0), self.speed_m_s, np.nan))

    def without(self, omitted: str) -> list[int]:
        """Return the numbers of the channels that are left when some are omitted.

        Parameters
        ----------
        omitted
            Names separated by spaces; one that no channel has is passed over.

        Raises
        ------
        InvalidData
            If some are to be omitted and the channels have no names, or none is left.
        """
        if not omitted:
            return list(range(self.samples.shape[-1]))
        if not self.channels:
            raise InvalidData(
                f"channels '{omitted}' are to be omitted, but the windows do not name their channels; give WindowBatch "
                'its `channels`'
            )
        left = [number for number, name in enumerate(self.channels) if name not in omitted.split()]
        if not left:
            raise InvalidData(
                f"all channels ({', '.join(self.channels)}) are omitted by '{omitted}'; leave one or more"
            )
        return left

    def shared(self, key: Hashable, compute: Callable[[], T]) -> T:
        """Return an intermediate result that several features need; it is computed once."""
        if key not in self._memo:
            self._memo[key] = compute()
        return self._memo[key]


class Feature(Protocol):
    """Frozen parameters of a feature; called with windows it gives its values.

    A feature of the signal gives (..., n_channels, n_names); one of the motion, such as the speed, (..., 1, n_names)
    and has `per_channel` False. One that can join several inputs, found in `windows.joined`, declares it by a class
    variable `joins` that is True; it has `per_channel` False. So has one of pairs of channels, which gives
    (..., n_pairs, n_names) in the order of itertools.combinations and declares it by a class variable `per_pair` that
    is True.
    """

    per_channel: ClassVar[bool] = True  # whether there are values for each channel

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each value of one channel; '' for the only value of a feature."""
        return ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the values; finite for finite samples."""


FLOOR = 1e-20  # power or power density added before a logarithm: silence gives a finite value


def floor_param(added: str = 'Power', unit: str = 'unit²', default: float = FLOOR) -> Any:
    """Return the parameter `floor` of a feature whose noise depends on the sensor."""
    sentence = f'{added} added before the logarithm, so that silence gives a finite value, {unit}.'
    return param(default, sentence, low=1e-300, high=1e300)


def centred(rows: Array) -> Array:
    """Return rows less their mean, (..., n_samples)."""
    # A product with equal shares is the fastest mean, and has the same rounding for one row as for many.
    return rows - (rows @ mean_weights(rows.shape[-1]))[..., None]


@lru_cache(maxsize=64)
def mean_weights(count: int) -> Array:
    """Return 1 / count, `count` times: what a mean is a product with."""
    return shared_constant(np.full(count, 1.0 / count))


def shared_constant(array: Array) -> Array:
    """Return an array that is computed once and shared, and therefore may not be changed."""
    array.flags.writeable = False
    return array


def power(rows: Array) -> Array:
    """Return the mean square of each row, (...)."""
    # A product of vectors for each row: no array of squares, and the same rounding for one row as for many.
    squares: Array = (rows[..., None, :] @ rows[..., :, None])[..., 0, 0]
    return squares / rows.shape[-1]


def first_difference(rows: Array) -> Array:
    """Return the steps from sample to sample, (..., max(1, n_samples - 1)); 0 for a single sample."""
    if rows.shape[-1] == 1:
        return np.zeros_like(rows)
    return rows[..., 1:] - rows[..., :-1]


# --------------------
# Windows of slides along x and along y of one exploration, joined into one.

SEPARATOR = '@'  # 'signal@x': what is measured on 'signal' while the finger slides along x
AXES_RAD = {'x': 0.0, 'y': 0.5 * math.pi}
WITHIN_RAD = math.radians(30.0)  # a direction further from both axes is along neither
MOST_WAITING = 100  # windows along one axis that wait for their partners: a long slide must not fill the memory


def split_axis(name: str) -> tuple[str, str]:
    """Return the topic of an input, and the axis along which the finger slides there; '' for any direction."""
    topic, separator, axis = name.partition(SEPARATOR)
    if separator and (axis not in AXES_RAD or not topic):
        raise InvalidParameter(
            f"input '{name}': a topic with an axis is needed, such as 'signal{SEPARATOR}x'; the axes are "
            f'{" and ".join(AXES_RAD)}'
        )
    return topic, axis


def topic_of(name: str) -> str:
    """Return the topic of an input."""
    return split_axis(name)[0]


def axis_along(direction_rad: float) -> str:
    """Return the axis to or against which a direction points within 30 degrees; '' if there is none."""
    for axis, angle in AXES_RAD.items():
        # Written so that NaN is along none.
        if math.isfinite(direction_rad) and abs(math.remainder(direction_rad - angle, math.pi)) <= WITHIN_RAD:
            return axis
    return ''


def check_axes(names: Iterable[str]) -> None:
    """Refuse names of inputs that cannot be joined."""
    names = tuple(names)
    axes = [split_axis(name)[1] for name in names]
    if any(axes) and not all(axes):
        raise InvalidParameter(
            f'the inputs {", ".join(names)} are some of slides along an axis and some of any direction; '
            f"name the axis of each, as in 'signal{SEPARATOR}x'"
        )


class AxisJoiner:
    """Join the n-th window along x with the n-th along y of the same exploration, whichever comes first."""

    def __init__(self, names: Iterable[str]) -> None:
        names = tuple(names)
        check_axes(names)
        self._sources = {name: split_axis(name) for name in names}
        self._waiting: dict[str, deque[CutWindow]] = {axis: deque() for _, axis in self._sources.values() if axis}

    @property
    def joins(self) -> bool:
        """Whether the inputs name axes; else every window is whole as it is."""
        return bool(self._waiting)

    def add(self, window: CutWindow) -> CutWindow | None:
        """Return the window that is complete with this one; None if its partner is still to come, or it is none."""
        waiting = self._waiting.get(axis_along(window.direction_rad))
        if waiting is None or len(waiting) >= MOST_WAITING:
            return None
        waiting.append(window)
        if not all(self._waiting.values()):
            return None
        parts = {axis: windows.popleft() for axis, windows in self._waiting.items()}
        several = tuple(parts.values())
        return dataclasses.replace(
            window,
            windows={name: parts[axis].windows[topic] for name, (topic, axis) in self._sources.items()},
            speed_m_s=sum(part.speed_m_s for part in several) / len(several),
            force_n=sum(part.force_n for part in several) / len(several),
            tangential_force_n=sum(part.tangential_force_n for part in several) / len(several),
            direction_rad=math.nan if len(several) > 1 else window.direction_rad,
        )

    def end(self) -> int:
        """Forget what has no partner, as the exploration is over; return how many windows that were."""
        left = sum(map(len, self._waiting.values()))
        for windows in self._waiting.values():
            windows.clear()
        return left


# --------------------
# The recent samples of one stream, found again by their running index.

# A sample belongs to a window from a thousandth of a sample before its start on: stamps are rounded to nanoseconds.
INDEX_TOLERANCE = 1e-3


class SampleBuffer:
    """Samples of one numbering, rate and set of channels; lost ones are NaN, old ones are forgotten."""

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
    def newest_ns(self) -> int:
        """When the newest batch began."""
        return self._marks[-1][1]

    @property
    def end_ns(self) -> int:
        """When the newest batch ended."""
        return self._marks[-1][2]

    def continued_by(self, signal: TactileSignal) -> bool:
        """Whether the batch carries on this numbering and its time, with or without a loss before it."""
        return (
            signal.first_sample >= self.next_sample
            and signal.stamp_ns >= self.newest_ns
            and signal.sampling_rate_hz == self.rate_hz
            and signal.channels == self.channels
        )

    def append(self, signal: TactileSignal) -> int:
        """Append a batch; return how many samples were lost before it."""
        lost = signal.first_sample - self.next_sample
        # Forget old samples; those already lost by then are not stored at all.
        before = signal.first_sample - self._keep
        if before > self.first_sample:
            self.first_sample = before
            self.next_sample = max(self.next_sample, before)
            while self._marks and self._marks[0][0] < before:
                self._marks.popleft()
        # Make room for the new ones.
        if signal.next_sample - self._origin > len(self._rows):
            kept = self._rows[self.first_sample - self._origin : self.next_sample - self._origin]
            needed = 2 * (signal.next_sample - self.first_sample)
            rows = self._rows if needed <= len(self._rows) else np.empty((needed, len(self.channels)), dtype=np.float32)
            rows[: len(kept)] = kept  # numpy copies overlapping memory correctly
            self._rows, self._origin = rows, self.first_sample
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
        """Return a copy of samples that are kept, (count, n_channels) float64."""
        row = first_sample - self._origin
        return self._rows[row : row + count].astype(np.float64)


class BufferedStream:
    """The runs of one topic: a new one begins when the numbering restarts or the rate or channels change.

    One that ended is kept as long as a sample, and no more than `MAX_BUFFERS` are. It also holds where slides begin in
    the buffers, `anchors`.
    """

    MAX_BUFFERS = 4

    def __init__(self, keep_s: float) -> None:
        self.buffers: deque[SampleBuffer] = deque(maxlen=self.MAX_BUFFERS)
        self.lost_samples = 0
        self.restarts = 0
        self.received = False
        self.received_s = math.nan
        self.anchors: dict[SampleBuffer, tuple[int, int]] = {}
        self._keep_s = keep_s

    def add(self, signal: TactileSignal) -> bool:
        """Add a batch; return whether its time goes back, as in a replay of the next bag: what came before is gone."""
        while len(self.buffers) > 1 and signal.stamp_ns - self.buffers[0].end_ns > self._keep_s * NANOSECONDS:
            self.buffers.popleft()
        if self.buffers and self.buffers[-1].continued_by(signal):
            self.lost_samples += self.buffers[-1].append(signal)
            return False
        back = bool(self.buffers) and signal.stamp_ns < self.buffers[-1].newest_ns
        self.restarts += bool(self.buffers)
        if back:
            self.buffers.clear()
            self.anchors.clear()
        self.buffers.append(SampleBuffer(signal, self._keep_s))
        return back


# --------------------
# One slide: which time is covered, and how fast and hard the finger moved.

Interval = tuple[float, float]
UNKNOWN: Interval = (math.nan, math.nan)

# Largest difference of two slide states that cover the time between them.
LINK_NS = NANOSECONDS // 2
# No guarantee holds for longer: a wrong one must not make millions of windows.
MAX_STEADY_S = 3600.0
MAX_STATES = 20_000
# Of the mean of the guaranteed states. A state without guarantee beyond them shows a slide that is none: in the air,
# pressed too hard, or far too fast.
LEAST_FORCE, MOST_FORCE, MOST_SPEED = 0.5, 1.5, 2.0


@dataclass(frozen=True)
class CoveredSpan:
    """A covered stretch of time with the mean speed and forces in it."""

    start_ns: int
    end_ns: int
    speed_m_s: float
    force_n: float
    direction_rad: float
    tangential_force_n: float = math.nan


class SlideCoverage:
    """The covered time of consecutive `slide` states, given window by window.

    After a state without guarantee, though others had one, the time up to the next state is not covered: the finger has
    lost the surface, turns, or does not slide as commanded. If its force or speed is far from that of the slide so far,
    what is left of the guarantee is not covered either; windows that were already given are kept.

    Its output depends on the order of the states alone, never on when they arrived: the mean speed and force of a
    window are those of the shortest beginning of the states that covers it.
    """

    def __init__(self, state: ExplorationState, length_ns: int, hop_ns: int, skip_ns: int) -> None:
        self.exploration_id = state.exploration_id
        self.surface = state.surface
        self.motion = state.motion
        self.start_ns = state.stamp_ns
        self.ended = False
        self.given_up = False  # its samples will not come: the recording of it is over
        self.skipped = 0
        self._length_ns = length_ns
        self._hop_ns = hop_ns
        self._next_ns = state.stamp_ns + skip_ns
        self._intervals: deque[list[int]] = deque()
        # each with the end of the covered time known with it
        self._states: deque[tuple[int, ExplorationState]] = deque(maxlen=MAX_STATES)
        self._promising = False
        self._withdrawn = False
        self._force, self._speed = RunningMean(), RunningMean()  # of the guaranteed states
        self.add(state)

    def add(self, state: ExplorationState) -> bool:
        """Take the next slide state; return False, and ignore it, if it is older than the last one."""
        stamp = state.stamp_ns
        start = stamp
        if self._states:
            before = self._states[-1][1].stamp_ns
            if stamp < before:
                return False
            start = before if stamp - before <= LINK_NS and not self._withdrawn else stamp
        self._promising |= state.steady_s > 0
        end = stamp + round(min(max(0.0, state.steady_s), MAX_STEADY_S) * NANOSECONDS)
        if self._intervals and start <= self._intervals[-1][1]:
            self._intervals[-1][1] = max(self._intervals[-1][1], end)
        else:
            self._intervals.append([start, end])
        self._withdrawn = self._promising and not state.steady_s > 0
        far = (
            state.force_n < LEAST_FORCE * self._force.value
            or state.force_n > MOST_FORCE * self._force.value
            or state.speed_m_s > MOST_SPEED * self._speed.value
        )
        if self._withdrawn and far:
            self._intervals[-1][1] = min(self._intervals[-1][1], stamp)
        if state.steady_s > 0:
            self._force.update(state.force_n)
            self._speed.update(state.speed_m_s)
        self._states.append((self._intervals[-1][1], state))
        return True

    @property
    def covered_ns(self) -> int:
        """End of the covered time."""
        return self._intervals[-1][1]

    def window(self) -> CoveredSpan | None:
        """Return the present window if it is covered, else None; windows that never can be are passed over."""
        while True:
            start, end = self._intervals[0]
            if self._next_ns < start:
                self._next_ns += -(-(start - self._next_ns) // self._hop_ns) * self._hop_ns
            if self._next_ns + self._length_ns <= end:
                return self._span(self._next_ns, self._next_ns + self._length_ns)
            if len(self._intervals) == 1:
                return None
            self._intervals.popleft()

    def advance(self, count: int = 1) -> int:
        """Advance by this many windows, but not beyond the covered stretch of the present one; return by how many."""
        left = (self._intervals[0][1] - self._length_ns - self._next_ns) // self._hop_ns + 1
        count = min(count, left)
        self._next_ns += count * self._hop_ns
        return count

    def _span(self, start: int, end: int) -> CoveredSpan:
        states = self._states
        while len(states) > 1 and states[1][1].stamp_ns <= start and states[0][0] < end:
            states.popleft()
        held: list[tuple[int, ExplorationState]] = []  # for how long each state holds in the span, ns
        for number, (covered, state) in enumerate(states):
            until = end if covered >= end else min(states[number + 1][1].stamp_ns, end)
            weight = until - max(state.stamp_ns, start)
            if weight > 0:
                held.append((weight, state))
            if until >= end:
                break
        speed_m_s = _mean([(weight, state.speed_m_s) for weight, state in held])
        force_n = _mean([(weight, state.force_n) for weight, state in held])
        tangential_n = _mean([(weight, state.tangential_force_n) for weight, state in held])
        # The direction of the sum of unit vectors: angles have no mean.
        headings = [(weight, state.direction_rad) for weight, state in held if math.isfinite(state.direction_rad)]
        way = sum(cmath.rect(weight, heading) for weight, heading in headings)
        return CoveredSpan(start, end, speed_m_s, force_n, cmath.phase(way) if way else math.nan, tangential_n)


def _mean(weighted: Sequence[tuple[float, float]]) -> float:
    """Return the weighted mean of the values that are known; NaN without any."""
    known = [(weight, value) for weight, value in weighted if math.isfinite(value)]
    total = sum(weight for weight, _ in known)
    return sum(weight * value for weight, value in known) / total if total else math.nan


class RunningMean:
    """Mean of the finite values, and the range in which it has been so far."""

    def __init__(self) -> None:
        self.value = math.nan
        self.range = UNKNOWN
        self._sum = 0.0
        self._count = 0

    def update(self, value: float) -> None:
        """Add a value; one that is not finite is ignored."""
        if math.isfinite(value):
            self._sum += value
            self._count += 1
            self.value = mean = self._sum / self._count
            low, high = self.range
            self.range = (low if low <= mean else mean, high if high >= mean else mean)  # NaN is neither


# --------------------
# Cut windows from the sliding part of tactile streams, as soon as the last sample of each is there.

# For how long a slide that is over waits for its last samples; the explorer's `estimate_timeout_s` must be longer.
LATE_SAMPLES_S = 0.3
DROPPED_S = 1.0  # an input that is silent for so long while others come is reported
ALL = 1 << 62


@dataclass(frozen=True)
class WindowParams:
    """How the sliding part of a signal is cut."""

    length_s: float = param(
        0.5,
        'Length of a window; longer ones give more certain decisions, later.',
        unit='s',
        low=0.005,
        high=60.0,
    )
    hop_s: float = param(
        0.1,
        'Time between the starts of two windows; a smaller one gives more estimates and costs computing time.',
        unit='s',
        low=0.001,
        high=60.0,
    )
    skip_s: float = param(
        0.0, 'Time at the start of a slide that is excluded from windows.', unit='s', low=0.0, high=60.0
    )


@dataclass(frozen=True, eq=False)
class CutWindow:
    """One window of sliding in every input, complete and finite.

    `skipped` counts the windows of this slide left out so far for lost or non-finite samples.
    """

    start_ns: int
    exploration_id: str
    length_s: float
    hop_s: float
    windows: Mapping[str, Window]
    speed_m_s: float = math.nan
    force_n: float = math.nan
    surface: str = ''
    skipped: int = 0
    motion: str = ''
    direction_rad: float = math.nan
    tangential_force_n: float = math.nan


@dataclass(frozen=True)
class SlideEnd:
    """No further window of this slide follows; `end_ns` is the end of its covered time."""

    end_ns: int
    exploration_id: str
    hop_s: float
    surface: str = ''
    skipped: int = 0


WindowEvent = CutWindow | SlideEnd


class WindowCutter:
    """Turn signal batches and exploration states into windows, in whatever order they arrive.

    What is cut depends on the data alone, as long as signals and states arrive with a difference of at most `keep_s`.
    """

    def __init__(self, params: WindowParams, inputs: Sequence[str], keep_s: float = 10.0) -> None:
        self._params = params
        self._inputs = {topic: BufferedStream(keep_s) for topic in dict.fromkeys(map(topic_of, inputs))}
        self._joiner = AxisJoiner(inputs)
        self._unpaired = 0
        self._slides: deque[SlideCoverage] = deque()
        self._ready = False
        self._windows = 0
        self._skipped = 0
        self._old_states = 0

    def add_signal(self, topic: str, signal: TactileSignal) -> None:
        """Add a batch; batches of one topic come in the order in which they were sampled."""
        source = self._inputs.get(topic)
        if source is None or not len(signal.samples):
            return
        if source.add(signal):
            for slide in self._slides:
                slide.given_up |= slide.ended or slide.start_ns > signal.end_ns
        source.received = self._ready = True

    def add_state(self, state: ExplorationState) -> None:
        """Add a state; states come in the order in which they were published."""
        self._ready = True
        slide = self._slides[-1] if self._slides and not self._slides[-1].ended else None
        if state.phase is Phase.SLIDE and slide and slide.exploration_id == state.exploration_id:
            self._old_states += not slide.add(state)
            return
        if slide:
            slide.ended = True
        if state.phase is Phase.SLIDE:
            length_s, hop_s, skip_s = self._params.length_s, self._params.hop_s, self._params.skip_s
            self._slides.append(SlideCoverage(state, _to_ns(length_s), _to_ns(hop_s), _to_ns(skip_s)))

    def take(self) -> list[WindowEvent]:
        """Return the windows completed since the last call, and the end of each slide that is over."""
        if not self._ready:
            return []
        self._ready = False
        events: list[WindowEvent] = []
        while self._slides and self._cut(self._slides[0], events):
            events.append(self._end_slide())
        return events

    def time_out(self, now_s: float) -> list[WindowEvent]:
        """Return what `take` returns, and the ends of slides that are over whose samples have not come for 0.3 s.

        Call it some times a second with any clock that runs on.
        """
        events = self.take()
        for source in self._inputs.values():
            if source.received or math.isnan(source.received_s):
                source.received, source.received_s = False, now_s
        silent = any(now_s - source.received_s >= LATE_SAMPLES_S for source in self._inputs.values())
        return events + (self._give_up() if silent else [])

    def finish(self) -> list[WindowEvent]:
        """Return what is left of a recording, and the ends of all its slides, without waiting for more."""
        if self._slides:
            self._slides[-1].ended = True
        self._ready = True
        return self.take() + self._give_up()

    @property
    def waiting_for(self) -> tuple[str, ...]:
        """Inputs without any message yet."""
        return tuple(topic for topic, source in self._inputs.items() if not source.buffers)

    def dropped(self, now_s: float) -> tuple[str, ...]:
        """Return the inputs that came once and are silent while another still comes, by the clock of `time_out`."""
        ages_s = {
            topic: 0.0 if source.received else now_s - source.received_s
            for topic, source in self._inputs.items()
            if source.buffers
        }
        fresh = any(age_s < DROPPED_S for age_s in ages_s.values())
        return tuple(topic for topic, age_s in ages_s.items() if fresh and age_s >= DROPPED_S)

    @property
    def counts(self) -> dict[str, int]:
        """Running totals: windows cut, skipped, without a partner; lost samples, restarts, states out of order."""
        streams = self._inputs.values()
        return {
            'windows': self._windows,
            'skipped': self._skipped,
            'unpaired': self._unpaired,
            'lost_samples': sum(stream.lost_samples for stream in streams),
            'restarts': sum(stream.restarts for stream in streams),
            'old_states': self._old_states,
        }

    def _cut(self, slide: SlideCoverage, events: list[WindowEvent]) -> bool:
        """Cut what can be cut of a slide; return whether it is used up."""
        while span := slide.window():
            found = ALL if slide.given_up else self._find(slide, span)
            if found == 0:
                return False
            if isinstance(found, int):
                self._skip(slide, found)
                continue
            slide.advance()
            window = CutWindow(
                start_ns=span.start_ns,
                exploration_id=slide.exploration_id,
                length_s=self._params.length_s,
                hop_s=self._params.hop_s,
                windows=found,
                speed_m_s=span.speed_m_s,
                force_n=span.force_n,
                surface=slide.surface,
                skipped=slide.skipped,
                motion=slide.motion,
                direction_rad=span.direction_rad,
                tangential_force_n=span.tangential_force_n,
            )
            event = self._joiner.add(window) if self._joiner.joins else window
            if event is not None:
                self._windows += 1
                events.append(event)
        return slide.ended or slide.given_up

    def _find(self, slide: SlideCoverage, span: CoveredSpan) -> dict[str, Window] | int:
        """Return a window, or how many from this one on are lost; 0 if samples have not come yet."""
        windows = {}
        for topic, source in self._inputs.items():
            found = self._find_in(source, slide, span)
            if isinstance(found, int):
                return found
            windows[topic] = found
        return windows

    def _find_in(self, source: BufferedStream, slide: SlideCoverage, span: CoveredSpan) -> Window | int:
        """Look for a window in the runs of a stream; only the newest can still grow."""
        lost = 0
        for buffer in source.buffers:
            anchor = source.anchors.get(buffer) or buffer.anchor(slide.start_ns)
            if anchor is None:
                lost = 0
                continue
            source.anchors[buffer] = anchor
            first = buffer.index_at(span.start_ns, anchor)
            count = max(1, round(self._params.length_s * buffer.rate_hz))
            if first >= buffer.first_sample and first + count <= buffer.next_sample:
                samples = buffer.take(first, count)
                if not np.isfinite(samples).all():
                    return 1
                rate_hz, names, sensor = buffer.rate_hz, buffer.channels, buffer.sensor
                return Window(samples, rate_hz, names, span.start_ns, span.speed_m_s, span.force_n, sensor)
            # What begins before the first sample is lost: a gap of an hour is passed over at once.
            missing_s = (buffer.first_sample - first - 1) / buffer.rate_hz
            lost = 0 if first >= buffer.first_sample else min(lost or ALL, max(1, int(missing_s / self._params.hop_s)))
        return lost

    def _skip(self, slide: SlideCoverage, count: int) -> None:
        skipped = slide.advance(count)
        slide.skipped += skipped
        self._skipped += skipped

    def _end_slide(self) -> SlideEnd:
        slide = self._slides.popleft()
        self._unpaired += self._joiner.end()
        for source in self._inputs.values():
            source.anchors.clear()
        return SlideEnd(slide.covered_ns, slide.exploration_id, self._params.hop_s, slide.surface, slide.skipped)

    def _give_up(self) -> list[WindowEvent]:
        """End the slides that are over without the samples that have not come."""
        events: list[WindowEvent] = []
        while self._slides and self._slides[0].ended:
            while self._slides[0].window():
                self._skip(self._slides[0], ALL)
            events.append(self._end_slide())
            self._ready = True
            events += self.take()
        return events


def cut_recording(
    signals: Mapping[str, Iterable[TactileSignal]],
    states: Iterable[ExplorationState],
    params: WindowParams,
    inputs: Sequence[str] = (),
) -> Iterator[WindowEvent]:
    """Yield the windows of a recording.

    Parameters
    ----------
    signals
        The batches of each topic, in their order.
    states
        The exploration states, in their order.
    params
        Length and hop of the windows.
    inputs
        What each window holds, as for `WindowCutter`; () for every topic of `signals`.

    Yields
    ------
    CutWindow or SlideEnd
        In the order of time; the end of each slide comes after its windows.
    """
    cutter = WindowCutter(params, inputs or tuple(signals))
    tracks = [_calls(cutter.add_state, states)]
    tracks += [_calls(partial(cutter.add_signal, topic), batches) for topic, batches in signals.items()]
    for _, add, item in heapq.merge(*tracks, key=itemgetter(0)):
        add(item)
        yield from cutter.take()
    yield from cutter.finish()


def _calls(add: Callable[[Any], None], items: Iterable[Any]) -> Iterator[tuple[int, Callable[[Any], None], Any]]:
    return ((item.stamp_ns, add, item) for item in items)


def _to_ns(seconds: float) -> int:
    return round(seconds * NANOSECONDS)

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Messages of any type made into signals, by a mapping file. Needs no ROS: any objects with the attributes will do."""

from __future__ import annotations

import operator
import re
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from texture_core.config import find_file, from_mapping, load_yaml, param
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import NANOSECONDS, Array, TactileSignal
from texture_drivers.timing import RATE_TOLERANCE, ArrivalNumbering, SampleCounter, StreamClock, rounded_rate

# --------------------
# The mapping file: which fields of which messages become which signal.

ENCODINGS = {'': '', 'int16': '<i2', 'int32': '<i4', 'float32': '<f4'}
TYPE = re.compile(r'\w+/msg/\w+')


@dataclass(frozen=True)
class SignalMapping:
    """Where the numbers of one published signal come from."""

    topic: str = param('', 'Topic that is subscribed.')
    type: str = param('', 'Type of its messages, written as package/msg/Type.')
    values: list[str] = param(  # noqa: RUF009 – it gives a field
        [], 'Paths of the fields that hold the numbers, such as data[0].value, pillars[*].fx, or fingers[id=2].counts.'
    )
    channels: list[str] = param(  # noqa: RUF009 – it gives a field
        [], 'Names of the channels; none numbers those of the first message.'
    )
    units: list[str] = param(  # noqa: RUF009 – it gives a field
        [], 'Unit of each channel, or one unit of all; none leaves them unknown.'
    )
    gain: float = param(1.0, 'Factor by which the numbers are multiplied; it is signed.')
    rate_hz: float = param(
        0.0,
        'Samples of a channel in a second, published once 2 s of messages agree with it; 0 measures it in 2 s '
        'of even messages, to a whole hertz from 100 Hz on. Set it for training.',
        unit='Hz',
        low=0.0,
        high=1e6,
    )
    consecutive: bool = param(False, 'Reads the numbers of a message as consecutive samples, not as one.')
    encoding: str = param(
        '', 'How the numbers are packed in a field of bytes; none takes them as they are.', choices=tuple(ENCODINGS)
    )
    stamp: str = param('', 'Path of the time of the last sample; none takes the time at which a message was sent.')
    stamp_after_s: float = param(0.0, 'How much later than the last sample that time is.', unit='s', low=-1.0, high=1.0)
    number: str = param('', 'Path of the sample number, which shows losses exactly; none estimates them by time.')
    number_topic: str = param('', 'Topic of that number, if it is sent in a separate message after the sample.')
    number_type: str = param('', 'Type of the messages on that topic.')
    sensor: str = param('', "Name of the sensor in the signal; none takes the mapping's name.")

    def __post_init__(self) -> None:
        for name, needed in (('topic', self.topic), ('type', self.type), ('values', self.values)):
            if not needed:
                raise InvalidParameter(f"'{name}' is missing; name it")
        for kind in filter(None, (self.type, self.number_type)):
            if not TYPE.fullmatch(kind):
                raise InvalidParameter(f"type '{kind}' is unknown; write it as package/msg/Type")
        if bool(self.number_topic) != bool(self.number_type) or (self.number_topic and not self.number):
            raise InvalidParameter("'number', 'number_topic' and 'number_type' belong together; name all three")
        if self.number and self.consecutive:
            raise InvalidParameter("'number' counts single samples; leave it out where messages hold consecutive ones")
        if len(self.units) > 1 and len(self.units) != len(self.channels):
            raise InvalidParameter(f'{len(self.units)} units came for {len(self.channels)} channels; name one or each')


@dataclass(frozen=True)
class AdaptorMapping:
    """The signals that are made of the messages of one driver."""

    about: str = param('', 'What the mapping is for.')
    signals: Mapping[str, SignalMapping] = field(default_factory=dict)


def load_mapping(name_or_path: str, finger: int = 0) -> AdaptorMapping:
    """Return a mapping that is shipped or written by a user, with {finger} and {place} filled in."""
    path = find_file(name_or_path, 'texture_drivers', 'config/adaptors', 'mapping')
    content = _filled(load_yaml(path, 'mapping'), {'{finger}': str(finger), '{place}': str(finger + 1)})
    mapping = from_mapping(AdaptorMapping, content, f"mapping '{path.stem}'")
    if not mapping.signals:
        raise InvalidParameter(f"mapping '{path.stem}' has no signals; name at least one")
    return mapping


def _filled(content: Any, values: Mapping[str, str]) -> Any:
    """Return a tree with placeholders in its texts replaced."""
    if isinstance(content, Mapping):
        return {name: _filled(part, values) for name, part in content.items()}
    if isinstance(content, list):
        return [_filled(part, values) for part in content]
    if isinstance(content, str):
        for name, value in values.items():
            content = content.replace(name, value)
    return content


# --------------------
# Field paths: a.b[0].c, a[*].b for all elements, a[id=2].b for the element whose field id is 2.

STEP = re.compile(r'(\w+)|\[(\d+|\*)\]|\[(\w+)=(-?\d+)\]')


def compile_path(path: str) -> Callable[[Any], list[Any]]:
    """Return what reads the fields at a path of a message, as a list."""
    steps, at = [], 0
    while at < len(path):
        at += path.startswith('.', at) and at > 0
        match = STEP.match(path, at)
        if match is None:
            raise InvalidParameter(f"path '{path}' is unreadable from '{path[at:]}' on; write it as a.b[0].c")
        steps.append(_step(*match.groups()))
        at = match.end()

    def read(message: Any) -> list[Any]:
        found = [message]
        try:
            for step in steps:
                found = [part for one in found for part in step(one)]
        except (AttributeError, IndexError, TypeError) as error:
            raise InvalidData(f"the message has no field '{path}': {error}; correct the mapping or its type") from error
        if not found:
            raise InvalidData(
                f"the message holds nothing at '{path}'; check the finger and the connection of the sensor"
            )
        return found

    return read


def _step(name: str | None, index: str | None, key: str | None, value: str | None) -> Callable[[Any], Iterable[Any]]:
    if name is not None:
        return lambda one: (getattr(one, name),)
    if key is not None and value is not None:
        return lambda one: [part for part in one if getattr(part, key) == int(value)]
    if index == '*':
        return iter
    return lambda one: (one[int(index or 0)],)


def read_time_ns(stamp: Any) -> int:
    """Return the time in a stamp of a header, or in seconds since 1970; InvalidData where it is 0."""
    time_ns = stamp.sec * NANOSECONDS + stamp.nanosec if hasattr(stamp, 'sec') else round(stamp * NANOSECONDS)
    if time_ns <= 0:
        raise InvalidData('the stamp of the message is 0; leave `stamp` out of the mapping to take the time of sending')
    return int(time_ns)


# --------------------
# The rate of messages, by their times.

MEASURED_S = 2.0
LEAST_MESSAGES = 20
# No node takes more messages in the time that passes: of more the times do not advance.
MOST_AT_ONCE = 1000
MOST_HZ = 10_000
MOST_OFF = 0.25  # of a period: what is farther off a whole number of periods does not fit
LEAST_FITTING = 0.75  # of the messages: of those that come in bursts or at random fewer fit
LEAST_RECEIVED = 0.5  # of the periods: beyond, a period cannot be told from several
MOST_AHEAD_S = 0.25  # of samples beyond their time: a driver that was held up has sent what it held by then
UNEVEN_TOLERANCE = 0.25  # of a rate that is no more than the mean over 2 s of uneven messages


class PeriodMeter:
    """Measure the rate of messages in stretches of 2 s, whatever is lost between them.

    The period is the mean of the differences of the times that are near their median. A message fits if it comes a
    whole number of periods after the last one that fitted. The rate is certain if all messages hold equally many
    samples, three of four fit, and at least half of the periods have one.
    """

    def __init__(self) -> None:
        self.missing = 0.0  # fraction of the messages of the last certain stretch that did not come
        self.sample_ns = 0.0  # median time from a sample to the next one in the last stretch
        self._messages: list[tuple[int, int]] = []  # of this stretch: samples and time, ns
        self._after_first = 0  # samples of the stretch, without the first message

    def add(self, samples: int, at_ns: int, known_hz: float = 0.0) -> tuple[float, bool] | None:
        """Add a message; after a stretch return rate, Hz, and whether it is certain; 0 if the times do not advance.

        A stretch ends early if its samples are far ahead of their time at a known rate.
        """
        if self._messages and at_ns < self._messages[0][1]:  # the clock was set back
            self._messages = []
        self._after_first = self._after_first + samples if self._messages else 0
        self._messages.append((samples, at_ns))
        elapsed_ns = at_ns - self._messages[0][1]
        if known_hz and self._after_first / known_hz - elapsed_ns / NANOSECONDS > MOST_AHEAD_S:
            self._messages = []
            return self._after_first * NANOSECONDS / (elapsed_ns or 1), True
        if len(self._messages) > MOST_AT_ONCE + MOST_HZ * elapsed_ns / NANOSECONDS:
            self._messages = []
            return 0.0, False
        if elapsed_ns < MEASURED_S * NANOSECONDS or len(self._messages) < LEAST_MESSAGES:
            return None
        messages, self._messages = self._messages, []
        counts, times_ns = np.array(messages).T
        average_hz = counts[1:].sum() * NANOSECONDS / elapsed_ns
        steps_ns = np.diff(times_ns)
        self.sample_ns = float(np.median(steps_ns / counts[1:]))
        near = abs(steps_ns - np.median(steps_ns)) < MOST_OFF * np.median(steps_ns)
        if not near.any() or counts.min() != counts.max():
            return average_hz, False
        period_ns = steps_ns[near].mean()
        last_ns, periods, fitting = times_ns[0], 0, 0
        for time_ns in times_ns[1:]:
            steps = (time_ns - last_ns) / period_ns
            if steps > MOST_OFF and abs(steps - round(steps)) < MOST_OFF:
                last_ns, periods, fitting = time_ns, periods + round(steps), fitting + 1
        if fitting < max(LEAST_FITTING * len(steps_ns), LEAST_RECEIVED * periods):
            return average_hz, False
        self.missing = 1.0 - fitting / periods
        return counts[0] * periods * NANOSECONDS / (last_ns - times_ns[0]), True


# --------------------
# One signal: its messages become numbered, timed batches.

LATE_S = 0.015  # stamps jitter by some ms; what is later than that, and than half a message, has gaps before it
MAX_WAITING = 50  # samples that wait for their number; more, and the number is taken as lost
SILENCE_NS = NANOSECONDS // 2  # after it another driver may send, or a number of 16 bits have wrapped unseen
SHORTEST_BLOCK_S = 0.007  # of samples without number and stamp: what is late by less than 10 ms is no loss
MOST_NUMBERS = 100_000  # in a message; more is no tactile signal


class Sample(NamedTuple):
    """What one message holds."""

    rows: Array
    end_ns: int
    sent_ns: int
    number: int | None = None


class SignalAdaptor:
    """Make the messages of one topic into batches: with a number losses are exact, else they are estimated by time."""

    def __init__(self, name: str, mapping: SignalMapping, frame_id: str = '') -> None:
        self.mapping = mapping
        self.samples = self.lost = self.refused = self.invalid = self.unnumbered = self.unpaired = 0
        self.rate_hz = mapping.rate_hz  # 0 until it has been measured
        self.measured = False  # whether the messages agree with the rate; until then no sample is published
        self.fault = ''  # what is wrong with the rate
        self._sensor, self._frame_id = mapping.sensor or name, frame_id
        self._channels = tuple(mapping.channels)
        self._values = [compile_path(path) for path in mapping.values]
        self._stamp = compile_path(mapping.stamp) if mapping.stamp else None
        self._number = compile_path(mapping.number) if mapping.number else None
        self._meter = PeriodMeter()
        self._samples: deque[Sample] = deque()  # that wait for their number
        self._numbers: deque[tuple[int, int]] = deque()  # and when they were sent
        self._ready: list[Sample] = []
        self._placed: list[tuple[int, Array]] = []
        self._last_number: int | None = None
        self._came_ns = 0  # time of the newest message
        self._after_silence = False  # whether it came after a silence
        self._known = bool(mapping.rate_hz)  # whether there is a rate with which messages are compared
        self._start()

    def take(self, message: Any, sent_ns: int) -> None:
        """Take a message; InvalidData, and counted, if it does not fit the mapping."""
        try:
            sample = self._read(message, sent_ns)
        except InvalidData:
            self.refused += 1
            raise
        self._measure(len(sample.rows), sample.end_ns)
        if not self.measured:
            return
        if self.mapping.number_topic:
            self._samples.append(sample)
        elif self._number is not None:
            self._ready.append(sample)
        else:
            self._place(sample)

    def take_number(self, message: Any, sent_ns: int) -> None:
        """Take a message with the number of a sample; InvalidData, and counted, if it does not fit."""
        try:
            number = self._read_number(message)
        except InvalidData:
            self.refused += 1
            raise
        if not self.measured:
            return
        self._numbers.append((number, sent_ns))
        if len(self._numbers) > MAX_WAITING + len(self._samples):
            self._numbers.pop()
            self.unpaired += 1

    def batches(self) -> list[TactileSignal]:
        """Return what has come since the last call, in runs without gaps."""
        if self._number is not None and self.rate_hz:
            self._join_numbers()
            self._place_numbered()
        placed, self._placed = self._placed, []
        runs: list[tuple[int, list[Array]]] = []
        end = -1
        for first, rows in placed:
            if first != end:
                runs.append((first, []))
            runs[-1][1].append(rows)
            end = first + len(rows)
        return [self._batch(first, np.concatenate(rows)) for first, rows in runs]

    def _start(self) -> None:
        """Make clock and numbering, once the rate is known."""
        rate_hz = self.rate_hz or 1.0
        self._numbering = ArrivalNumbering(rate_hz, block_s=max(SHORTEST_BLOCK_S, 1 / rate_hz))
        self._clock = StreamClock(rate_hz) if self._stamp and not self._number else self._numbering.clock
        self._counter = SampleCounter(ticks=0)
        self._next_index, self._end_ns = 0, 0

    @property
    def missing(self) -> float:
        """Fraction of the newest messages that did not come, as far as only their times tell it."""
        return 0.0 if self.mapping.number or self.mapping.number_topic else self._meter.missing

    def _measure(self, samples: int, at_ns: int) -> None:
        """Measure the rate, anew after a silence; what is measured later is compared with it."""
        repeated, self._after_silence = self._after_silence, abs(at_ns - self._came_ns) > SILENCE_NS
        if self._after_silence:
            fault = (
                f"the times of the messages on '{self.mapping.topic}' are more than 0.5 s apart; correct `stamp` in "
                'the mapping, or let the driver send more often'
            )
            self.fault = fault if repeated else ''
            self._meter, self.measured = PeriodMeter(), False
            self._known = bool(self.mapping.rate_hz)
        self._came_ns = at_ns
        measured = self._meter.add(samples, at_ns, self.rate_hz * self.measured)
        if measured is None:
            return
        rate_hz, certain = measured
        tolerance = RATE_TOLERANCE if certain else UNEVEN_TOLERANCE
        if certain and not self._known:
            self._known = True
            if not self.rate_hz or abs(rate_hz / self.rate_hz - 1) > tolerance:
                self.rate_hz = rounded_rate(rate_hz)
                self._start()
        topic, fault = self.mapping.topic, ''
        if not rate_hz:
            fault = (
                f"the times of the messages on '{topic}' do not advance; check the clock of the driver, or leave "
                '`stamp` out of the mapping, and start the node again'
            )
        elif not self._known:
            fault = (
                f"the messages on '{topic}' come unevenly, about {rate_hz:.4g} samples a second: their rate cannot be "
                'measured; set rate_hz in the mapping'
            )
        elif abs(rate_hz / self.rate_hz - 1) > tolerance:
            if certain or rate_hz > self.rate_hz:
                advice = 'correct rate_hz in the mapping, or start the node again to measure it'
            elif abs(self._meter.sample_ns * self.rate_hz / NANOSECONDS - 1) < tolerance:
                advice = 'messages are lost, as their times show: reduce the load of the computer'
            else:
                advice = 'reduce the load of the computer if messages are lost, or correct rate_hz in the mapping'
            fault = (
                f"the messages on '{topic}' bring {rate_hz:.4g} samples a second instead of {self.rate_hz:.4g}, and "
                f'are not published; {advice}'
            )
        elif not self.measured:
            self._interrupt()
        self.fault, self.measured = fault, not fault

    def _read(self, message: Any, sent_ns: int) -> Sample:
        rows = self._rows(message)
        self.invalid += int(np.count_nonzero(~np.isfinite(rows)))
        rows[~np.isfinite(rows)] = np.nan
        end_ns = sent_ns if self._stamp is None else read_time_ns(self._stamp(message)[0])
        included = self._number is not None and not self.mapping.number_topic
        number = self._read_number(message) if included else None
        return Sample(
            rows * self.mapping.gain, end_ns - round(self.mapping.stamp_after_s * NANOSECONDS), sent_ns, number
        )

    def _rows(self, message: Any) -> Array:
        """Return the numbers of a message, (n_samples, n_channels)."""
        try:
            if self.mapping.encoding:
                packed = b''.join(bytes(part) for read in self._values for part in read(message))
                numbers = np.frombuffer(packed, ENCODINGS[self.mapping.encoding]).astype(float)
            else:
                parts = [np.ravel(np.asarray(part, dtype=float)) for read in self._values for part in read(message)]
                numbers = np.concatenate(parts)
        except (TypeError, ValueError) as error:
            raise InvalidData(f'{self.mapping.values} are not numbers: {error}; correct the mapping') from error
        if not 0 < len(numbers) <= MOST_NUMBERS:
            raise InvalidData(f'the message holds {len(numbers)} numbers; 1 to {MOST_NUMBERS} are allowed')
        if not self._channels:
            count = 1 if self.mapping.consecutive else len(numbers)
            self._channels = tuple(f'channel_{number}' for number in range(count))
        width = len(self._channels)
        if len(numbers) % width if self.mapping.consecutive else len(numbers) != width:
            raise InvalidData(
                f'the message holds {len(numbers)} numbers; {width} are needed, one for each channel of the mapping'
            )
        return numbers.reshape(-1, width)

    def _read_number(self, message: Any) -> int:
        assert self._number is not None
        try:
            return operator.index(self._number(message)[0])
        except TypeError as error:
            raise InvalidData(f"'{self.mapping.number}' is not a whole number: {error}; correct the mapping") from error

    # Samples with a number.

    def _join_numbers(self) -> None:
        """Give each sample the number that was sent between it and the next one."""
        while len(self._samples) > 1:
            first, following = self._samples[0], self._samples[1]
            if not (self._numbers and self._numbers[-1][1] >= first.sent_ns) and len(self._samples) <= MAX_WAITING:
                return
            self._samples.popleft()
            number = None
            while self._numbers and self._numbers[0][1] < following.sent_ns:
                value, sent_ns = self._numbers.popleft()
                if number is None and sent_ns >= first.sent_ns:
                    number = value
                else:
                    self.unpaired += 1
            self.unnumbered += number is None
            self._ready.append(first._replace(number=number))

    def _place_numbered(self) -> None:
        """Place the samples that have a number; one that is repeated is no new sample."""
        fresh = []
        for sample in self._ready:
            if sample.number is None or sample.number != self._last_number:
                fresh.append(sample)
            self._last_number = sample.number
        if fresh and self._end_ns and fresh[-1].end_ns - self._end_ns > SILENCE_NS:
            self._interrupt()
        self._ready = []
        indices, restarted = self._counter.place([sample.number for sample in fresh])
        placed, self._ready = fresh[: len(indices)], fresh[len(indices) :]
        if self._ready:
            self._last_number = None if not placed else placed[-1].number
        if placed:
            self._end_ns = placed[-1].end_ns
            counted = any(sample.number is not None for sample in placed)
            skipped = self._numbering.missing(indices[-1], self._end_ns, counted=counted)
            self._counter.skip(skipped)
            if self._clock.settled:
                self._placed += [(index + skipped, sample.rows) for index, sample in zip(indices, placed, strict=True)]
        self.lost = self._counter.lost
        if restarted:
            self._interrupt()

    def _interrupt(self) -> None:
        self._numbering.interrupt()
        self._counter.interrupt()
        if self._clock is not self._numbering.clock:
            self._clock.restart()

    # Samples without one.

    def _place(self, sample: Sample) -> None:
        """Place the samples of a message by its stamp, or by when it was sent."""
        count = len(sample.rows)
        if self._stamp is None:
            before = self._numbering.next_index
            indices = self._numbering.place([(0, count)], sample.end_ns)
            self.lost += self._numbering.next_index - before - count
            if indices:
                self._placed.append((indices[0], sample.rows))
            return
        length_ns = count / self.rate_hz * NANOSECONDS
        late_ns = sample.end_ns - self._end_ns - length_ns if self._end_ns else 0.0
        if late_ns > max(LATE_S * NANOSECONDS, length_ns / 2):
            missing = round(late_ns / NANOSECONDS * self.rate_hz)
            self.lost += missing
            self._next_index += missing
        self._end_ns = sample.end_ns
        first, self._next_index = self._next_index, self._next_index + count
        self._clock.observe(self._next_index - 1, sample.end_ns)
        if self._clock.settled:
            self._placed.append((first, sample.rows))

    def _batch(self, first: int, rows: Array) -> TactileSignal:
        self.samples += len(rows)
        units = tuple(self.mapping.units) * (len(self._channels) if len(self.mapping.units) == 1 else 1)
        return TactileSignal(
            self._clock.time_ns(first), self._sensor, self._channels, units, self.rate_hz, first,
            rows.astype(np.float32), self._frame_id,
        )  # fmt: skip

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Health of a stream: rate, dead or clipping channels, baseline, and the status on /diagnostics."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.errors import InvalidData
from texture_core.types import NANOSECONDS, Array, TactileSignal
from texture_drivers.sensor import SensorReader

# --------------------
# Level of each channel without load: measured by a tare, published, subtracted if wanted, and watched for drift.

# A tare is refused if the two halves of it differ by more than this many standard deviations of the samples; the mean
# of a half is right to a small part of one.
MOST_MOVED = 3.0
LEAST_SAMPLES = 4
RELATIVE_FLOOR = 1e-4  # smallest noise of a channel, as a fraction of its baseline: some have none


@dataclass(frozen=True, eq=False)
class Baseline:
    """What a stream measures without load."""

    level: Array
    noise: Array
    stamp_ns: int
    stream: TactileSignal

    def subtract_from(self, batch: TactileSignal) -> TactileSignal:
        """Return a batch without the baseline; it is marked as tared."""
        samples = (batch.samples - self.level).astype(np.float32)
        return replace(batch, samples=samples, tared=True)

    def drift(self, level: Array) -> Array:
        """Return by how many standard deviations of the noise a level differs from the baseline."""
        floor = np.maximum(RELATIVE_FLOOR * np.abs(self.level), np.median(self.noise))
        return np.abs(level - self.level) / np.maximum(np.maximum(self.noise, floor), np.finfo(float).tiny)

    def as_signal(self) -> TactileSignal:
        """Return the baseline as a batch of one sample."""
        return replace(self.stream, stamp_ns=self.stamp_ns, first_sample=0, samples=self.level[None].astype(np.float32))


class Tare:
    """Collect the samples of a stream until its baseline is known."""

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._batches: list[TactileSignal] = []

    def add(self, batch: TactileSignal) -> Baseline | None:
        """Take a batch; return the baseline when the last one has come."""
        self._batches.append(batch)
        first = self._batches[0]
        if batch.end_ns < first.stamp_ns + self._duration_s * NANOSECONDS:
            return None
        samples = np.concatenate([batch.samples for batch in self._batches]).astype(np.float64)
        if len(samples) < LEAST_SAMPLES or np.isnan(samples).all(axis=0).any():
            raise InvalidData(
                f"tare of '{first.sensor}': {len(samples)} samples came, or a channel without any valid one; "
                'check the sensor, or tare for longer'
            )
        halves = np.array_split(samples, 2)
        begun, ended = (np.nanmean(half, axis=0) for half in halves)
        noise = np.sqrt(np.mean([np.nanvar(half, axis=0) for half in halves], axis=0))
        moved = np.abs(ended - begun) > MOST_MOVED * np.maximum(noise, RELATIVE_FLOOR * np.abs(begun)) + 1e-12
        if moved.any():
            names = ', '.join(name for name, has in zip(first.channels, moved, strict=True) if has)
            raise InvalidData(
                f"tare of '{first.sensor}': the level of {names} moved meanwhile; let nothing touch the finger and "
                'tare again'
            )
        return Baseline(np.nanmean(samples, axis=0), noise, first.stamp_ns, first)


def saturated(
    samples: NDArray[np.float32], lowest: Array, highest: Array, least_fraction: float = 0.01
) -> NDArray[np.bool_]:
    """Return which channels are at an end of their range in more than a fraction of the samples."""
    at_end = (samples <= lowest) | (samples >= highest)
    return at_end.mean(axis=0) > least_fraction


# --------------------
# Watch the baseline of the channels of one stream.

DEAD_S = 30.0  # a channel that has not changed for so long, while most of its stream has, is dead
MOST_KEPT_S = 5.0  # of samples between two reviews


NAMED = 3  # channels in a sentence
# Of an unloaded channel, in standard deviations of its noise: farther off is a drift.
DRIFT_LIMIT = 10.0
DRIFT_REVIEWS = 3  # consecutive reviews that show a drift: one may be a touch


Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class TareParams:
    """How the level without load is measured and used."""

    tare_s: float = param(1.0, "Averaging time of the service '~/tare'.", unit='s', low=0.1, high=60.0)
    subtract_baseline: bool = param(
        False,
        'Subtracts the baseline from the published samples once the sensor has been tared; a model needs the setting '
        'of its training.',
    )


class StreamWatch:
    """Watch one stream."""

    def __init__(self, limits: tuple[Any, Any] | None) -> None:
        self.baseline: Baseline | None = None
        self.drift = 0.0  # largest of all channels, in standard deviations of their noise
        self._limits = limits
        self._tare: Tare | None = None
        self._batches: list[TactileSignal] = []
        self._last: NDArray[np.float32] | None = None  # newest valid sample of each channel
        self._still_s: Array = np.zeros(0)  # for how long each channel has not changed
        self._drifts = 0

    @property
    def taring(self) -> bool:
        """Whether a tare is in progress."""
        return self._tare is not None

    def start_tare(self, tare: Tare | None) -> None:
        """Tare from the next batch on; None ends what is in progress."""
        self._tare = tare

    def add(self, batch: TactileSignal) -> bool:
        """Take a batch; return whether it has completed a baseline. InvalidData if the tare is refused."""
        if len(self._batches) * len(batch.samples) < MOST_KEPT_S * batch.sampling_rate_hz:
            self._batches.append(batch)
        tare, self._tare = self._tare, None  # unless it continues
        found = tare.add(batch) if tare else None
        if found is None:
            self._tare = tare
            return False
        self.baseline, self.drift, self._drifts = found, 0.0, 0
        return True

    def review(self, elapsed_s: float, unloaded: bool | None) -> list[str]:
        """Return sentences on what is wrong with the samples since the last review."""
        batches, self._batches = self._batches, []
        if not batches or len({batch.channels for batch in batches}) > 1:
            return []
        samples = np.concatenate([batch.samples for batch in batches])
        channels = batches[0].channels
        faults = []
        if self._limits is not None:
            faults += _named(saturated(samples, *self._limits), channels, 'is saturated: less force, or another gain')
        faults += _named(self._dead(samples, elapsed_s), channels, 'is dead: it does not change; check its wiring')
        if unloaded and self.baseline is not None:
            faults += self._drift_faults(samples, channels)
        return faults

    def _dead(self, samples: NDArray[np.float32], elapsed_s: float) -> Flags:
        """Return which channels hold no valid sample, or have not changed for long while most of the stream has."""
        invalid = np.isnan(samples).all(axis=0)
        if len(self._still_s) != samples.shape[1]:
            self._still_s, self._last = np.zeros(samples.shape[1]), samples[0]
        changed = (samples != self._last).any(axis=0)
        self._last = samples[-1]
        self._still_s = np.where(changed, 0.0, self._still_s + elapsed_s)
        still: Flags = self._still_s >= DEAD_S
        return invalid | (still & (2 * still.sum() < len(still)))

    def _drift_faults(self, samples: NDArray[np.float32], channels: Sequence[str]) -> list[str]:
        assert self.baseline is not None
        drifts = self.baseline.drift(np.nanmean(samples, axis=0))
        self.drift = float(np.nanmax(drifts))
        self._drifts = self._drifts + 1 if self.drift > DRIFT_LIMIT else 0
        if self._drifts < DRIFT_REVIEWS:
            return []
        return _named(drifts > DRIFT_LIMIT, channels, 'has drifted off its baseline; tare again without load')


def _named(found: Flags, channels: Sequence[str], what: str) -> list[str]:
    """Return a sentence on the channels that were found; none if there are none."""
    names = [name for name, has in zip(channels, found, strict=True) if has]
    if not names:
        return []
    more = f' and {len(names) - NAMED} more' if len(names) > NAMED else ''
    return [f'{", ".join(names[:NAMED])}{more} {what}']


# --------------------
# Watch every stream of a sensor: its baseline, how far it has drifted, channels that saturate or are dead.

Limits = Mapping[str, tuple[Any, Any]]  # by topic: lowest and highest sample, of all channels or of each


class ChannelWatch:
    """Watch all streams of a sensor. Batches come from the thread that reads it, reviews are called from another."""

    def __init__(self, params: TareParams, topics: Sequence[str], limits: Limits) -> None:
        self.unloaded: bool | None = None  # whether nothing touches the finger; None if unknown
        self.refusal = ''  # why the last tare was refused
        self._params = params
        self._streams = {topic: StreamWatch(limits.get(topic)) for topic in topics}
        self._lock = threading.Lock()

    @property
    def taring(self) -> bool:
        """Whether a tare is in progress."""
        with self._lock:
            return any(stream.taring for stream in self._streams.values())

    @property
    def baselines(self) -> Mapping[str, Baseline | None]:
        """The newest baseline by topic; None before the first tare."""
        return {topic: stream.baseline for topic, stream in self._streams.items()}

    def start_tare(self) -> None:
        """Measure the baseline of every stream from now on."""
        with self._lock:
            self.refusal = ''
            for stream in self._streams.values():
                stream.start_tare(Tare(self._params.tare_s))

    def end_tare(self, why: str) -> None:
        """Refuse the tare of every stream that is still in progress."""
        with self._lock:
            for stream in self._streams.values():
                if stream.taring:
                    self.refusal = why
                    stream.start_tare(None)

    def add(self, topic: str, batch: TactileSignal) -> tuple[TactileSignal, Baseline | None]:
        """Take a batch; return what is to be published of it, and the baseline if it has just become known."""
        stream = self._streams[topic]
        with self._lock:
            try:
                completed = stream.add(batch)
            except InvalidData as error:
                self.refusal, completed = str(error), False
            baseline = stream.baseline
        published = batch
        if self._params.subtract_baseline and baseline is not None:
            published = baseline.subtract_from(batch)
        return published, baseline if completed else None

    def review(self, elapsed_s: float) -> tuple[list[str], Mapping[str, Any]]:
        """Return sentences on what is wrong with channels since the last review, and numbers for the diagnostics."""
        with self._lock:
            faults = [self.refusal] if self.refusal else []
            for topic, stream in self._streams.items():
                found = stream.review(elapsed_s, self.unloaded)
                faults += [f'{topic}: {sentence}' for sentence in found]
            return faults, self._numbers()

    def _numbers(self) -> dict[str, Any]:
        numbers: dict[str, Any] = {}
        for topic, stream in self._streams.items():
            numbers[f'{topic} tared'] = stream.baseline is not None
            if stream.baseline is not None:
                numbers[f'{topic} drift [noise]'] = stream.drift
        return numbers


# --------------------
# Assess the health of a sensor from the counts of its reader.

NO_SAMPLE_TIMEOUT_S = 1.0  # ERROR: no sample for so long
RATE_TOLERANCE = 0.05  # WARN: a rate this far off
MAX_BAD_PACKETS_PER_S = 5.0  # WARN: a damaged line; single refusals come with every opening

HealthReport = tuple[str, str, Mapping[str, Any]]
# A restarted driver numbers from 0: what its stream lost before is unknown, above all at high rates.
BEFORE_THE_START = {'lost before the start': 'unknown'}
# A restarted bridge also numbers from 0: what was lost in between is estimated by time, to about a packet.
INTERRUPTIONS = ('device restarts', 'reopened')
AT_INTERRUPTIONS = {'lost at restarts': 'estimated by time; less than a packet is unknown'}


class SensorHealth:
    """Report level, sentence and numbers on what happened since the last report.

    ERROR: the sensor cannot be reached, no sample came for 1 s, or none of a finger that came before. WARN: samples
    were lost or the sensor was opened again since the last report, a rate is more than 5 % off, more than 5 packets a
    second are refused, a channel is saturated, dead or has drifted, or a tare was refused. All that is assessed over
    the time since the last report, so the level recovers automatically.
    """

    def __init__(self, reader: SensorReader, now_s: float, watch: ChannelWatch | None = None) -> None:
        self._reader = reader
        self._watch = watch
        self._then_s = now_s
        self._published = dict(reader.published)
        self._counts = dict(reader.sensor.counts)
        self._begin_s = now_s
        self._last_samples_s: dict[str, float] = {}  # of each topic that has come

    @property
    def details(self) -> Mapping[str, Any]:
        """What the sensor reports about itself, such as its 'serial number'; optional in custom sensors."""
        return getattr(self._reader.sensor, 'details', {})

    def report(self, now_s: float) -> HealthReport:
        """Return the state at a time of a monotonic clock."""
        period_s = max(now_s - self._then_s, 1e-3)
        published, counts = dict(self._reader.published), dict(self._reader.sensor.counts)
        rates = {topic: (total - self._published[topic]) / period_s for topic, total in published.items()}
        new = {name: total - self._counts.get(name, 0) for name, total in counts.items()}
        self._last_samples_s.update((topic, now_s) for topic, rate in rates.items() if rate)
        ages_s = self._ages_s(now_s)
        age_s = min(ages_s.values(), default=now_s - self._begin_s)
        self._then_s, self._published, self._counts = now_s, published, counts
        faults, watched = self._watch.review(period_s) if self._watch else ([], {})
        numbers = {
            **{f'{topic} rate [Hz]': rate for topic, rate in rates.items()},
            **{f'{topic} expected [Hz]': rate for topic, rate in self._reader.sensor.expected_rates_hz.items()},
            **counts,
            **BEFORE_THE_START,
            **(AT_INTERRUPTIONS if any(counts.get(name, 0) > 0 for name in INTERRUPTIONS) else {}),
            'age of last sample [s]': age_s,
            **self.details,
            **watched,
        }
        dropped = [finger for finger, silent_s in ages_s.items() if silent_s > NO_SAMPLE_TIMEOUT_S]
        level, message = self._assess(rates, new, age_s, period_s, dropped)
        if level == 'OK' and faults:
            level, message = 'WARN', '; '.join(faults)
        return level, message, numbers

    def _ages_s(self, now_s: float) -> dict[str, float]:
        """Return the age of the newest sample of each finger that has come; a single one is the folder ''."""
        newest_s: dict[str, float] = {}
        for topic, last_s in self._last_samples_s.items():
            finger = topic.rpartition('/')[0]
            newest_s[finger] = max(last_s, newest_s.get(finger, last_s))
        return {finger: now_s - last_s for finger, last_s in newest_s.items()}

    def _assess(
        self, rates: Mapping[str, float], new: Mapping[str, int], age_s: float, period_s: float, dropped: Sequence[str]
    ) -> tuple[str, str]:
        expected = self._reader.sensor.expected_rates_hz
        off = [topic for topic, rate in rates.items() if abs(rate / expected[topic] - 1) > RATE_TOLERANCE]
        conditions = (
            (bool(self._reader.fault), 'ERROR', self._reader.fault),
            (age_s > NO_SAMPLE_TIMEOUT_S, 'ERROR', f'no sample for {age_s:.1f} s; check the sensor'),
            (bool(dropped), 'ERROR', f'no more samples from {" and ".join(dropped)}; check its plug'),
            (new.get('reopened', 0) > 0, 'WARN', 'the sensor was disconnected and has been opened again'),
            (new.get('lost', 0) > 0, 'WARN', f'{new.get("lost", 0)} samples lost since the last report'),
            (
                new.get('bogus', 0) > MAX_BAD_PACKETS_PER_S * period_s,
                'WARN',
                'many damaged packets; check cable and port',
            ),
            (bool(off), 'WARN', f'rate of {" and ".join(off)} is off by more than {RATE_TOLERANCE:.0%}'),
        )
        return next(((level, message) for holds, level, message in conditions if holds), ('OK', 'streaming'))

"""Assess the health of a sensor from the counts of its reader."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from texture_drivers.channel_watch import ChannelWatch
from texture_drivers.sensor_reader import SensorReader

NO_SAMPLE_TIMEOUT_S = 1.0  # ERROR: no sample for so long
RATE_TOLERANCE = 0.05  # WARN: a rate this far off
MAX_BAD_PACKETS_PER_S = 5.0  # WARN: a damaged line; single refusals come with every opening

HealthReport = tuple[str, str, Mapping[str, Any]]


class SensorHealth:
    """Report level, sentence and numbers on what happened since the last report.

    ERROR: the sensor cannot be reached, no sample came for 1 s, or none of a finger that came before. WARN: samples
    were lost or the sensor was opened again since the last report, a rate is more than 5 % off, more than 5 packets a
    second are refused, a channel is saturated, dead or has drifted, or a tare was refused. All that is assessed over
    the time since the last report, so the level falls back by itself.
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
        """What the sensor reports about itself, such as its 'serial number'; a user's own need not."""
        details: Mapping[str, Any] = getattr(self._reader.sensor, 'details', {})
        return details

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
            (
                bool(dropped),
                'ERROR',
                f'no sample comes any more of {" and ".join(dropped)}; check its plug',
            ),
            (new.get('reopened', 0) > 0, 'WARN', 'the sensor was gone and has been opened again'),
            (new.get('lost', 0) > 0, 'WARN', f'{new.get("lost", 0)} samples lost since the last report'),
            (
                new.get('bogus', 0) > MAX_BAD_PACKETS_PER_S * period_s,
                'WARN',
                'many damaged packets; check cable and port',
            ),
            (bool(off), 'WARN', f'rate of {" and ".join(off)} is off by more than {RATE_TOLERANCE:.0%}'),
        )
        return next(((level, message) for holds, level, message in conditions if holds), ('OK', 'streaming'))

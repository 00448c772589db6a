"""Accounting of samples and messages sent and received, so that every loss is noticed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

from texture_core.signal import NANOSECONDS

# What each node counts on /diagnostics; the other numbers there may fall, too.
COUNTERS: Mapping[str, tuple[str, ...]] = {
    'emulator': ('samples', 'skipped samples', 'bytes nobody took', 'refused datagrams'),
    'sensor': ('samples', 'lost', 'bogus', 'refused_bytes', 'damaged_stamps', 'reopened', 'revived', 'clock_steps'),
    'feature_extractor': ('windows', 'skipped', 'lost_samples', 'restarts', 'old_states', 'invalid_messages'),
    'classifier': ('estimates', 'refused_vectors', 'not_finite_vectors', 'lost_vectors', 'invalid_messages'),
    'explorer': ('done', 'aborted', 'refused', 'late_steps'),
}


class Totals:
    """Add up counters of a node over its lives: a counter that falls has begun again."""

    def __init__(self) -> None:
        self._now: dict[str, int] = {}
        self._before: Counter[str] = Counter()

    def update(self, numbers: Mapping[str, int]) -> None:
        """Take note of a report; counters of one node that fall in it tell that it was started again."""
        if any(value < self._now.get(name, value) for name, value in numbers.items()):
            self._before.update(self._now)
            self._now = {}
        self._now.update(numbers)

    @property
    def sums(self) -> dict[str, int]:
        """Sum of each counter over all lives."""
        return {name: self._before[name] + self._now.get(name, 0) for name in {**self._before, **self._now}}


class SampleAccount:
    """Compare the running index of a stream with its stamps, life by life of its driver.

    Attributes
    ----------
    samples
        That arrived.
    gaps
        That the index says were lost on the way.
    restarts
        How often the index began again: the driver was started again.
    away_s
        How long no driver ran: from the last sample of one to the first of the next.
    drift_s
        The most that index and stamps of one life disagree: what is missing in both books.
    """

    def __init__(self) -> None:
        self.samples = self.gaps = self.restarts = 0
        self.away_s = self.drift_s = 0.0
        self._first: tuple[int, int] | None = None  # index and stamp of the life
        self._next_sample = 0
        self._end_ns = 0

    def update(self, first_sample: int, count: int, stamp_ns: int, rate_hz: float) -> None:
        """Take note of a batch.

        Parameters
        ----------
        first_sample
            Running index of the first sample.
        count
            Number of samples.
        stamp_ns
            Time of the first sample.
        rate_hz
            Sampling rate.
        """
        if self._first is not None and first_sample < self._next_sample:
            self._note_restart(stamp_ns)
        if self._first is None:
            self._first = first_sample, stamp_ns
        else:
            self.gaps += first_sample - self._next_sample
        index, since_ns = self._first
        apart_s = (first_sample - index) / rate_hz - (stamp_ns - since_ns) / NANOSECONDS
        self.drift_s = max(self.drift_s, abs(apart_s))
        self.samples += count
        self._next_sample = first_sample + count
        self._end_ns = stamp_ns + round(count / rate_hz * NANOSECONDS)

    def _note_restart(self, stamp_ns: int) -> None:
        self.restarts += 1
        self.away_s += (stamp_ns - self._end_ns) / NANOSECONDS
        self._first = None


class AnswerAccount:
    """Count, by exploration, the feature vectors sent and the estimates they were answered with."""

    def __init__(self) -> None:
        self.vectors: Counter[str] = Counter()
        self.estimates: Counter[str] = Counter()

    @property
    def unanswered(self) -> dict[str, int]:
        """Vectors without an estimate, by exploration."""
        return {name: sent - self.estimates[name] for name, sent in self.vectors.items() if sent > self.estimates[name]}

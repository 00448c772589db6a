"""Whether streams of samples arrive without gaps."""

from __future__ import annotations

from collections import Counter

from texture_core.signal import TactileSignal


class Continuity:
    """Count lost samples and restarts of streams, from the running index of their batches."""

    def __init__(self) -> None:
        self.samples: Counter[str] = Counter()
        self.lost: Counter[str] = Counter()
        self.restarts: Counter[str] = Counter()
        self._next: dict[str, int] = {}

    def update(self, stream: str, signal: TactileSignal) -> None:
        """Take the next batch of a stream; an index that goes back is a restart of its driver, not a loss."""
        jump = signal.first_sample - self._next.get(stream, signal.first_sample)
        self.samples[stream] += len(signal.samples)
        self.lost[stream] += max(0, jump)
        self.restarts[stream] += jump < 0
        self._next[stream] = signal.next_sample

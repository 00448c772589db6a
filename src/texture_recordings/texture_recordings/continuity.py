"""Whether streams of samples arrive without gaps."""

from __future__ import annotations

from collections import Counter

from texture_core.signal import TactileSignal


class Continuity:
    """Count lost samples and restarts of streams, from the running index of their batches.

    Examples
    --------
    >>> import numpy as np
    >>> continuity = Continuity()
    >>> for first_sample in (0, 10, 25, 0):  # five samples are missing, then the driver was started again
    ...     samples = np.zeros((10, 1), dtype=np.float32)
    ...     continuity.update('signal', TactileSignal(0, 'finger', ('pac',), (), 1000.0, first_sample, samples))
    >>> continuity.lost['signal'], continuity.restarts['signal']
    (5, 1)
    >>> continuity.losses
    '5 samples lost, and unknown losses in 1 restart of a driver or bridge'
    """

    def __init__(self) -> None:
        self.samples: Counter[str] = Counter()
        self.lost: Counter[str] = Counter()
        self.restarts: Counter[str] = Counter()
        self._next: dict[str, int] = {}

    @property
    def losses(self) -> str:
        """What was lost, in words, '' if nothing: of a restart, which numbers anew, nobody can tell how much."""
        lost, restarts = self.lost.total(), self.restarts.total()
        unknown = f'unknown losses in {restarts} restart{"s" if restarts > 1 else ""} of a driver or bridge'
        return ', and '.join(filter(None, (f'{lost} samples lost' if lost else '', unknown if restarts else '')))

    def update(self, stream: str, signal: TactileSignal) -> None:
        """Take the next batch of a stream; an index that goes back is a restart of its driver, not a loss."""
        jump = signal.first_sample - self._next.get(stream, signal.first_sample)
        self.samples[stream] += len(signal.samples)
        self.lost[stream] += max(0, jump)
        self.restarts[stream] += jump < 0
        self._next[stream] = signal.next_sample

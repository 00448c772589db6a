"""When each message of a recording is due in a replay."""

from __future__ import annotations

from texture_core.signal import NANOSECONDS


class Schedule:
    """Turn log times, given in their order, into seconds since the replay began.

    Parameters
    ----------
    rate
        How many times faster than recorded.
    longest_pause_s
        Longer pauses between messages, such as those between two slides, are cut to this; s of the recording.

    Examples
    --------
    >>> schedule = Schedule(rate=2.0, longest_pause_s=1.0)
    >>> [schedule.due_s(second * NANOSECONDS) for second in (0, 1, 60)]  # the pause of 59 s is cut to one
    [0.0, 0.5, 1.0]
    """

    def __init__(self, rate: float, longest_pause_s: float) -> None:
        self._rate = rate
        self._longest_ns = round(longest_pause_s * NANOSECONDS)
        self._last_ns: int | None = None
        self._played_ns = 0

    def due_s(self, log_ns: int) -> float:
        """Return when the message logged at `log_ns` is due."""
        if self._last_ns is not None:
            self._played_ns += min(max(log_ns - self._last_ns, 0), self._longest_ns)
        self._last_ns = log_ns
        return self._played_ns / self._rate / NANOSECONDS

    @property
    def played_s(self) -> float:
        """Seconds of the recording up to the last message asked for, with shortened pauses."""
        return self._played_ns / NANOSECONDS

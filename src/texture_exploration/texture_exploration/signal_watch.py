"""Whether samples arrive while the finger moves: a slide without them measures nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class SignalWatchParams:
    """Whether to end an exploration when the sensor falls silent."""

    watch_signal: bool = param(True, "Aborts an exploration when no samples arrive on the topic 'signal'.")
    signal_timeout_s: float = param(
        0.5,
        'Sets how long no sample may arrive before the exploration is aborted.',
        unit='s',
        low=0.02,
        high=5.0,
    )


class SignalWatch:
    """Remember when the sensor was heard last; `on_samples` and `signal_fault` may be called from different threads.

    Parameters
    ----------
    timeout_s
        The longest silence.
    clock
        CLOCK_MONOTONIC in ns.
    """

    def __init__(self, timeout_s: float, clock: Callable[[], int]) -> None:
        self._timeout_s = timeout_s
        self._clock = clock
        self._last_samples_ns = 0

    def on_samples(self) -> None:
        """Take note that samples have come."""
        self._last_samples_ns = self._clock()

    def signal_fault(self, awake_ns: int) -> str:
        """Return in a sentence that the sensor is silent, '' if not; before `awake_ns` nobody listened."""
        age_s = (self._clock() - max(self._last_samples_ns, awake_ns)) * 1e-9
        if age_s <= self._timeout_s:
            return ''
        return (
            f"no samples have come on 'signal' for {age_s * 1e3:.0f} ms; check the sensor, or start the explorer with "
            'watch_signal:=false to move without one'
        )

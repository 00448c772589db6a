"""Whether the sensor is heard while the finger moves: sliding without it feels nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class SignalWatchParams:
    """Whether to end an exploration when the sensor falls silent."""

    watch_signal: bool = param(
        True, 'Whether an exploration is aborted, and the finger lifted, when no samples come on `signal`.'
    )
    signal_timeout_s: float = param(
        0.25,
        'Longest silence of `signal` before the abort; a longer time tolerates a busier machine.',
        unit='s',
        low=0.02,
        high=5.0,
    )


class SignalWatch:
    """Remember when the sensor was heard last; `heard` and `silence` may be called from different threads.

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
        self._heard_ns = 0

    def heard(self) -> None:
        """Take note that samples have come."""
        self._heard_ns = self._clock()

    def silence(self, awake_ns: int) -> str:
        """Return in a sentence that the sensor is silent, '' if not; before `awake_ns` nobody listened."""
        age_s = (self._clock() - max(self._heard_ns, awake_ns)) * 1e-9
        if age_s <= self._timeout_s:
            return ''
        return (
            f"no samples have come on 'signal' for {age_s * 1e3:.0f} ms; check the sensor, or start the explorer with "
            'watch_signal:=false to move without one'
        )

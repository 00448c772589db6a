"""Whether samples arrive while the finger moves: a slide without them measures nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from texture_core.errors import InvalidParameter
from texture_core.parameters import param
from texture_exploration.listening import Listening


@dataclass(frozen=True)
class SignalWatchParams:
    """Parameters that end an exploration when the sensor falls silent."""

    watch_signal: bool = param(True, "Aborts an exploration when no samples arrive on the topics of 'signal_topics'.")
    signal_topics: str = param(
        'signal',
        "Sets the topics whose samples are watched, separated by spaces: 'finger0/signal finger1/signal' for two "
        'fingers.',
    )
    signal_timeout_s: float = param(
        0.5,
        'Sets how long no sample may arrive before the exploration is aborted.',
        unit='s',
        low=0.02,
        high=5.0,
    )

    def __post_init__(self) -> None:
        if not self.topics:
            raise InvalidParameter("parameter 'signal_topics' is empty; name a topic, or set 'watch_signal' to false")

    @property
    def topics(self) -> tuple[str, ...]:
        """Each of the topics once."""
        return tuple(dict.fromkeys(self.signal_topics.split()))


class SignalWatch:
    """Remember when each stream came last; `on_samples` and `signal_fault` may be called from different threads.

    Parameters
    ----------
    timeout_s
        The longest silence.
    clock
        CLOCK_MONOTONIC in ns.
    topics
        The streams, one for each finger.

    Examples
    --------
    >>> watch = SignalWatch(0.5, lambda: 2_000_000_000, ('finger0/signal', 'finger1/signal'))
    >>> watch.on_samples('finger0/signal')
    >>> print(watch.signal_fault(Listening()).partition(';')[0])
    no samples have come on 'finger1/signal' for 2000 ms
    """

    def __init__(self, timeout_s: float, clock: Callable[[], int], topics: Sequence[str] = ('signal',)) -> None:
        self._timeout_s = timeout_s
        self._clock = clock
        self._last_samples_ns = dict.fromkeys(topics, 0)

    def on_samples(self, topic: str = 'signal') -> None:
        """Take note that samples have come."""
        self._last_samples_ns[topic] = self._clock()

    def signal_fault(self, listening: Listening) -> str:
        """Return in a sentence which streams are silent while the loop listens, '' if none is."""
        now_ns = self._clock()
        ages_s = {topic: listening.silence_s(last, now_ns) for topic, last in self._last_samples_ns.items()}
        silent = {topic: age_s for topic, age_s in ages_s.items() if age_s > self._timeout_s}
        if not silent:
            return ''
        named = ' and '.join(f"'{topic}'" for topic in silent)
        return (
            f'no samples have come on {named} for {max(silent.values()) * 1e3:.0f} ms; check the sensor, or start the '
            'explorer with watch_signal:=false to move without one'
        )

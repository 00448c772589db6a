"""Watch every stream of a sensor: its baseline, how far it has drifted, channels that saturate or are dead."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from typing import Any

from texture_core.errors import InvalidData
from texture_core.signal import TactileSignal
from texture_drivers.baseline import Baseline, Tare
from texture_drivers.stream_watch import StreamWatch, TareParams

Limits = Mapping[str, tuple[Any, Any]]  # by topic: lowest and highest sample, of all channels or of each


class ChannelWatch:
    """Watch all streams of a sensor. Batches come from the thread that reads it, reviews are asked for in another.

    Parameters
    ----------
    params
        How the level without load is measured and used.
    topics
        Of the sensor.
    limits
        Lowest and highest sample by topic, where they are known.
    """

    def __init__(self, params: TareParams, topics: Sequence[str], limits: Limits) -> None:
        self.unloaded: bool | None = None  # whether nothing touches the finger; None if nobody tells
        self.refusal = ''  # why the last tare was refused
        self._params = params
        self._streams = {topic: StreamWatch(limits.get(topic)) for topic in topics}
        self._lock = threading.Lock()

    @property
    def needs_tare(self) -> bool:
        """Whether an automatic tare is due: wanted, without load, and never done or drifted since."""
        if not self._params.auto_tare or not self.unloaded or self.taring:
            return False
        return any(stream.baseline is None or stream.drifted for stream in self._streams.values())

    @property
    def taring(self) -> bool:
        """Whether a tare is under way."""
        return any(stream.taring for stream in self._streams.values())

    def start_tare(self, skip_s: float = 0.0) -> None:
        """Measure the baseline of every stream from now on, after a while that is left out."""
        with self._lock:
            self.refusal = ''
            for stream in self._streams.values():
                stream.start_tare(Tare(self._params.tare_s, skip_s))

    def set_unloaded(self, unloaded: bool) -> None:
        """Take note of whether something touches the finger; a touch ends an automatic tare."""
        with self._lock:
            self.unloaded = unloaded
            if self._params.auto_tare and not unloaded:
                for stream in self._streams.values():
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
                found = stream.review(elapsed_s, self.unloaded, self._params.drift_limit)
                faults += [f'{topic}: {sentence}' for sentence in found]
            return faults, self._numbers()

    def _numbers(self) -> dict[str, Any]:
        numbers: dict[str, Any] = {}
        for topic, stream in self._streams.items():
            numbers[f'{topic} tared'] = stream.baseline is not None
            if stream.baseline is not None:
                numbers[f'{topic} drift [noise]'] = stream.drift
        return numbers

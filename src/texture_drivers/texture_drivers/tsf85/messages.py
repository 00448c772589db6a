"""TSF-85 data as the vendor's ROS driver publishes it, made into the suite's signals. Knows no ROS.

`robotiq/ros` @18335fa, `robotiq_tsf`: for each packet one message on each of several topics, both fingers in each, none
with a header; the device's stamp, 16 bits in ms, is a message of its own and the last of its packet. So what belongs
together follows from the times at which the messages were sent.

The functions work on any objects with the attributes of those messages.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from texture_core.errors import InvalidData
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_drivers.tsf85 import tables
from texture_drivers.tsf85.finger_stream import FingerStream
from texture_drivers.tsf85.sample_frames import UNKNOWN, SampleFrame
from texture_drivers.tsf85.settings import Tsf85Settings

MAX_WAITING_SAMPLES = 50  # samples that wait for a stamp; more, and the stamp is taken as lost
SILENCE_NS = 1 * NANOSECONDS  # after so long the 16 bits of the stamps may have wrapped unseen
TAXELS = tables.STATIC_ROWS * tables.STATIC_COLUMNS


class TimedValue(NamedTuple):
    """A number and when its message was sent."""

    source_ns: int
    value: int


class Tsf85MessageConverter:
    """Make the messages about one finger into numbered, timed batches.

    A message is handed over with the time at which it was sent, by the clock of the driver's host.

    Parameters
    ----------
    finger
        0 or 1.
    settings
        Of the inertial sensors.
    static_rate_hz
        Rate of the taxel images as published; 0: 60 Hz.
    frame_id
        Frame of the fingertip.
    """

    def __init__(
        self, finger: int = 0, settings: Tsf85Settings | None = None, static_rate_hz: float = 0.0, frame_id: str = ''
    ) -> None:
        settings = Tsf85Settings() if settings is None else settings
        self.repeated = 0  # messages of packets without a new dynamic value
        self.unstamped = 0  # samples whose stamp was lost
        self.unpaired = 0  # stamps whose sample was lost
        self._finger = finger
        self._line = FingerStream(tables.TSF85, settings, static_rate_hz, frame_id)
        self._dynamics: deque[TimedValue] = deque()
        self._stamps: deque[TimedValue] = deque()
        self._image: tuple[int, ...] | None = None
        self._motion: dict[int, tuple[float, ...]] = dict.fromkeys(settings.kinds, UNKNOWN)
        self._last_stamp: int | None = None
        self._last_ns: int | None = None

    @property
    def rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        return self._line.rates_hz

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals for the diagnostics."""
        return {
            'samples': self._line.cutter.samples,
            'lost': self._line.cutter.lost,
            'repeated': self.repeated,
            'unstamped': self.unstamped,
            'unpaired': self.unpaired,
        }

    def take(self, topic: str, message: Any, source_ns: int) -> None:
        """Note a message of a topic, named as in `TOPICS`.

        Parameters
        ----------
        topic
            Name of the topic in `TOPICS`.
        message
            Message with the attributes of its type.
        source_ns
            Time at which it was sent, ns by the clock of the driver's host.

        Raises
        ------
        InvalidData
            If an image has another number of taxels.
        """
        TOPICS[topic](self, message, source_ns)

    def batches(self) -> Mapping[str, list[TactileSignal]]:
        """Return the batches, by topic, of all messages that can be put together by now."""
        frames: list[SampleFrame] = []
        sent_ns = 0
        while self._is_complete():
            sample = self._dynamics.popleft()
            stamp = self._stamp_of(sample, self._dynamics[0].source_ns)
            if stamp is not None and stamp == self._last_stamp:
                self.repeated += 1
                continue
            self._last_stamp = stamp
            sent_ns = sample.source_ns
            frames.append(SampleFrame(stamp, sample.value, self._image, sum(self._motion.values(), ())))
            self._image = None
        if frames and self._last_ns is not None and sent_ns - self._last_ns > SILENCE_NS:
            self._line.interrupt()
        self._last_ns = sent_ns or self._last_ns
        return self._line.place(frames, sent_ns)

    def _is_complete(self) -> bool:
        """Return whether all that was sent with the oldest sample has come, or will not come any more."""
        if len(self._dynamics) < 2:
            return False
        stamped = bool(self._stamps) and self._stamps[-1].source_ns >= self._dynamics[0].source_ns
        return stamped or len(self._dynamics) > MAX_WAITING_SAMPLES

    def _stamp_of(self, sample: TimedValue, until_ns: int) -> int | None:
        """Return the stamp that was sent between a sample and the next one."""
        stamp = None
        while self._stamps and self._stamps[0].source_ns < until_ns:
            sent = self._stamps.popleft()
            if stamp is None and sent.source_ns >= sample.source_ns:
                stamp = sent.value
            else:
                self.unpaired += 1
        self.unstamped += stamp is None
        return stamp

    def _take_dynamic(self, message: Any, source_ns: int) -> None:
        self._dynamics.append(TimedValue(source_ns, int(message.data[self._finger].value)))

    def _take_stamp(self, message: Any, source_ns: int) -> None:
        self._stamps.append(TimedValue(source_ns, int(message.values[self._finger])))
        if len(self._stamps) > MAX_WAITING_SAMPLES and not self._dynamics:
            self._stamps.popleft()
            self.unpaired += 1

    def _take_static(self, message: Any, _source_ns: int) -> None:
        values = message.taxels[self._finger].values
        if len(values) != TAXELS:
            raise InvalidData(f'the message has {len(values)} taxels; a TSF-85 has {TAXELS}; check the message package')
        self._image = tuple(int(value) for value in values)

    def _take_acceleration(self, message: Any, _source_ns: int) -> None:
        self._motion[tables.ACCELEROMETER] = _axes(message, self._finger)

    def _take_rotation(self, message: Any, _source_ns: int) -> None:
        self._motion[tables.GYROSCOPE] = _axes(message, self._finger)


def _axes(message: Any, finger: int) -> tuple[float, ...]:
    return tuple(float(value) for value in message.data[finger].values)


# Name of the vendor's topic and of its message type: what is done with it.
TOPICS: Mapping[str, Callable[[Tsf85MessageConverter, Any, int], None]] = {
    'Dynamic': Tsf85MessageConverter._take_dynamic,
    'Timestamp': Tsf85MessageConverter._take_stamp,
    'StaticData': Tsf85MessageConverter._take_static,
    'Accelerometer': Tsf85MessageConverter._take_acceleration,
    'Gyroscope': Tsf85MessageConverter._take_rotation,
}

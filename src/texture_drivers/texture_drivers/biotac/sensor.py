"""The BioTac fingertip as a sensor of the suite."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby

from texture_core.errors import DeviceError
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_drivers.biotac.bridge import SerialBridge
from texture_drivers.biotac.cheetah import Cheetah
from texture_drivers.biotac.link import SpiFrame, SpiLink
from texture_drivers.biotac.protocol import Replies, decode
from texture_drivers.biotac.tables import (
    FULL_SCALE,
    LAYOUTS,
    PAC,
    PAC_SENSOR,
    SLOW_SENSOR,
    UNIT,
    BioTacLayout,
)
from texture_drivers.channel_watch import Limits
from texture_drivers.clock import StreamClock
from texture_drivers.packet_numbering import PacketNumbering
from texture_drivers.params import SensorParams

SILENCE_S = 1.0  # without a whole frame, or without a good word, the board or the finger is not there
MICROSECONDS_PER_S = 1e6
PPM = 1e6
CHEETAH = 'cheetah'
Topics = dict[str, list[TactileSignal]]


class BioTac:
    """Read BioTacs of one board: 'signal' is PAC at 2200 Hz, 'signal_static' all else at 100 Hz, in counts.

    The stamp of a PAC batch is the time of its first sample, one slot (227 µs) after the start of the frame; that of
    a static row is the start of its frame, and its channels were sampled up to a frame later
    (`BioTacLayout.slow_slots`). The device's numbers tell losses exactly, its clock tells the times; over an
    interruption the host's clock does. See `texture_core.protocols.Sensor`.

    Parameters
    ----------
    params
        `device` is the path of a serial bridge, or 'cheetah' for the first Cheetah adapter; `finger` the place of the
        BioTac on its board, from 0.
    now_ns
        The host's clock.
    layout
        Kind of BioTac.
    fingers
        Several places instead of `params.finger`; topics are then 'finger0/signal' and so on.
    link
        Another way to the board than `params.device` names.
    """

    def __init__(
        self,
        params: SensorParams,
        now_ns: Callable[[], int] = time.time_ns,
        *,
        layout: BioTacLayout = LAYOUTS['biotac'],
        fingers: Sequence[int] = (),
        link: SpiLink | None = None,
    ) -> None:
        self._params = params
        self._now_ns = now_ns
        self._layout = layout
        self._prefixes = {finger: f'finger{finger}/' for finger in fingers} or {params.finger: ''}
        self._link = link or make_link(params, layout)
        self._clock = StreamClock(MICROSECONDS_PER_S, max_drift=self._link.max_drift)
        self._numbers = PacketNumbering(layout.frame_rate_hz)
        self._epoch: int | None = None
        self._last_received_ns: dict[int, int] = {}  # finger: when it last sent a good word; -1 for the board
        self._opened = self._samples = self._damaged = self._refused = 0

    def open(self) -> None:
        """Open the link; DeviceError if it is not there."""
        self._link.open()
        self._opened += 1
        self._last_received_ns = dict.fromkeys([-1, *self._prefixes], self._now_ns())

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for about one frame and return what arrived."""
        frames = self._link.read()
        now_ns = self._now_ns()
        topics: Topics = {topic: [] for topic in self.expected_rates_hz}
        for run in consecutive(frames):
            self._process(run, now_ns, topics)
        self._watch_silence(now_ns)
        return topics

    def close(self) -> None:
        """Close the link."""
        self._link.close()

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals; 'samples' and 'lost' are of PAC of one finger, 'damaged_words' and 'refused_words' of all read."""
        return {
            'samples': self._samples,
            'lost': self._numbers.lost * self._layout.pac_per_frame,
            'damaged_words': self._damaged,
            'refused_words': self._refused,
            'reopened': max(0, self._opened - 1),
            'clock_steps': self._clock.steps,
            **self._link.counts,
        }

    @property
    def details(self) -> Mapping[str, str | float]:
        """Serial number of each BioTac that reported it, and how much the device's clock is slow."""
        serials = {f'serial of finger {place}': serial for place, serial in enumerate(self._link.serials) if serial}
        return {**serials, 'device clock slow by [ppm]': PPM * self._clock.drift}

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        rates = {'signal': self._layout.pac_rate_hz, 'signal_static': self._layout.frame_rate_hz}
        return {f'{prefix}{topic}': rate for prefix in self._prefixes.values() for topic, rate in rates.items()}

    @property
    def limits(self) -> Limits:
        """Ends of the 12 bits by topic."""
        return dict.fromkeys(self.expected_rates_hz, (0, FULL_SCALE))

    def _process(self, run: Sequence[SpiFrame], now_ns: int, topics: Topics) -> None:
        """Make batches of consecutive frames, once their times are certain."""
        first, last = run[0], run[-1]
        self._check_places(last.fingers)
        self._last_received_ns[-1] = now_ns
        if first.epoch != self._epoch:
            self._epoch = first.epoch
            self._numbers.interrupt()
            self._clock.restart()
        # A frame is sent when its last slot has been sampled.
        self._clock.observe(last.time_us + round(self._layout.frame_s * MICROSECONDS_PER_S), now_ns)
        if not self._clock.settled:
            return
        start_ns = self._clock.time_ns(first.time_us)
        index = self._numbers.place(first.number, len(run), start_ns)
        replies = decode(b''.join(frame.reply for frame in run), self._layout, last.fingers)
        self._samples += len(replies.pac)
        for finger, prefix in self._prefixes.items():
            self._damaged += int(replies.damaged[finger])
            self._refused += int(replies.refused[finger])
            if replies.damaged[finger] == len(run) * len(self._layout.slots):
                continue  # nobody there
            self._last_received_ns[finger] = now_ns
            topics[f'{prefix}signal'].append(self._pac(start_ns, index, replies, finger))
            topics[f'{prefix}signal_static'].append(self._slow(start_ns, index, replies, finger))

    def _pac(self, start_ns: int, index: int, replies: Replies, finger: int) -> TactileSignal:
        return TactileSignal(
            stamp_ns=start_ns + self._layout.slot_time_ns(1),
            sensor=PAC_SENSOR,
            channels=(PAC,),
            units=(UNIT,),
            sampling_rate_hz=self._layout.pac_rate_hz,
            first_sample=index * self._layout.pac_per_frame,
            samples=replies.pac[:, finger : finger + 1],
            frame_id=self._params.frame_id,
        )

    def _slow(self, start_ns: int, index: int, replies: Replies, finger: int) -> TactileSignal:
        return TactileSignal(
            stamp_ns=start_ns,
            sensor=SLOW_SENSOR,
            channels=self._layout.slow_channels,
            units=(UNIT,) * len(self._layout.slow_channels),
            sampling_rate_hz=self._layout.frame_rate_hz,
            first_sample=index,
            samples=replies.slow[:, :, finger],
            frame_id=self._params.frame_id,
        )

    def _check_places(self, places: int) -> None:
        missing = [finger for finger in self._prefixes if finger >= places]
        if missing:
            raise DeviceError(
                f"finger {missing[0]} is asked for, and the board at '{self._params.device}' has places 0 to "
                f'{places - 1}; set the parameter finger to one of them'
            )

    def _watch_silence(self, now_ns: int) -> None:
        """Raise DeviceError when the board, or every finger asked for, has not been heard for a while."""
        limit_ns = now_ns - SILENCE_S * NANOSECONDS
        if self._last_received_ns[-1] < limit_ns:
            raise DeviceError(
                f"device '{self._params.device}' is open but sends no whole frames; check that it is a BioTac bridge "
                'and runs, or replug it'
            )
        if all(self._last_received_ns[finger] < limit_ns for finger in self._prefixes):
            places = ' or '.join(str(finger) for finger in self._prefixes)
            raise DeviceError(
                f"no BioTac answers as finger {places} at '{self._params.device}'; "
                'check its plug, and the parameter finger'
            )


def consecutive(frames: Sequence[SpiFrame]) -> Iterator[list[SpiFrame]]:
    """Yield runs of frames that follow each other without a gap."""
    numbered = enumerate(frames)
    for _, run in groupby(numbered, key=lambda item: (item[1].epoch, item[1].fingers, item[1].number - item[0])):
        yield [frame for _, frame in run]


def make_link(params: SensorParams, layout: BioTacLayout) -> SpiLink:
    """Return the link that a device's name means: 'cheetah', or the path of a serial bridge."""
    if params.device == CHEETAH:
        return Cheetah(layout)
    return SerialBridge(params.device, layout, params.batch_s)

"""BioTac data as other people's ROS drivers publish it, made into the suite's signals. Knows no ROS.

`biotac_sensors/BioTacHand` (kth-ros-pkg/biotac_driver @6fb8e33): one frame of 44 slots a message, stamped with the
host's time at the end of the frame. The ns_offset fields are wrong in that driver (it adds milliseconds to seconds), so
the times of the samples come from the slot table here.

`sr_robot_msgs/BiotacAll` (shadow-robot/sr_common @efa7d38): PAC since the last message, as many as there were, two in
each millisecond of EtherCAT; the other channels are the newest values, stamped with the time of publishing.

The functions work on any objects with the attributes of those messages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import InvalidData
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_drivers.biotac.tables import LAYOUTS, PAC, PAC_SENSOR, SLOW_SENSOR, UNIT, BioTacLayout
from texture_drivers.clock import StreamClock

LATE_S = 0.015  # host stamps jitter by some ms; what is later than that has gaps before it


@dataclass(frozen=True, eq=False)
class BioTacReading:
    """What one message holds about one finger.

    Parameters
    ----------
    end_ns
        Stamp of the message: time just after the last sample.
    pac : (n,) counts
    slow : (n_channels,) counts
        In the order of `BioTacLayout.slow_channels`.
    serial
        Serial number of the finger, '' if not reported.
    """

    end_ns: int
    pac: NDArray[np.float32]
    slow: NDArray[np.float32]
    serial: str = ''


@dataclass(frozen=True)
class MessageLayout:
    """How one type of message is read, and when its samples were taken.

    Parameters
    ----------
    read
        Returns the reading of a finger, by its place from 0 on.
    pac_rate_hz, message_rate_hz
        Nominal rates of PAC and of messages.
    pac_delay_s
        From the start of the stretch that a message covers to its first PAC sample.
    slow_delay_s
        From there to the time given to the slow channels.
    """

    read: Callable[[Any, int], BioTacReading]
    pac_rate_hz: float
    message_rate_hz: float
    pac_delay_s: float
    slow_delay_s: float


def read_biotac_hand(message: Any, finger: int) -> BioTacReading:
    """Return what a `biotac_sensors/BioTacHand` says about the finger at a place of the board, 0 for position 1.

    Raises
    ------
    InvalidData
        If the finger is not in the message, or its arrays have other lengths than a frame has.
    """
    found = {int(data.bt_position) - 1: data for data in message.bt_data}
    data = _finger(found, finger)
    layout = LAYOUTS['biotac']
    if len(data.pac_data) != layout.pac_per_frame:
        raise InvalidData(
            f'the message has {len(data.pac_data)} PAC samples; a frame has {layout.pac_per_frame}; '
            'give the message type that is published'
        )
    slow = [data.tdc_data, data.tac_data, data.pdc_data]
    return BioTacReading(
        _stamp_ns(message), _counts(data.pac_data), _slow(slow, data.electrode_data, layout), str(data.bt_serial)
    )


def read_biotac_all(message: Any, finger: int) -> BioTacReading:
    """Return what a `sr_robot_msgs/BiotacAll` says about a finger, 0 is the first of the hand.

    Raises
    ------
    InvalidData
        If the finger is not in the message, or has another number of electrodes.
    """
    data = _finger(dict(enumerate(message.tactiles)), finger)
    slow = _slow([data.tdc, data.tac, data.pdc], data.electrodes, LAYOUTS['biotac'])
    return BioTacReading(_stamp_ns(message), _counts(data.pac), slow)


def _finger(found: Mapping[int, Any], finger: int) -> Any:
    if finger not in found:
        raise InvalidData(f'finger {finger} is asked for, and the message has fingers {sorted(found)}; choose one')
    return found[finger]


def _stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * NANOSECONDS + int(message.header.stamp.nanosec)


def _counts(values: Any) -> NDArray[np.float32]:
    return np.array(values, dtype=np.float32)


def _slow(first: list[int], electrodes: Any, layout: BioTacLayout) -> NDArray[np.float32]:
    if len(electrodes) != layout.electrodes:
        raise InvalidData(f'the message has {len(electrodes)} electrodes; a BioTac has {layout.electrodes}')
    return np.concatenate([_counts(first), _counts(electrodes)])


BIOTAC = LAYOUTS['biotac']
MESSAGES: Mapping[str, MessageLayout] = {
    'BioTacHand': MessageLayout(read_biotac_hand, BIOTAC.pac_rate_hz, BIOTAC.frame_rate_hz, 1 / 4400, 0.0),
    # 1 kHz EtherCAT with two samples a cycle: the last sample is as new as the message.
    'BiotacAll': MessageLayout(read_biotac_all, 2000.0, 100.0, 1 / 2000, 1 / 100),
}


class BioTacMessageConverter:
    """Make the messages of one topic into batches of one finger, with running indices and times free of jitter.

    These messages have no numbers, so a loss is seen in the stamps alone: a message that is later than 15 ms leaves a
    gap before it.

    Parameters
    ----------
    layout
        How the messages are read.
    finger
        Place of the finger, from 0.
    frame_id
        Frame of the fingertip.
    """

    def __init__(self, layout: MessageLayout, finger: int = 0, frame_id: str = '') -> None:
        self.serial = ''
        self.lost = 0  # PAC samples
        self.samples = 0
        self._layout = layout
        self._finger = finger
        self._frame_id = frame_id
        self._clock = StreamClock(layout.pac_rate_hz)
        self._next_index = 0
        self._next_row = 0
        self._next_ns: int | None = None

    def update(self, message: Any) -> Mapping[str, TactileSignal]:
        """Return the batches in a message, by topic; nothing while the clock settles.

        Raises
        ------
        InvalidData
            If the message does not hold the finger as it should.
        """
        reading = self._layout.read(message, self._finger)
        self.serial = reading.serial or self.serial
        first, row = self._place(len(reading.pac), reading.end_ns)
        if not self._clock.settled:
            return {}
        self.samples += len(reading.pac)
        start_ns = self._clock.time_ns(first)
        return {
            'signal': self._pac(reading, first, start_ns),
            'signal_static': self._slow(reading, row, start_ns),
        }

    def _place(self, n_samples: int, end_ns: int) -> tuple[int, int]:
        """Return the index of the first PAC sample and of the row of slow channels."""
        late_ns = 0 if self._next_ns is None else end_ns - self._next_ns - self._length_ns(n_samples)
        if late_ns > LATE_S * NANOSECONDS:
            missing = round(late_ns * self._layout.pac_rate_hz / NANOSECONDS)
            self.lost += missing
            self._next_index += missing
            self._next_row += round(late_ns * self._layout.message_rate_hz / NANOSECONDS)
        first, row = self._next_index, self._next_row
        self._next_index, self._next_row, self._next_ns = first + n_samples, row + 1, end_ns
        self._clock.observe(self._next_index, end_ns)
        return first, row

    def _length_ns(self, n_samples: int) -> int:
        return round(n_samples / self._layout.pac_rate_hz * NANOSECONDS)

    def _pac(self, reading: BioTacReading, first: int, start_ns: int) -> TactileSignal:
        return TactileSignal(
            stamp_ns=start_ns + round(self._layout.pac_delay_s * NANOSECONDS),
            sensor=PAC_SENSOR,
            channels=(PAC,),
            units=(UNIT,),
            sampling_rate_hz=self._layout.pac_rate_hz,
            first_sample=first,
            samples=reading.pac[:, None],
            frame_id=self._frame_id,
        )

    def _slow(self, reading: BioTacReading, row: int, start_ns: int) -> TactileSignal:
        return TactileSignal(
            stamp_ns=start_ns + round(self._layout.slow_delay_s * NANOSECONDS),
            sensor=SLOW_SENSOR,
            channels=BIOTAC.slow_channels,
            units=(UNIT,) * len(BIOTAC.slow_channels),
            sampling_rate_hz=self._layout.message_rate_hz,
            first_sample=row,
            samples=reading.slow[None, :],
            frame_id=self._frame_id,
        )

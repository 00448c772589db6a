"""Numbers of the TSF-85's protocol and streams.

Sources: robotiq/tactile_sensors @8cb0219 (`sdk_cpp/RobotiqTactileSensor.cpp`, `sensor_quickstart/protocol.py`) and
robotiq/ros @18335fa (`robotiq_tsf/src/PollData.cpp`). Both agree.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from struct import Struct

START_BYTE = 0x9A
HEADER_BYTES = 4  # start, checksum (sent as 0, checked by nobody), command, payload length
MAX_PACKET_BYTES = HEADER_BYTES + 255

READ_SENSORS = 0x61
AUTOSEND = 0x58
AUTOSEND_ASYNC = 0x59  # firmware >= 1.1.7
DATA_COMMANDS = frozenset({READ_SENSORS, AUTOSEND, AUTOSEND_ASYNC})

# An item byte: type in the high nibble, finger in bits 3..2, index (0 in practice) in bits 1..0.
TYPE_MASK, FINGER_MASK, FINGER_SHIFT, INDEX_MASK = 0xF0, 0x0C, 2, 0x03
FINGERS = 2
STATIC, DYNAMIC, ACCELEROMETER, GYROSCOPE, MAGNETOMETER, TEMPERATURE, TIMESTAMP = range(0x10, 0x80, 0x10)
ITEMS: Mapping[int, Struct] = {
    DYNAMIC: Struct('>h'),
    ACCELEROMETER: Struct('>3h'),
    GYROSCOPE: Struct('>3h'),
    MAGNETOMETER: Struct('>3h'),
    TEMPERATURE: Struct('>h'),
}
# Firmware up to 1.0.6 sends 16 bits, from 1.1.7 on 64 bits; the packet does not say which. The short one is tried
# first: it never fits a long stamp, whose third byte, taken as the next item, is 0 and no type (until the year 34).
TIMESTAMPS = (Struct('>H'), Struct('>Q'))

RATE_HZ = 1000.0  # of the dynamic channel; the device's stamps are milliseconds
DYNAMIC_SENSOR, STATIC_SENSOR, MOTION_SENSOR = 'tsf85/dynamic', 'tsf85/static', 'tsf85/imu'
DYNAMIC_CHANNELS = ('dynamic',)
UNIT = 'count'
LIMITS = {'signal': (-(2**15), 2**15 - 1), 'signal_static': (0, 2**16 - 1)}  # what the counts can be, by topic


@dataclass(frozen=True)
class Tsf85Layout:
    """The taxels of one kind of fingertip, row by row."""

    rows: int
    columns: int
    static_rate_hz: float

    @cached_property
    def static_channels(self) -> tuple[str, ...]:
        """Name of each taxel."""
        return tuple(f'taxel_{row}_{column}' for row in range(self.rows) for column in range(self.columns))

    @cached_property
    def items(self) -> Mapping[int, Struct]:
        """What follows each item byte, but for the stamp's."""
        return {STATIC: Struct(f'>{self.rows * self.columns}H'), **ITEMS}


LAYOUTS: Mapping[str, Tsf85Layout] = {
    'tsf85': Tsf85Layout(7, 4, 60.0),  # 60 Hz: Robotiq README 2026; 59 Hz in paper 2, about 25 Hz with some firmware
    # The prototype of Roberge et al. ("3x4 taxels per phalanges ... about 25 Hz"). No public driver shows its packets:
    # those of the TSF-85 are taken, with 12 taxels.
    'tsf85_3x4': Tsf85Layout(3, 4, 25.0),
}
TSF85 = LAYOUTS['tsf85']
STATIC_ROWS, STATIC_COLUMNS, STATIC_RATE_HZ = TSF85.rows, TSF85.columns, TSF85.static_rate_hz
STATIC_CHANNELS = TSF85.static_channels

USB_IDS = ((0x16D0, 0x14CC), (0x04B4, 0xF232))  # the present one; an older one, Cypress' default

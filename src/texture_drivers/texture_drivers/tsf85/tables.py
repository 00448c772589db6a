"""Numbers of the TSF-85's protocol and streams.

Sources: robotiq/tactile_sensors @8cb0219 (`sdk_cpp/RobotiqTactileSensor.cpp`, `sensor_quickstart/protocol.py`) and
robotiq/ros @18335fa (`robotiq_tsf/src/PollData.cpp`). Both agree.
"""

from __future__ import annotations

from collections.abc import Mapping
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
    STATIC: Struct('>28H'),
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
STATIC_ROWS, STATIC_COLUMNS = 7, 4
STATIC_RATE_HZ = 60.0  # Robotiq README 2026; 25 to 59 Hz with earlier firmware
DYNAMIC_SENSOR, STATIC_SENSOR = 'tsf85/dynamic', 'tsf85/static'
DYNAMIC_CHANNELS = ('dynamic',)
STATIC_CHANNELS = tuple(f'taxel_{row}_{column}' for row in range(STATIC_ROWS) for column in range(STATIC_COLUMNS))
UNIT = 'count'

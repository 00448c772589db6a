"""Numbers of the AnySkin's protocol and streams.

Source: raunaqbhirangi/anyskin @4e5bd4f `arduino/5X_binary_burst_stream/5X_binary_burst_stream.ino`: each turn of the
loop reads the five magnetometers, sends the four float32 of each, then CR and LF.
"""

from __future__ import annotations

import numpy as np

MAGNETOMETERS = 5  # of the 5X board
QUANTITIES = 4  # of each magnetometer: temperature, x, y, z
VALUE = np.dtype('<f4')
END = b'\r\n'
LOWEST_TEMPERATURE_C, HIGHEST_TEMPERATURE_C = -20.0, 85.0  # MLX90393 data sheet: where it works
LARGEST_FIELD_UT = 50_000.0  # MLX90393 data sheet: its measurement range
# At the gain and resolution that the vendor's library sets (0.15 µT a count, inferred) 16 bits end here: an axis that
# stands there is saturated.
RANGE_UT = 4_900.0
# The finest steps of an MLX90393 are some tenths of a microtesla and 0.02 °C: what is smaller than this and not 0 is no
# measurement.
SMALLEST = 1e-3

SIGNAL, TEMPERATURE = 'signal', 'temperature'
FIELD_SENSOR, TEMPERATURE_SENSOR = 'anyskin/field', 'anyskin/temperature'
FIELD_UNIT, TEMPERATURE_UNIT = 'µT', '°C'
# Until the rate has been measured: the filters of the magnetometers and the I2C bus set it, and the vendor names none.
USUAL_RATE_HZ = 100.0


def frame_bytes(magnetometers: int) -> int:
    """Return the length of a frame: 82 bytes for five magnetometers."""
    return magnetometers * QUANTITIES * VALUE.itemsize + len(END)


def field_channels(magnetometers: int) -> tuple[str, ...]:
    """Return the names of the field's channels: 'm0_x', 'm0_y', 'm0_z', 'm1_x' and so on."""
    return tuple(f'm{number}_{axis}' for number in range(magnetometers) for axis in 'xyz')

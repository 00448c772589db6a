"""Numbers of the data acquisition finger.

The layout of the frames is our own (see `texture_core.framing`); rate and channels are of Jamali & Sammut 2010.
"""

from __future__ import annotations

TOPIC = 'signal'
SENSOR = 'daq'
KIND = 0x01
RATE_HZ = 2500.0  # after a low-pass of 500 Hz
BAUD = 921600  # in frames of 10 samples, 8 channels at 2.5 kHz are 44 kB/s; 115200 baud carry 11.5 kB/s

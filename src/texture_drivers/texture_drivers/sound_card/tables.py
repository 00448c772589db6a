"""Numbers of a sensor on a sound card."""

from __future__ import annotations

SIGNAL = 'signal'
SENSOR = 'sound_card'
RATES_HZ = (44_100, 48_000, 88_200, 96_000, 192_000)  # USB Audio Class devices have some of these
RATE_HZ = 48_000
BLOCK_FRAMES = 480  # in a call of PortAudio: 10 ms at 48 kHz
QUEUED_S = 1.0  # blocks are kept so long for a busy reader
FULL_SCALE = 'FS'  # unit of uncalibrated samples: 1 is the largest

"""Numbers of the PVDF finger and of the line to its microcontroller.

Film, force sensor and machine are those of Hu et al. 2014; the frames are our own (see `texture_core.framing`).
The paper tells neither sampling rates nor the gains of its amplifiers. Its spectra have 12 288 points: at 4096 Hz that
are 3 s, or 76 mm of fabric at its 25.5 mm/s.
"""

from __future__ import annotations

FILM_TOPIC, FORCE_TOPIC = 'signal', 'signal_static'
FILM_SENSOR, FORCE_SENSOR = 'pvdf/film', 'pvdf/force'
FILM_CHANNELS, FORCE_CHANNELS = ('film',), ('force',)
# Kinds of frames on the line. 0x10 to 0x1F are the finger's, 0x20 to 0x2F the rails' answers, 0xA0 to 0xAF orders to
# the rails: either side passes over what is not its own.
FILM_KIND, FORCE_KIND = 0x10, 0x11

FILM_RATE_HZ = 4096.0
FORCE_RATE_HZ = 64.0
BAUD = 230400  # both streams are 11 kB/s; 115200 baud carry 11.5 kB/s, which leaves nothing for the rails
FILM_PC_PER_COUNT = 0.002  # ±65 pC, a step of 3 N: 1 N on the film gives 21 pC
FORCE_N_PER_COUNT = 0.005  # 15 N, the range of the FSG15N1, are 3000 counts; it is right to 0.075 N
D33_PC_N = 21.0
RESISTANCE_OHM = 1e8  # the corner lies at 1.5 Hz: below the vibrations of a slide, above the drift of temperature
CAPACITANCE_F = 1.06e-9  # 12 · 8.85 pF/m · 300 mm² / 30 µm

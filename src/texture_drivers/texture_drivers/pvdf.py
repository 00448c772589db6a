# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A finger with a PVDF film and a force sensor behind it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from texture_core.config import param
from texture_drivers.sensor import SensorParams, load_settings
from texture_drivers.serial_line import FramedSensor, FramedStream, baud_param

# --------------------
# Numbers of the PVDF finger and of the line to its microcontroller.
#
# Film, force sensor and machine are those of Hu et al. 2014; frames of this project (see `texture_core.framing`). The
# paper gives neither sampling rates nor the gains of its amplifiers. Its spectra have 12 288 points: at 4096 Hz that
# are 3 s, or 76 mm of fabric at its 25.5 mm/s.

FILM_TOPIC, FORCE_TOPIC = 'signal', 'signal_static'
FILM_SENSOR, FORCE_SENSOR = 'pvdf/film', 'pvdf/force'
FILM_CHANNELS, FORCE_CHANNELS = ('film',), ('force',)
# Kinds of frames on the line. 0x10 to 0x1F are the finger's, 0x20 to 0x2F the rails' answers, 0xA0 to 0xAF orders to
# the rails: either side ignores the frames of the other.
FILM_KIND, FORCE_KIND = 0x10, 0x11

FILM_RATE_HZ = 4096.0
FORCE_RATE_HZ = 64.0
BAUD = 230400  # both streams are 11 kB/s; 115200 baud carry 11.5 kB/s, which leaves nothing for the rails
FILM_PC_PER_COUNT = 0.002  # ±65 pC, a step of 3 N: 1 N on the film gives 21 pC
FORCE_N_PER_COUNT = 0.005  # 15 N, the range of the FSG15N1, are 3000 counts; it is right to 0.075 N
D33_PC_N = 21.0
# The charge leaks through the amplifier: dQ/dt = d33 · dF/dt − Q / (R·C), eq. 4 to 6, a high-pass of first order whose
# corner lies at 1.5 Hz: below the vibrations of a slide, above the drift of temperature. R is 100 MΩ, and C of the film
# 12 · 8.85 pF/m · 300 mm² / 30 µm.
LEAK_S = 1e8 * 1.06e-9


# --------------------
# The PVDF finger as a sensor of the suite: the film on 'signal', the force on 'signal_static'.


@dataclass(frozen=True)
class PvdfSettings:
    """Parameters of the PVDF film, its amplifier and the force sensor."""

    baud: int = baud_param(BAUD)
    film_gain_pc: float = param(FILM_PC_PER_COUNT, 'Charge of one count of the film.', unit='pC')
    force_gain_n: float = param(FORCE_N_PER_COUNT, 'Force of one count of the force sensor.', unit='N')

    def streams(self) -> list[FramedStream]:
        """Return what the device sends, as the line understands it."""
        return [
            FramedStream(topic, kind, sensor, rate_hz, channels, (unit,), np.array([gain]), np.zeros(1))
            for topic, kind, sensor, rate_hz, channels, unit, gain in (
                (FILM_TOPIC, FILM_KIND, FILM_SENSOR, FILM_RATE_HZ, FILM_CHANNELS, 'pC', self.film_gain_pc),
                (FORCE_TOPIC, FORCE_KIND, FORCE_SENSOR, FORCE_RATE_HZ, FORCE_CHANNELS, 'N', self.force_gain_n),
            )
        ]


def pvdf(params: SensorParams, now_ns: Callable[[], int] = time.time_ns) -> FramedSensor:
    """Return the sensor; `params.config` means `PvdfSettings`.

    Raises
    ------
    UnknownName, InvalidParameter
        If the settings are wrong.
    """
    settings = load_settings(PvdfSettings, params.config)
    return FramedSensor(params, now_ns, settings.streams(), baud=settings.baud)

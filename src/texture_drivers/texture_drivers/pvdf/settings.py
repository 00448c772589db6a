"""The parameters of a PVDF film on an audio or DAQ input."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.parameters import param
from texture_drivers.framed_stream import FramedStream
from texture_drivers.pvdf import tables
from texture_drivers.pvdf.charge_leak import ChargeLeak, ForceReconstructor

COULOMB_PC = 1e12


@dataclass(frozen=True)
class PvdfSettings:
    """Parameters of the PVDF film, its amplifier and the force sensor."""

    baud: int = param(
        tables.BAUD,
        'Sets the baud rate of a real UART in bit/s; a USB device ignores it. It must equal that of the device.',
        low=9600,
        high=12_000_000,
    )
    film_rate_hz: float = param(
        tables.FILM_RATE_HZ,
        'Sets the nominal sampling rate of the film; it must equal that of the device.',
        unit='Hz',
        low=1.0,
        high=1e5,
    )
    force_rate_hz: float = param(
        tables.FORCE_RATE_HZ,
        'Sets the nominal sampling rate of the force sensor; it must equal that of the device.',
        unit='Hz',
        low=0.1,
        high=1e4,
    )
    film_gain_pc: float = param(
        tables.FILM_PC_PER_COUNT,
        'Sets the charge of one count of the film; a larger value gives larger samples.',
        unit='pC',
    )
    film_offset_pc: float = param(
        0.0, 'Sets the charge of the film at 0 counts, which is added to every sample.', unit='pC'
    )
    force_gain_n: float = param(
        tables.FORCE_N_PER_COUNT,
        'Sets the force of one count of the force sensor; a larger value gives larger samples.',
        unit='N',
    )
    force_offset_n: float = param(0.0, 'Sets the force at 0 counts, which is added to every sample.', unit='N')
    restore_from_hz: float = param(
        0.0,
        'Publishes the force on the film with its charge leakage undone above this frequency; 0 publishes '
        'the charge as measured. A lower frequency restores slower changes and amplifies drift.',
        unit='Hz',
        low=0.0,
        high=1000.0,
    )
    resistance_ohm: float = param(
        tables.RESISTANCE_OHM,
        'Sets the input resistance of the amplifier; a larger value makes the charge leak more slowly.',
        unit='Ω',
        low=1e3,
        high=1e15,
    )
    capacitance_f: float = param(
        tables.CAPACITANCE_F,
        'Sets the capacitance of the film; a larger value makes the charge leak more slowly.',
        unit='F',
        low=1e-13,
        high=1e-3,
    )
    d33_pc_n: float = param(
        tables.D33_PC_N,
        'Sets the charge of the film per force; a larger value gives smaller restored forces.',
        unit='pC/N',
        low=1e-3,
        high=1e6,
    )

    def streams(self) -> list[FramedStream]:
        """Return what the device sends, as the line understands it."""
        return [
            FramedStream(
                topic=tables.FILM_TOPIC,
                kind=tables.FILM_KIND,
                sensor=tables.FILM_SENSOR,
                rate_hz=self.film_rate_hz,
                channels=tables.FILM_CHANNELS,
                units=('pC',),
                gains=np.array([self.film_gain_pc]),
                offsets=np.array([self.film_offset_pc]),
            ),
            FramedStream(
                topic=tables.FORCE_TOPIC,
                kind=tables.FORCE_KIND,
                sensor=tables.FORCE_SENSOR,
                rate_hz=self.force_rate_hz,
                channels=tables.FORCE_CHANNELS,
                units=('N',),
                gains=np.array([self.force_gain_n]),
                offsets=np.array([self.force_offset_n]),
            ),
        ]

    def reconstructor(self) -> ForceReconstructor | None:
        """Return what undoes the leak, if that is wanted."""
        if not self.restore_from_hz:
            return None
        leak = ChargeLeak(self.resistance_ohm, self.capacitance_f, self.d33_pc_n / COULOMB_PC)
        return ForceReconstructor(leak, self.film_rate_hz, self.restore_from_hz)

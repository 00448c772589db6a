# SPDX-License-Identifier: Apache-2.0
"""A finger with a PVDF film and strain gauges: charge leak, settings, sensor."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from texture_core.config import param
from texture_core.types import Samples, TactileSignal
from texture_drivers.health import Limits
from texture_drivers.sensor import SensorParams, load_settings
from texture_drivers.serial_line import FramedStream, SerialSensor, StreamDecoder, baud_param

# --------------------
# A piezoelectric film in its amplifier: charge follows the force, and leaks away.
#
# The charge obeys dQ/dt = d33 · dF/dt − Q / (R·C): a high-pass of first order,
#
#     Q(s) / F(s) = d33 · s·T / (1 + s·T),    T = R·C,
#
# whose answer to a step of the force is d33 · exp(−t / T). (F = Ω·σ3 is the force on the film of area Ω.)
#
# Source: Hu et al. 2014, eq. 4 to 6.


@dataclass(frozen=True)
class ChargeLeak:
    """The film and its amplifier.

    Parameters
    ----------
    resistance_ohm, capacitance_f
        Equivalent resistance of the amplifier and capacitance of the film.
    d33_c_n
        Charge per force.
    """

    resistance_ohm: float
    capacitance_f: float
    d33_c_n: float = 21e-12  # the paper's film

    @property
    def time_constant_s(self) -> float:
        """T = R·C, after which a charge has leaked to 37 %."""
        return self.resistance_ohm * self.capacitance_f


class ForceReconstructor:
    """Reconstruct the force from the charge, batch by batch: the inverse of the leak above a frequency.

    A constant force leaves no charge, so what lies far below the film's corner is lost for good, and a plain inverse
    would add up every offset for ever. This one is exact but for a high-pass of first order at `from_hz`.

    Parameters
    ----------
    leak
        The film and its amplifier.
    rate_hz
        Of the samples.
    from_hz
        Lowest frequency restored; below the film's corner, or nothing is gained.
    """

    def __init__(self, leak: ChargeLeak, rate_hz: float, from_hz: float) -> None:
        self._gain = 1 / leak.d33_c_n
        pole = math.exp(-1 / (leak.time_constant_s * rate_hz))
        restored_pole = math.exp(-2 * math.pi * from_hz / rate_hz)
        self._numerator, self._denominator = (1.0, -pole), (1.0, -restored_pole)
        self._state: Samples | None = None  # at rest

    def update(self, charge_c: Samples) -> Samples:
        """Return the force, (n_samples, n_channels) N, for charges of the same shape; at rest before the first.

        Parameters
        ----------
        charge_c : (n_samples, n_channels)
            Charge of the film.

        Returns
        -------
        (n_samples, n_channels)
            Force, N.
        """
        from scipy.signal import lfilter  # noqa: PLC0415 – no other sensor needs scipy

        if self._state is None:
            self._state = np.zeros((1, charge_c.shape[1]))
        filtered, self._state = lfilter(self._numerator, self._denominator, charge_c, axis=0, zi=self._state)
        return np.asarray(self._gain * filtered)

    def restart(self) -> None:
        """Forget the past: samples are missing."""
        self._state = None


# --------------------
# Numbers of the PVDF finger and of the line to its microcontroller.
#
# Film, force sensor and machine are those of Hu et al. 2014; the frames are our own (see `texture_core.framing`). The
# paper tells neither sampling rates nor the gains of its amplifiers. Its spectra have 12 288 points: at 4096 Hz that
# are 3 s, or 76 mm of fabric at its 25.5 mm/s.

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


# --------------------
# The parameters of a PVDF film on an audio or DAQ input.

COULOMB_PC = 1e12


@dataclass(frozen=True)
class PvdfSettings:
    """Parameters of the PVDF film, its amplifier and the force sensor."""

    baud: int = baud_param(BAUD)
    film_rate_hz: float = param(
        FILM_RATE_HZ,
        'Nominal sampling rate of the film; it must equal that of the device.',
        unit='Hz',
        low=1.0,
        high=1e5,
    )
    force_rate_hz: float = param(
        FORCE_RATE_HZ,
        'Nominal sampling rate of the force sensor; it must equal that of the device.',
        unit='Hz',
        low=0.1,
        high=1e4,
    )
    film_gain_pc: float = param(
        FILM_PC_PER_COUNT, 'Charge of one count of the film; larger values give larger samples.', unit='pC'
    )
    film_offset_pc: float = param(0.0, 'Charge of the film at 0 counts, which is added to every sample.', unit='pC')
    force_gain_n: float = param(
        FORCE_N_PER_COUNT,
        'Force of one count of the force sensor; larger values give larger samples.',
        unit='N',
    )
    force_offset_n: float = param(0.0, 'Force at 0 counts, which is added to every sample.', unit='N')
    restore_from_hz: float = param(
        0.0,
        'Publishes the force on the film with its charge leakage undone above this frequency; 0 publishes '
        'the charge as measured. A lower frequency restores slower changes and amplifies drift.',
        unit='Hz',
        low=0.0,
        high=1000.0,
    )
    resistance_ohm: float = param(
        RESISTANCE_OHM,
        'Input resistance of the amplifier; larger values make the charge leak more slowly.',
        unit='Ω',
        low=1e3,
        high=1e15,
    )
    capacitance_f: float = param(
        CAPACITANCE_F,
        'Capacitance of the film; larger values make the charge leak more slowly.',
        unit='F',
        low=1e-13,
        high=1e-3,
    )
    d33_pc_n: float = param(
        D33_PC_N,
        'Charge of the film per force; larger values give smaller restored forces.',
        unit='pC/N',
        low=1e-3,
        high=1e6,
    )

    def streams(self) -> list[FramedStream]:
        """Return what the device sends, as the line understands it."""
        return [
            FramedStream(
                topic=FILM_TOPIC,
                kind=FILM_KIND,
                sensor=FILM_SENSOR,
                rate_hz=self.film_rate_hz,
                channels=FILM_CHANNELS,
                units=('pC',),
                gains=np.array([self.film_gain_pc]),
                offsets=np.array([self.film_offset_pc]),
            ),
            FramedStream(
                topic=FORCE_TOPIC,
                kind=FORCE_KIND,
                sensor=FORCE_SENSOR,
                rate_hz=self.force_rate_hz,
                channels=FORCE_CHANNELS,
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


# --------------------
# The PVDF finger as a sensor of the suite: the film on 'signal', the force on 'signal_static'.


class Pvdf(SerialSensor):
    """Read film and force. See `texture_core.types.Sensor`."""

    def __init__(self, params: SensorParams, now_ns: Callable[[], int] = time.time_ns) -> None:
        settings = load_settings(PvdfSettings, params.config)
        super().__init__(params, now_ns, StreamDecoder(settings.streams(), params.frame_id), baud=settings.baud)
        self._reconstructor = settings.reconstructor()
        self._next_sample = 0

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for the length of one batch and return what arrived."""
        batches = super().read()
        if self._reconstructor is None or FILM_TOPIC not in batches:
            return batches
        restored = [self._restored(batch, self._reconstructor) for batch in batches[FILM_TOPIC]]
        return {**batches, FILM_TOPIC: restored}

    @property
    def limits(self) -> Limits:
        """Lowest and highest sample by topic; the force that is restored from the film has none."""
        kept = super().limits
        return {FORCE_TOPIC: kept[FORCE_TOPIC]} if self._reconstructor else kept

    def _restored(self, film: TactileSignal, reconstructor: ForceReconstructor) -> TactileSignal:
        """Return the force on the film, N, of its charge, pC."""
        if film.first_sample != self._next_sample:
            reconstructor.restart()
        self._next_sample = film.next_sample
        force_n = reconstructor.update(film.samples.astype(np.float64) / COULOMB_PC)
        return replace(film, units=('N',), samples=force_n.astype(np.float32))

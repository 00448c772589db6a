"""The PVDF finger as a sensor of the suite: the film on 'signal', the force on 'signal_static'."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from texture_core.signal import TactileSignal
from texture_drivers.channel_watch import Limits
from texture_drivers.params import SensorParams
from texture_drivers.pvdf import tables
from texture_drivers.pvdf.charge_leak import ForceReconstructor
from texture_drivers.pvdf.settings import COULOMB_PC, PvdfSettings
from texture_drivers.serial_sensor import SerialSensor
from texture_drivers.settings import load_settings
from texture_drivers.stream_decoder import StreamDecoder


class Pvdf:
    """Read film and force. See `texture_core.protocols.Sensor`."""

    def __init__(self, params: SensorParams, now_ns: Callable[[], int] = time.time_ns) -> None:
        settings = load_settings(PvdfSettings, params.config)
        decoder = StreamDecoder(settings.streams(), params.frame_id)
        self._line = SerialSensor(params, now_ns, decoder, baud=settings.baud)
        self._reconstructor = settings.reconstructor()
        self._next_sample = 0

    def open(self) -> None:
        """Open the device; DeviceError if it cannot be reached."""
        self._line.open()

    def read(self) -> Mapping[str, Sequence[TactileSignal]]:
        """Wait for the length of one batch and return what arrived."""
        batches = self._line.read()
        if self._reconstructor is None or tables.FILM_TOPIC not in batches:
            return batches
        restored = [self._restored(batch, self._reconstructor) for batch in batches[tables.FILM_TOPIC]]
        return {**batches, tables.FILM_TOPIC: restored}

    def close(self) -> None:
        """Close the device."""
        self._line.close()

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals; see `StreamDecoder.counts`."""
        return self._line.counts

    @property
    def details(self) -> Mapping[str, float]:
        """How much the device's clock is slow."""
        return self._line.details

    @property
    def expected_rates_hz(self) -> Mapping[str, float]:
        """Nominal rate of each topic."""
        return self._line.expected_rates_hz

    @property
    def limits(self) -> Limits:
        """Lowest and highest sample by topic; the force that is restored from the film has none."""
        kept = self._line.limits
        return {tables.FORCE_TOPIC: kept[tables.FORCE_TOPIC]} if self._reconstructor else kept

    def _restored(self, film: TactileSignal, reconstructor: ForceReconstructor) -> TactileSignal:
        """Return the force on the film, N, of its charge, pC."""
        if film.first_sample != self._next_sample:
            reconstructor.restart()
        self._next_sample = film.next_sample
        force_n = reconstructor.update(film.samples.astype(np.float64) / COULOMB_PC)
        return replace(film, units=('N',), samples=force_n.astype(np.float32))

"""What the PVDF finger of Hu et al. 2014 measures while it goes along a path.

The film lies over the whole contact and senses its force, less what leaks away; the force sensor behind it senses the
slow part. The gains are ours: the paper tells none.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from texture_core.arrays import Array, Samples
from texture_drivers.pvdf import tables
from texture_drivers.pvdf.charge_leak import ChargeLeak
from texture_simulation.filters import Filter
from texture_simulation.scene import Scene
from texture_simulation.sensors.converter import Converter
from texture_simulation.sensors.model import SensorKind, SimulatedStream
from texture_simulation.skin_contact import SkinContact
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory

OVERSAMPLING = 1  # at 0.4 m/s and below the skin blurs what 4 kHz would fold down; what is faster is blurred more
PATH_RATE_HZ = OVERSAMPLING * tables.FILM_RATE_HZ
PC_PER_C = 1e12
LEAK = ChargeLeak(tables.RESISTANCE_OHM, tables.CAPACITANCE_F, tables.D33_PC_N / PC_PER_C)
# Eq. 5 for a force that is constant between points: the charge follows each step, and leaks by a constant share.
KEPT = math.exp(-1 / (LEAK.time_constant_s * PATH_RATE_HZ))
LEAK_SECTIONS = np.array([[1.0, -1.0, 0.0, 1.0, -KEPT, 0.0]])
FILM_BAND = np.concatenate([filters.butter(2, 800.0, 'lowpass', fs=PATH_RATE_HZ, output='sos'), LEAK_SECTIONS])
FORCE_BAND = filters.butter(2, 20.0, 'lowpass', fs=PATH_RATE_HZ, output='sos')
POINTS_PER_FORCE = round(PATH_RATE_HZ / tables.FORCE_RATE_HZ)
LIMITS = (-(2**15), 2**15 - 1)


class PvdfModel:
    """Turn a path, block by block, into the controller's counts; see `sensors.model.MakeModel` for the arguments."""

    def __init__(
        self,
        scene: Scene,
        surface: Surface,
        rng: np.random.Generator,
        *,
        finger: int = 0,
        batch_shape: tuple[int, ...] = (),
        settled: bool = False,
    ) -> None:
        self.touch = SkinContact(scene, surface, rng, PATH_RATE_HZ, finger=finger, batch_shape=batch_shape)
        self._film = Filter(FILM_BAND, settled=settled)
        self._force_band = Filter(FORCE_BAND, settled=settled)
        self._points = 0
        self._fast = Converter(scene, rng, tables.FILM_RATE_HZ, 1, LIMITS, batch_shape=batch_shape)
        self._slow = Converter(scene, rng, tables.FORCE_RATE_HZ, 1, LIMITS, batch_shape=batch_shape, slow=True)

    def streams(self, path: Trajectory, *, slow: bool = True) -> Mapping[str, Samples]:
        """Return the charge of the film in pC, and the force in N if wanted, (..., n_samples, 1) each."""
        force_n = self._pressed_n(path)
        fast = {tables.FILM_TOPIC: tables.FILM_PC_PER_COUNT * self._fast.exact(self._charge(force_n))}
        if not slow:
            return fast
        return {**fast, tables.FORCE_TOPIC: tables.FORCE_N_PER_COUNT * self._slow.exact(self._force(force_n))}

    def advance(self, path: Trajectory) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
        """Return what is measured along the next piece of path.

        Parameters
        ----------
        path
            Points at `PATH_RATE_HZ`, `OVERSAMPLING` a sample of the film; a sample is taken at the last of its points.

        Returns
        -------
        film : (n_points / OVERSAMPLING,) counts
        force : (n_force,) counts
            Those whose time, at 64 Hz from the very first point on, lies in this piece.
        """
        force_n = self._pressed_n(path)
        film = self._fast.counts(self._charge(force_n), np.int16)
        return film[..., 0], self._slow.counts(self._force(force_n), np.int16)[..., 0]

    def _charge(self, force_n: Array) -> Samples:
        """Return the counts of the charge, (..., n_samples, 1)."""
        charge_pc = tables.D33_PC_N * self._film(force_n)[..., OVERSAMPLING - 1 :: OVERSAMPLING, None]
        return np.asarray(charge_pc / tables.FILM_PC_PER_COUNT)

    def _force(self, force_n: Array) -> Samples:
        """Return the counts of the force sensor, (..., n_force, 1)."""
        slow_n = self._force_band(force_n)
        first = -self._points % POINTS_PER_FORCE
        self._points += force_n.shape[-1]
        return slow_n[..., first::POINTS_PER_FORCE, None] / tables.FORCE_N_PER_COUNT

    def _pressed_n(self, path: Trajectory) -> Array:
        placed = self.touch.placed(path)
        return placed.force_n + self.touch.variation_n(placed)


KIND = SensorKind(
    make=PvdfModel,
    path_rate_hz=PATH_RATE_HZ,
    step_points=OVERSAMPLING,
    streams=(
        SimulatedStream(tables.FILM_TOPIC, tables.FILM_SENSOR, tables.FILM_CHANNELS, 'pC', tables.FILM_RATE_HZ),
        SimulatedStream(tables.FORCE_TOPIC, tables.FORCE_SENSOR, tables.FORCE_CHANNELS, 'N', tables.FORCE_RATE_HZ),
    ),
)

"""What a PapillArray measures while it goes along a path: force and displacement of its nine pillars.

The stiffness and the bandwidth of the pillars are ours, and so is how the force spreads over them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import signal as filters

from texture_core.arrays import Array, Samples
from texture_drivers.papillarray import tables
from texture_simulation.filters import Filter
from texture_simulation.scene import Scene
from texture_simulation.sensors.converter import Converter
from texture_simulation.sensors.model import SensorKind, SimulatedStream
from texture_simulation.sensors.pressed_elements import PressedElements, grid_m
from texture_simulation.skin_contact import SkinContact
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory

PATH_RATE_HZ = 1000.0  # of the device, too
RATE_HZ = 500.0
OVERSAMPLING = 2
PITCH_M = 5e-3
PLACES_M = tuple((PITCH_M * column, PITCH_M * row) for row in (-1, 0, 1) for column in (-1, 0, 1))
BLUR_M = 3e-4
BAND = filters.butter(4, 200.0, 'lowpass', fs=PATH_RATE_HZ, output='sos')
STIFFNESS_N_MM = 1.5
N_PER_COUNT = 1e-5
LIMITS = (-2_000_000, 2_000_000)  # ±20 N
COUNTS_PER_EFFECT = 100.0  # one count of the effects is 1 mN
CHANNELS = tables.pillar_channels(len(PLACES_M))


class PapillArrayModel:
    """Turn a path, block by block, into forces and displacements; see `sensors.model.MakeModel` for the arguments."""

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
        x_m, y_m = grid_m(PLACES_M)
        self._elements = PressedElements(x_m, y_m, BLUR_M, PATH_RATE_HZ, finger)
        self._band = Filter(BAND, settled=settled)
        axes = 3 * len(PLACES_M)
        self._converter = Converter(
            scene, rng, PATH_RATE_HZ, axes, LIMITS, batch_shape=batch_shape, scale=COUNTS_PER_EFFECT
        )

    def streams(self, path: Trajectory, *, slow: bool = True) -> Mapping[str, Samples]:
        """Return forces (N) and displacements (mm) of the pillars, (..., n_samples, 54)."""
        measured = self.advance(path)[..., OVERSAMPLING - 1 :: OVERSAMPLING, :, :]
        return {tables.SIGNAL: measured.reshape(*measured.shape[:-2], -1)}

    def advance(self, path: Trajectory) -> Array:
        """Return what is measured along the next piece of path.

        Parameters
        ----------
        path
            Points at `PATH_RATE_HZ`.

        Returns
        -------
        (..., n_points, 9, 6) N and mm
            A step for each point, 1000 a second.
        """
        forces_n = self._band(self._elements.forces_n(self.touch, path))
        by_axis = np.swapaxes(forces_n.reshape(*forces_n.shape[:-3], -1, forces_n.shape[-1]), -1, -2)
        measured_n = N_PER_COUNT * self._converter.exact(by_axis / N_PER_COUNT)
        measured_n = measured_n.reshape(*measured_n.shape[:-1], len(PLACES_M), 3)
        return np.concatenate([measured_n, measured_n / STIFFNESS_N_MM], axis=-1)


KIND = SensorKind(
    make=PapillArrayModel,
    path_rate_hz=PATH_RATE_HZ,
    step_points=OVERSAMPLING,
    streams=(SimulatedStream(tables.SIGNAL, tables.PILLARS_SENSOR, CHANNELS, '', RATE_HZ),),
)

"""What an AnySkin measures while it goes along a path: the field of its magnetic skin at five magnetometers.

Where the skin is pressed and dragged the field changes in proportion to the force. The microtesla per newton, the
field without load and the bandwidth of the skin are ours: none are published.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import signal as filters

from texture_core.arrays import Array, Samples
from texture_drivers.anyskin import tables
from texture_simulation.filters import Filter
from texture_simulation.scene import Scene
from texture_simulation.sensors.converter import Converter
from texture_simulation.sensors.model import SensorKind, SimulatedStream, individual_rng
from texture_simulation.sensors.pressed_elements import PressedElements, grid_m
from texture_simulation.skin_contact import SkinContact
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory

RATE_HZ = tables.USUAL_RATE_HZ
OVERSAMPLING = 10
PATH_RATE_HZ = OVERSAMPLING * RATE_HZ
SPACING_M = 5e-3
PLACES_M = ((0.0, 0.0), (SPACING_M, 0.0), (-SPACING_M, 0.0), (0.0, SPACING_M), (0.0, -SPACING_M))
BLUR_M = 4e-4
BAND = filters.butter(4, 40.0, 'lowpass', fs=PATH_RATE_HZ, output='sos')
UT_PER_N = 600.0
UNLOADED_UT = 1500.0  # each axis of the field without load lies within plus and minus this
UT_PER_COUNT = 0.15
LIMITS = (-(2**15) * 10, 2**15 * 10)  # ±49 mT: the magnetometer's range is wider than 16 bits at its finest step


class AnySkinModel:
    """Turn a path, block by block, into the field; see `sensors.model.MakeModel` for the arguments."""

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
        channels = 3 * len(PLACES_M)
        self._unloaded_ut = individual_rng(finger).uniform(-UNLOADED_UT, UNLOADED_UT, channels)
        self._converter = Converter(scene, rng, RATE_HZ, channels, LIMITS, batch_shape=batch_shape)

    def streams(self, path: Trajectory, *, slow: bool = True) -> Mapping[str, Samples]:
        """Return the field in µT, (..., n_samples, 15)."""
        return {tables.SIGNAL: self.advance(path)}

    def advance(self, path: Trajectory) -> Array:
        """Return what is measured along the next piece of path.

        Parameters
        ----------
        path
            Points at `PATH_RATE_HZ`, `OVERSAMPLING` a sample; a sample is taken at the last of its points.

        Returns
        -------
        (..., n_points / OVERSAMPLING, 15) µT
        """
        forces_n = self._band(self._elements.forces_n(self.touch, path))[..., OVERSAMPLING - 1 :: OVERSAMPLING]
        by_channel = np.swapaxes(forces_n.reshape(*forces_n.shape[:-3], -1, forces_n.shape[-1]), -1, -2)
        counts = (self._unloaded_ut + UT_PER_N * by_channel) / UT_PER_COUNT
        return UT_PER_COUNT * self._converter.exact(counts)


KIND = SensorKind(
    make=AnySkinModel,
    path_rate_hz=PATH_RATE_HZ,
    step_points=OVERSAMPLING,
    streams=(
        SimulatedStream(
            tables.SIGNAL,
            tables.FIELD_SENSOR,
            tables.field_channels(tables.MAGNETOMETERS),
            tables.FIELD_UNIT,
            RATE_HZ,
        ),
    ),
)

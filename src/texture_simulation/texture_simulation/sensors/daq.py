"""What the finger of Jamali & Sammut 2010 measures while it goes along a path.

Four PVDF films and four strain gauges lie at random places in two layers of silicone. Each senses the pressure over its
place, the blunter the deeper it lies: a film its changes (the charge leaks), a gauge the pressure itself. All pass a
low-pass of 500 Hz and are sampled at 2.5 kHz. The sensitivities are ours: the paper tells none.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from texture_core.arrays import Array, Samples
from texture_drivers.daq import tables
from texture_simulation.filters import Filter
from texture_simulation.scene import Scene
from texture_simulation.sensors.converter import Converter
from texture_simulation.sensors.model import SensorKind, SimulatedStream, individual_rng
from texture_simulation.skin_contact import SkinContact
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory

RATE_HZ = tables.RATE_HZ
# A point a sample: the skin over an element averages over 0.2 mm and more, so that at 0.4 m/s and below nothing is left
# that 2.5 kHz would fold down; what is faster is blurred more (`skin_contact.py`).
OVERSAMPLING = 1
PATH_RATE_HZ = OVERSAMPLING * RATE_HZ
FILMS, GAUGES = 4, 4
ELEMENTS = FILMS + GAUGES
CHANNELS = tuple(
    f'{element}_{layer}_{number}' for element in ('pvdf', 'strain') for layer in ('outer', 'inner') for number in (1, 2)
)  # as in the driver's daq.yaml
LAYER_BLUR_M = (1.5e-4, 4e-4)  # outer, inner; half of the films and half of the gauges lie in each
BLUR_M = np.repeat(np.tile(LAYER_BLUR_M, 2), ELEMENTS // 4)[:, None]
PLACE_M = 4e-3  # largest distance of a place from the middle, along each side
VOLT_PER_N = (2.0, 6.0)  # range of the sensitivities
VOLT_PER_COUNT = 10.0 / 2**15
LEAK_HZ = 1.0  # corner of the films' amplifiers
LEAK = filters.butter(1, LEAK_HZ, 'highpass', fs=PATH_RATE_HZ, output='sos')
BAND = filters.butter(4, 500.0, 'lowpass', fs=PATH_RATE_HZ, output='sos')
LIMITS = (-(2**15), 2**15 - 1)


class DaqModel:
    """Turn a path, block by block, into the converter's counts; see `sensors.model.MakeModel` for the arguments."""

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
        self._offset_m, self.volt_per_n = _elements(finger)
        self._leak, self._band = Filter(LEAK, settled=settled), Filter(BAND, settled=settled)
        self._converter = Converter(scene, rng, RATE_HZ, ELEMENTS, LIMITS, batch_shape=batch_shape)

    def streams(self, path: Trajectory, *, slow: bool = True) -> Mapping[str, Samples]:
        """Return the 8 channels in V, (..., n_samples, 8)."""
        return {tables.TOPIC: VOLT_PER_COUNT * self._converter.exact(self._exact(path))}

    def advance(self, path: Trajectory) -> NDArray[np.int16]:
        """Return what is measured along the next piece of path.

        Parameters
        ----------
        path
            Points at `PATH_RATE_HZ`, `OVERSAMPLING` a sample; a sample is taken at the last of its points.

        Returns
        -------
        (n_points / OVERSAMPLING, 8) counts: films then gauges, of each the outer ones first
        """
        return self._converter.counts(self._exact(path), np.int16)

    def _exact(self, path: Trajectory) -> Samples:
        pressed_n = self._pressed_n(self.touch.placed(path))
        pressed_n[..., :FILMS, :] = self._leak(pressed_n[..., :FILMS, :])
        sensed_n = self._band(pressed_n)[..., OVERSAMPLING - 1 :: OVERSAMPLING]
        return np.swapaxes(sensed_n, -1, -2) * (self.volt_per_n / VOLT_PER_COUNT)

    def _pressed_n(self, placed: Trajectory) -> Array:
        """Return the force that each element senses, (..., 8, n)."""
        return placed.force_n[..., None, :] + self.touch.variation_n(placed, BLUR_M, self._offset_m)


@lru_cache(maxsize=16)
def _elements(finger: int) -> tuple[tuple[Array, Array], Array]:
    """Return where the elements of a finger lie, x and y, (8, 1) m each, and their sensitivities, (8,) V/N."""
    made = individual_rng(finger)
    offset_m = (made.uniform(-PLACE_M, PLACE_M, (ELEMENTS, 1)), made.uniform(-PLACE_M, PLACE_M, (ELEMENTS, 1)))
    return offset_m, made.uniform(*VOLT_PER_N, ELEMENTS) * made.choice([-1.0, 1.0], ELEMENTS)


KIND = SensorKind(
    make=DaqModel,
    path_rate_hz=PATH_RATE_HZ,
    step_points=OVERSAMPLING,
    streams=(SimulatedStream(tables.TOPIC, tables.SENSOR, CHANNELS, 'V', RATE_HZ),),
)

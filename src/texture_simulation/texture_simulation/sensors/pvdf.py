"""What the PVDF finger of Hu et al. 2014 measures while it goes along a path.

The film lies over the whole contact and feels its force, less what leaks away; the force sensor behind it feels the
slow part. The gains are ours: the paper tells none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from texture_core.arrays import Array
from texture_drivers.pvdf import tables
from texture_drivers.pvdf.charge_leak import ChargeLeak, LeakingFilm
from texture_simulation.effects import uneven_gain
from texture_simulation.path import Path
from texture_simulation.scene import Scene
from texture_simulation.surfaces import Surface

OVERSAMPLING = 2  # so that what lies above the band is filtered and not folded into it
PATH_RATE_HZ = OVERSAMPLING * tables.FILM_RATE_HZ
PC_PER_C = 1e12
FILM_BAND = filters.butter(4, 1500.0, 'lowpass', fs=PATH_RATE_HZ, output='sos')
FORCE_BAND = filters.butter(2, 20.0, 'lowpass', fs=PATH_RATE_HZ, output='sos')
POINTS_PER_FORCE = round(PATH_RATE_HZ / tables.FORCE_RATE_HZ)
SAMPLE_SIZE_M = 0.1  # where on the sample a slide begins is drawn from so much


class PvdfModel:
    """Turn a path, block by block, into the microcontroller's counts; what lies between the blocks is continuous.

    Parameters
    ----------
    scene
        How the finger feels.
    surface
        What it feels; may be changed between blocks.
    rng
        All randomness: where a sample is touched, noise.
    """

    def __init__(self, scene: Scene, surface: Surface, rng: np.random.Generator) -> None:
        self.surface = surface
        self._scene = scene
        self._rng = rng
        leak = ChargeLeak(tables.RESISTANCE_OHM, tables.CAPACITANCE_F, tables.D33_PC_N / PC_PER_C)
        self._film = LeakingFilm(leak, PATH_RATE_HZ)
        self._film_band = np.zeros((len(FILM_BAND), 2))
        self._force_band = np.zeros((len(FORCE_BAND), 2))
        self._points = 0
        self.touch_elsewhere()

    def touch_elsewhere(self) -> None:
        """Let the sample lie otherwise from now on: no two touches meet the same place."""
        x_m, y_m = self._rng.uniform(0.0, SAMPLE_SIZE_M, 2)
        self._origin_m = (float(x_m), float(y_m))

    def advance(self, path: Path) -> tuple[NDArray[np.int16], NDArray[np.int16]]:
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
        force_n = self._pressed_n(path.moved(*self._origin_m))
        felt_n, self._film_band = filters.sosfilt(FILM_BAND, force_n, zi=self._film_band)
        charge_pc = PC_PER_C * self._film.update(felt_n[:, None])[OVERSAMPLING - 1 :: OVERSAMPLING, 0]
        slow_n, self._force_band = filters.sosfilt(FORCE_BAND, force_n, zi=self._force_band)
        first = -self._points % POINTS_PER_FORCE
        self._points += len(path)
        effects = self._scene.effects
        return (
            self._counts(charge_pc / tables.FILM_PC_PER_COUNT, effects.noise_count),
            self._counts(slow_n[first::POINTS_PER_FORCE] / tables.FORCE_N_PER_COUNT, effects.static_noise_count),
        )

    def _pressed_n(self, path: Path) -> Array:
        contact = self._scene.contact
        texture_n = contact.force_variation_n(self.surface, path, contact.blur_at_m(path.force_n))
        return path.force_n + uneven_gain(path.x_m, path.y_m, self._scene.effects.unevenness) * texture_n

    def _counts(self, exact: Array, noise_count: float) -> NDArray[np.int16]:
        noisy = exact + noise_count * self._rng.standard_normal(len(exact))
        return np.clip(np.rint(noisy), -(2**15), 2**15 - 1).astype(np.int16)

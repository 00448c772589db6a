"""What the finger of Jamali & Sammut 2010 measures while it goes along a path.

Four PVDF films and four strain gauges lie at random places in two layers of silicone. Each feels the pressure over its
place, the blunter the deeper it lies: a film its changes (the charge leaks), a gauge the pressure itself. All pass a
low-pass of 500 Hz and are sampled at 2.5 kHz. The sensitivities are ours: the paper tells none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from texture_core.arrays import Array, Samples
from texture_simulation.effects import uneven_gain
from texture_simulation.path import Path
from texture_simulation.scene import Scene
from texture_simulation.surfaces import Surface

RATE_HZ = 2500.0
OVERSAMPLING = 2  # so that what lies above the band is filtered and not folded into it
PATH_RATE_HZ = OVERSAMPLING * RATE_HZ
FILMS, GAUGES = 4, 4
LAYER_BLUR_M = (1.5e-4, 4e-4)  # outer, inner; half of the films and half of the gauges lie in each
PLACE_M = 4e-3  # largest distance of a place from the middle, along each side
VOLT_PER_N = (2.0, 6.0)  # range of the sensitivities
VOLT_PER_COUNT = 10.0 / 2**15
LEAK_HZ = 1.0  # corner of the films' amplifiers
LEAK = filters.butter(1, LEAK_HZ, 'highpass', fs=PATH_RATE_HZ, output='sos')
BAND = filters.butter(4, 500.0, 'lowpass', fs=PATH_RATE_HZ, output='sos')
SAMPLE_SIZE_M = 0.1  # where on the sample a slide begins is drawn from so much


class DaqModel:
    """Turn a path, block by block, into the converter's counts; what lies between the blocks is continuous.

    Parameters
    ----------
    scene
        How the finger feels.
    surface
        What it feels; may be changed between blocks.
    rng
        All randomness: where the elements lie, where a sample is touched, noise.
    """

    def __init__(self, scene: Scene, surface: Surface, rng: np.random.Generator) -> None:
        self.surface = surface
        self._scene = scene
        self._rng = rng
        count = FILMS + GAUGES
        self._x_m, self._y_m = rng.uniform(-PLACE_M, PLACE_M, (2, count))
        self._blur_m = np.repeat(np.tile(LAYER_BLUR_M, 2), count // 4)
        self._volt_per_n = rng.uniform(*VOLT_PER_N, count) * rng.choice([-1.0, 1.0], count)
        self._leak = np.zeros((len(LEAK), 2, FILMS))
        self._band = np.zeros((len(BAND), 2, count))
        self.touch_elsewhere()

    def touch_elsewhere(self) -> None:
        """Let the sample lie otherwise from now on: no two touches meet the same place."""
        x_m, y_m = self._rng.uniform(0.0, SAMPLE_SIZE_M, 2)
        self._origin_m = (float(x_m), float(y_m))

    def advance(self, path: Path) -> NDArray[np.int16]:
        """Return what is measured along the next piece of path.

        Parameters
        ----------
        path
            Points at `PATH_RATE_HZ`, `OVERSAMPLING` a sample; a sample is taken at the last of its points.

        Returns
        -------
        (n_points / OVERSAMPLING, 8) counts: films then gauges, of each the outer ones first
        """
        volt = self._volt_per_n * self._pressed_n(path.moved(*self._origin_m))
        volt[:, :FILMS], self._leak = filters.sosfilt(LEAK, volt[:, :FILMS], axis=0, zi=self._leak)
        volt, self._band = filters.sosfilt(BAND, volt, axis=0, zi=self._band)
        counts = volt[OVERSAMPLING - 1 :: OVERSAMPLING] / VOLT_PER_COUNT
        noisy = counts + self._scene.effects.noise_count * self._rng.standard_normal(counts.shape)
        whole: NDArray[np.int16] = np.clip(np.rint(noisy), -(2**15), 2**15 - 1).astype(np.int16)
        return whole

    def _pressed_n(self, path: Path) -> Samples:
        """Return the force that each element feels, (n, 8)."""
        contact_blur_m = self._scene.contact.blur_at_m(path.force_n)
        return np.column_stack([self._over(path, contact_blur_m, i) for i in range(len(self._x_m))])

    def _over(self, path: Path, contact_blur_m: Array, element: int) -> Array:
        over = path.moved(float(self._x_m[element]), float(self._y_m[element]))
        blur_m = np.hypot(contact_blur_m, self._blur_m[element])
        gain = uneven_gain(over.x_m, over.y_m, self._scene.effects.unevenness)
        return path.force_n + gain * self._scene.contact.force_variation_n(self.surface, over, blur_m)

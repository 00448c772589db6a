"""What a TSF-85 fingertip measures while it goes along a path.

Dynamic channel: rate of change of the force on the skin, 50 to 450 Hz, sampled at 1 kHz. Static channel: the pressure
on 28 taxels at 60 Hz. The counts per newton are ours: none are published.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from texture_core.arrays import Array
from texture_drivers.tsf85.tables import RATE_HZ, STATIC_COLUMNS, STATIC_RATE_HZ, STATIC_ROWS
from texture_simulation.effects import uneven_gain
from texture_simulation.path import Path
from texture_simulation.scene import Scene
from texture_simulation.surfaces import Surface

OVERSAMPLING = 2  # so that what lies above the band is filtered and not folded into it
PATH_RATE_HZ = OVERSAMPLING * RATE_HZ
COUNTS_PER_N_S = 60.0
BAND = np.concatenate(
    [
        filters.butter(1, 50.0, 'highpass', fs=PATH_RATE_HZ, output='sos'),
        filters.butter(4, 450.0, 'lowpass', fs=PATH_RATE_HZ, output='sos'),
    ]
)
STATIC_COUNTS_PER_N = 3000.0
STATIC_BASELINE = (9000.0, 30000.0)  # range met in the field, without load
TAXEL_PITCH_M = 4e-3
TAXEL_BLUR_M = 1e-3
CONTACT_RADIUS_M = 6e-3  # of the pressed area at 1 N
SAMPLE_SIZE_M = 0.1  # where on the sample a slide begins is drawn from so much


Integer = TypeVar('Integer', bound=np.integer[Any])


def _quantised(counts: Array, kind: type[Integer]) -> NDArray[Integer]:
    """Return counts as the converter gives them: whole, and within its range."""
    limits = np.iinfo(kind)
    whole: NDArray[Integer] = np.clip(np.rint(counts), limits.min, limits.max).astype(kind)
    return whole


def _tick_from(point: int) -> int:
    """Return the first tick of the static channel at or after a point of the path."""
    return math.ceil(point * STATIC_RATE_HZ / PATH_RATE_HZ)


class Tsf85Model:
    """Turn a path, block by block, into the sensor's counts; what lies between the blocks is continuous.

    Parameters
    ----------
    scene
        How the finger feels.
    surface
        What it feels; may be changed between blocks.
    rng
        All randomness: taxel baselines, where a sample is touched, noise.
    """

    def __init__(self, scene: Scene, surface: Surface, rng: np.random.Generator) -> None:
        self.surface = surface
        self._scene = scene
        self._rng = rng
        self._force_before_n: float | None = None
        self._filter = np.zeros((len(BAND), 2))
        self._points = 0
        columns, rows = np.meshgrid(np.arange(STATIC_COLUMNS), np.arange(STATIC_ROWS))
        self._taxel_x_m = (columns.ravel() - (STATIC_COLUMNS - 1) / 2) * TAXEL_PITCH_M
        self._taxel_y_m = (rows.ravel() - (STATIC_ROWS - 1) / 2) * TAXEL_PITCH_M
        self._baseline = rng.uniform(*STATIC_BASELINE, len(self._taxel_x_m))
        self._origin_m = (0.0, 0.0)
        self.touch_elsewhere()

    def touch_elsewhere(self) -> None:
        """Let the sample lie otherwise from now on: no two touches meet the same place."""
        x_m, y_m = self._rng.uniform(0.0, SAMPLE_SIZE_M, 2)
        self._origin_m = (float(x_m), float(y_m))

    def advance(self, path: Path) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
        """Return what is measured along the next piece of path.

        Parameters
        ----------
        path
            Points at `PATH_RATE_HZ`, `OVERSAMPLING` a sample; a sample is taken at the last of its points.

        Returns
        -------
        dynamic : (n_points / OVERSAMPLING,) counts
        images : (n_images, 28) counts
            Those whose time, at 60 Hz from the very first point on, lies in this piece.
        """
        placed = path.moved(*self._origin_m)
        return self._dynamic(placed), self._images(placed)

    def _dynamic(self, path: Path) -> NDArray[np.int16]:
        contact, effects = self._scene.contact, self._scene.effects
        texture_n = contact.force_variation_n(self.surface, path, contact.blur_at_m(path.force_n))
        force_n = path.force_n + uneven_gain(path.x_m, path.y_m, effects.unevenness) * texture_n
        before = force_n[:1] if self._force_before_n is None else np.array([self._force_before_n])
        self._force_before_n = float(force_n[-1])
        rate_n_s = np.diff(force_n, prepend=before) * PATH_RATE_HZ
        band, self._filter = filters.sosfilt(BAND, COUNTS_PER_N_S * rate_n_s, zi=self._filter)
        counts = band[OVERSAMPLING - 1 :: OVERSAMPLING]
        return _quantised(counts + effects.noise_count * self._rng.standard_normal(len(counts)), np.int16)

    def _images(self, path: Path) -> NDArray[np.uint16]:
        at = path.at(self._image_points(len(path)))
        taxels = len(self._baseline)
        if not len(at):
            return np.empty((0, taxels), dtype=np.uint16)
        contact, effects = self._scene.contact, self._scene.effects
        under = Path(
            (at.x_m[:, None] + self._taxel_x_m).ravel(),
            (at.y_m[:, None] + self._taxel_y_m).ravel(),
            np.repeat(at.force_n, taxels),
        )
        texture_n = contact.force_variation_n(self.surface, under, np.full(len(under), TAXEL_BLUR_M))
        gain = uneven_gain(at.x_m, at.y_m, effects.unevenness)[:, None]
        pressed_n = self._shares(at.force_n) * (at.force_n[:, None] + gain * texture_n.reshape(-1, taxels))
        counts = self._baseline + STATIC_COUNTS_PER_N * pressed_n
        return _quantised(counts + effects.static_noise_count * self._rng.standard_normal(counts.shape), np.uint16)

    def _image_points(self, n_points: int) -> NDArray[np.intp]:
        """Return which of the next points of the path fall on a tick of the static channel."""
        end = self._points + n_points
        ticks = np.arange(_tick_from(self._points), _tick_from(end))
        points: NDArray[np.intp] = np.floor(ticks * PATH_RATE_HZ / STATIC_RATE_HZ).astype(np.intp) - self._points
        self._points = end
        return points

    def _shares(self, force_n: Array) -> Array:
        """Return the share of the force on each taxel, (n, 28): a dome as wide as the contact, roughly Hertz."""
        radius_m = CONTACT_RADIUS_M * np.cbrt(np.maximum(force_n, 1e-9))[:, None]
        dome = np.maximum(0.0, 1 - (self._taxel_x_m**2 + self._taxel_y_m**2) / radius_m**2)
        shares: Array = dome / np.maximum(dome.sum(axis=1, keepdims=True), 1e-9)
        return shares

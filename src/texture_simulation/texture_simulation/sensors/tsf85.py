"""What a TSF-85 fingertip measures while it goes along a path.

Dynamic channel: rate of change of the force on the skin, 50 to 450 Hz, sampled at 1 kHz. Static channel: the pressure
on the taxels. The counts per newton are ours: none are published.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from texture_core.arrays import Array, Samples
from texture_drivers.tsf85 import tables
from texture_drivers.tsf85.tables import RATE_HZ, TSF85, Tsf85Layout
from texture_simulation.filters import Filter
from texture_simulation.scene import Scene
from texture_simulation.sensors.converter import Converter
from texture_simulation.sensors.model import SensorKind, SimulatedStream, individual_rng
from texture_simulation.skin_contact import SkinContact
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory

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
FAST_LIMITS, SLOW_LIMITS = (-(2**15), 2**15 - 1), (0, 2**16 - 1)


class Tsf85Model:
    """Turn a path, block by block, into the sensor's counts; see `sensors.model.MakeModel` for the arguments.

    Parameters
    ----------
    layout
        Kind of fingertip: how many taxels, and how often they are read.
    """

    def __init__(
        self,
        scene: Scene,
        surface: Surface,
        rng: np.random.Generator,
        layout: Tsf85Layout = TSF85,
        *,
        finger: int = 0,
        batch_shape: tuple[int, ...] = (),
        settled: bool = False,
    ) -> None:
        self.touch = SkinContact(scene, surface, rng, PATH_RATE_HZ, finger=finger, batch_shape=batch_shape)
        self._static_rate_hz = layout.static_rate_hz
        self._force_before_n: Array | None = None
        self._band = Filter(BAND, settled=settled)
        self._points = 0
        rows, columns = np.divmod(np.arange(layout.rows * layout.columns), layout.columns)
        self._taxel_x_m = (columns[:, None] - (layout.columns - 1) / 2) * TAXEL_PITCH_M
        self._taxel_y_m = (rows[:, None] - (layout.rows - 1) / 2) * TAXEL_PITCH_M
        self._baseline = individual_rng(finger).uniform(*STATIC_BASELINE, len(rows))
        self._fast = Converter(scene, rng, RATE_HZ, 1, FAST_LIMITS, batch_shape=batch_shape)
        self._slow = Converter(
            scene, rng, layout.static_rate_hz, len(rows), SLOW_LIMITS, batch_shape=batch_shape, slow=True
        )

    def streams(self, path: Trajectory, *, slow: bool = True) -> Mapping[str, Samples]:
        """Return the dynamic channel, and the taxels if wanted, in counts."""
        placed = self.touch.placed(path)
        fast = {'signal': self._fast.exact(self._dynamic(placed))}
        return {**fast, 'signal_static': self._slow.exact(self._images(placed))} if slow else fast

    def advance(self, path: Trajectory) -> tuple[NDArray[np.int16], NDArray[np.uint16]]:
        """Return what is measured along the next piece of path.

        Parameters
        ----------
        path
            Points at `PATH_RATE_HZ`, `OVERSAMPLING` a sample; a sample is taken at the last of its points.

        Returns
        -------
        dynamic : (n_points / OVERSAMPLING,) counts
        images : (n_images, n_taxels) counts
            Those whose time, from the very first point on, lies in this piece.
        """
        placed = self.touch.placed(path)
        dynamic = self._fast.counts(self._dynamic(placed), np.int16)
        return dynamic[..., 0], self._slow.counts(self._images(placed), np.uint16)

    def _dynamic(self, placed: Trajectory) -> Samples:
        force_n = placed.force_n + self.touch.variation_n(placed)
        before = force_n[..., :1] if self._force_before_n is None else self._force_before_n
        self._force_before_n = force_n[..., -1:]
        rate_n_s = np.diff(force_n, prepend=before) * PATH_RATE_HZ
        return self._band(COUNTS_PER_N_S * rate_n_s)[..., OVERSAMPLING - 1 :: OVERSAMPLING, None]

    def _images(self, placed: Trajectory) -> Samples:
        at = placed.at(self._image_points(len(placed)))
        texture_n = self.touch.static_variation_n(at, TAXEL_BLUR_M, (self._taxel_x_m, self._taxel_y_m))
        pressed_n = self._shares(at.force_n) * (at.force_n[..., None, :] + texture_n)
        return self._baseline + STATIC_COUNTS_PER_N * np.swapaxes(pressed_n, -1, -2)

    def _image_points(self, n_points: int) -> NDArray[np.intp]:
        """Return which of the next points of the path fall on a tick of the static channel."""
        end = self._points + n_points
        ticks = np.arange(self._tick_from(self._points), self._tick_from(end))
        points: NDArray[np.intp] = np.floor(ticks * PATH_RATE_HZ / self._static_rate_hz).astype(np.intp) - self._points
        self._points = end
        return points

    def _tick_from(self, point: int) -> int:
        """Return the first tick of the static channel at or after a point of the path."""
        return math.ceil(point * self._static_rate_hz / PATH_RATE_HZ)

    def _shares(self, force_n: Array) -> Array:
        """Return the share of the force on each taxel, (..., n_taxels, n): a dome as wide as the contact, as Hertz'."""
        radius_m = CONTACT_RADIUS_M * np.cbrt(np.maximum(force_n, 1e-9))[..., None, :]
        dome = np.maximum(0.0, 1 - (self._taxel_x_m**2 + self._taxel_y_m**2) / radius_m**2)
        shares: Array = dome / np.maximum(dome.sum(axis=-2, keepdims=True), 1e-9)
        return shares


def tsf85_kind(layout: Tsf85Layout) -> SensorKind:
    """Return a kind of TSF-85."""
    return SensorKind(
        make=partial(Tsf85Model, layout=layout),
        path_rate_hz=PATH_RATE_HZ,
        step_points=OVERSAMPLING,
        streams=(
            SimulatedStream('signal', tables.DYNAMIC_SENSOR, tables.DYNAMIC_CHANNELS, tables.UNIT, RATE_HZ),
            SimulatedStream(
                'signal_static', tables.STATIC_SENSOR, layout.static_channels, tables.UNIT, layout.static_rate_hz
            ),
        ),
    )

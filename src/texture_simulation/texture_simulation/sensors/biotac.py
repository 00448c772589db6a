"""What a BioTac fingertip measures while it goes along a path.

PAC: pressure of the fluid between 10 and 1040 Hz. PDC: that pressure itself. Electrodes: the fluid over them, which the
load squeezes away. TDC, TAC: the finger is cooled by what it touches. Bands and resolutions of the pressures are those
of the manual; the sensitivities are ours, in the order of magnitude of public recordings of slides at 10 N.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from texture_core.arrays import Array, Samples
from texture_drivers.biotac import tables
from texture_drivers.biotac.tables import FULL_SCALE, PAC, SLOT_RATE_HZ, BioTacLayout
from texture_simulation.filters import Filter
from texture_simulation.scene import Scene
from texture_simulation.sensors.converter import Converter
from texture_simulation.sensors.model import SensorKind, SimulatedStream, individual_rng
from texture_simulation.skin_contact import SkinContact
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory

OVERSAMPLING = 1  # points of the path in a slot: at 0.4 m/s and below the skin blurs what 4.4 kHz would fold down
PATH_RATE_HZ = OVERSAMPLING * SLOT_RATE_HZ
PA_PER_N = 1500.0  # fluid pressure
PAC_PA, PDC_PA = 0.37, 36.5  # of a count
PAC_BASELINE, PDC_BASELINE = 2030.0, 2200.0  # PAC idles at mid-scale: 2020 to 2035 in the QuickStart Guide's sample
PAC_BAND = np.concatenate(
    [
        filters.butter(1, 10.0, 'highpass', fs=PATH_RATE_HZ, output='sos'),
        filters.butter(2, 1040.0, 'lowpass', fs=PATH_RATE_HZ, output='sos'),
    ]
)
PAC_POINTS = slice(2 * OVERSAMPLING - 1, None, 2 * OVERSAMPLING)  # PAC is sampled in every second slot, at its end
ELECTRODE_BASELINE = (2800.0, 3400.0)  # range of the electrodes without load
ELECTRODE_COUNTS_PER_N = 400.0  # of the electrode under the load; falls off with the distance
ELECTRODE_PITCH_M = 3e-3
COLUMNS = 4
CONTACT_RADIUS_M = 5e-3
ELECTRODE_BLUR_M = 1.5e-3
TDC_BASELINE, TAC_BASELINE = 2400.0, 2100.0
TDC_FALL = 30.0  # counts, after a long touch
TAC_PER_TDC_S = 20.0
TOUCH_S = 4.0  # time constant of cooling and warming
EFFECT_SCALE = 0.1  # counts of 12 bits; an idle PAC stays within a few (QuickStart Guide), a TSF-85 within some tens
LIMITS = (0, FULL_SCALE)


class BioTacModel:
    """Turn a path, frame by frame, into the sensor's counts; see `sensors.model.MakeModel` for the arguments.

    Parameters
    ----------
    layout
        Kind of BioTac.
    """

    def __init__(
        self,
        scene: Scene,
        surface: Surface,
        rng: np.random.Generator,
        layout: BioTacLayout,
        *,
        finger: int = 0,
        batch_shape: tuple[int, ...] = (),
        settled: bool = False,
    ) -> None:
        self.touch = SkinContact(scene, surface, rng, PATH_RATE_HZ, finger=finger, batch_shape=batch_shape)
        self._layout = layout
        self._band = Filter(PAC_BAND, settled=settled)
        step = 1 - np.exp(-layout.frame_s / TOUCH_S)
        self._cool = Filter(np.array([[step, 0.0, 0.0, 1.0, step - 1, 0.0]]))
        self._cooled: Array | None = None  # share of the fall of temperature, (..., 1)
        row, column = np.divmod(np.arange(layout.electrodes)[:, None], COLUMNS)
        self._x_m = (column - (COLUMNS - 1) / 2) * ELECTRODE_PITCH_M
        self._y_m = (row - (layout.electrodes // COLUMNS) / 2) * ELECTRODE_PITCH_M
        self._baseline = individual_rng(finger).uniform(*ELECTRODE_BASELINE, (layout.electrodes, 1))
        slow = len(layout.slow_slots)
        self._fast = Converter(scene, rng, layout.pac_rate_hz, 1, LIMITS, batch_shape=batch_shape, scale=EFFECT_SCALE)
        self._slow = Converter(
            scene, rng, layout.frame_rate_hz, slow, LIMITS, batch_shape=batch_shape, slow=True, scale=EFFECT_SCALE
        )

    @property
    def points_per_frame(self) -> int:
        """Points of the path, at 4.4 kHz, that one frame takes."""
        return points_per_frame(self._layout)

    def streams(self, path: Trajectory, *, slow: bool = True) -> Mapping[str, Samples]:
        """Return PAC, and the slow channels if wanted, in counts."""
        placed, pressure_pa = self._pressure_pa(path)
        fast = {'signal': self._fast.exact(self._pac(pressure_pa))}
        return {**fast, 'signal_static': self._slow.exact(self._frames(placed, pressure_pa))} if slow else fast

    def advance(self, path: Trajectory) -> NDArray[np.uint16]:
        """Return what is measured along the next piece of path.

        Parameters
        ----------
        path
            Points at 4.4 kHz, whole frames of them; slot i is sampled at point i.

        Returns
        -------
        (n_frames, n_slots) counts
        """
        streams = self.streams(path)
        frames = streams['signal_static']
        counts = np.empty((*frames.shape[:-1], len(self._layout.slots)), dtype=np.uint16)
        pac = [channel == PAC for channel in self._layout.slots]
        counts[..., pac] = streams['signal'].reshape(*frames.shape[:-1], self._layout.pac_per_frame)
        counts[..., list(self._layout.slow_slots)] = frames
        return counts

    def _pressure_pa(self, path: Trajectory) -> tuple[Trajectory, Array]:
        """Return where the skin goes, and the pressure in the finger there, (..., n)."""
        placed = self.touch.placed(path)
        return placed, PA_PER_N * (placed.force_n + self.touch.variation_n(placed))

    def _pac(self, pressure_pa: Array) -> Samples:
        """Return PAC, (..., n_samples, 1) counts."""
        return PAC_BASELINE + self._band(pressure_pa)[..., PAC_POINTS, None] / PAC_PA

    def _frames(self, placed: Trajectory, pressure_pa: Array) -> Samples:
        """Return the slow channels at the start of each frame, (..., n_frames, n_slow_channels) counts."""
        starts = slice(0, None, self.points_per_frame)
        at = placed.at(starts)
        pdc = PDC_BASELINE + pressure_pa[..., starts, None] / PDC_PA
        electrodes = np.swapaxes(self._electrodes(at), -1, -2)
        return np.concatenate([*self._temperatures(at.force_n > 0), pdc, electrodes], axis=-1)

    def _temperatures(self, touching: NDArray[np.bool_]) -> tuple[Samples, Samples]:
        """Return the temperature and its flow at each frame, (..., n_frames, 1) counts each: a lag of first order."""
        cooled = self._cool(touching.astype(np.float64))
        before = np.zeros_like(cooled[..., :1]) if self._cooled is None else self._cooled
        rate_1_s = np.diff(cooled, prepend=before) / self._layout.frame_s
        self._cooled = cooled[..., -1:] if cooled.shape[-1] else self._cooled
        return (
            (TDC_BASELINE - TDC_FALL * cooled)[..., None],
            (TAC_BASELINE - TAC_PER_TDC_S * TDC_FALL * rate_1_s)[..., None],
        )

    def _electrodes(self, at: Trajectory) -> Array:
        """Return the electrodes at each frame, (..., n_electrodes, n_frames) counts: low where the load is."""
        force_n = at.force_n[..., None, :]
        radius_m = self.touch.patch_share * CONTACT_RADIUS_M * np.cbrt(np.maximum(force_n, 1e-9))
        x_m, y_m = (
            np.asarray(centre)[..., None, :] if np.ndim(centre) else centre for centre in self.touch.centre_m(at)
        )
        nearness = np.maximum(0.0, 1 - ((self._x_m - x_m) ** 2 + (self._y_m - y_m) ** 2) / radius_m**2)
        texture_n = self.touch.static_variation_n(at, ELECTRODE_BLUR_M, (self._x_m, self._y_m))
        # Squeezing stiffens: the fluid over an electrode thins out, and never vanishes.
        load = np.maximum(ELECTRODE_COUNTS_PER_N * nearness * (force_n + texture_n), 0.0)
        counts: Array = self._baseline / (1 + load / self._baseline)
        return counts


def points_per_frame(layout: BioTacLayout) -> int:
    """Return how many points of the path, at 4.4 kHz, one frame takes."""
    return OVERSAMPLING * len(layout.slots)


def biotac_kind(layout: BioTacLayout) -> SensorKind:
    """Return a kind of BioTac."""
    return SensorKind(
        make=partial(BioTacModel, layout=layout),
        path_rate_hz=PATH_RATE_HZ,
        step_points=points_per_frame(layout),
        streams=(
            SimulatedStream('signal', tables.PAC_SENSOR, (PAC,), tables.UNIT, layout.pac_rate_hz, 1 / SLOT_RATE_HZ),
            SimulatedStream(
                'signal_static', tables.SLOW_SENSOR, layout.slow_channels, tables.UNIT, layout.frame_rate_hz
            ),
        ),
    )

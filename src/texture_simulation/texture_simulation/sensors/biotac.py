"""What a BioTac fingertip measures while it goes along a path.

PAC: pressure of the fluid between 10 and 1040 Hz. PDC: that pressure itself. Electrodes: the fluid over them, which the
load squeezes away. TDC, TAC: the finger is cooled by what it touches. Bands and resolutions of the pressures are those
of the manual; the sensitivities are ours, in the order of magnitude of public recordings of slides at 10 N.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from texture_core.arrays import Array
from texture_drivers.biotac.tables import FULL_SCALE, PAC, SLOT_RATE_HZ, Layout
from texture_simulation.effects import uneven_gain
from texture_simulation.path import Path
from texture_simulation.scene import Scene
from texture_simulation.surfaces import Surface

OVERSAMPLING = 2  # points of the path in a slot
PATH_RATE_HZ = OVERSAMPLING * SLOT_RATE_HZ
PA_PER_N = 1500.0  # fluid pressure
PAC_PA, PDC_PA = 0.37, 36.5  # of a count
PAC_REST, PDC_REST = 2030.0, 2200.0  # PAC idles at mid-scale: 2020 to 2035 in the QuickStart Guide's sample
PAC_BAND = np.concatenate(
    [
        filters.butter(1, 10.0, 'highpass', fs=PATH_RATE_HZ, output='sos'),
        filters.butter(2, 1040.0, 'lowpass', fs=PATH_RATE_HZ, output='sos'),
    ]
)
ELECTRODE_REST = (2800.0, 3400.0)  # range of the electrodes without load
ELECTRODE_COUNTS_PER_N = 400.0  # of the electrode under the load; falls off with the distance
ELECTRODE_PITCH_M = 3e-3
CONTACT_RADIUS_M = 5e-3
ELECTRODE_BLUR_M = 1.5e-3
TDC_REST, TAC_REST = 2400.0, 2100.0
TDC_FALL = 30.0  # counts, after a long touch
TAC_PER_TDC_S = 20.0
TOUCH_S = 4.0  # time constant of cooling and warming
SAMPLE_SIZE_M = 0.1
NOISE_SHARE = 0.1  # the scene's noise is that of a TSF-85; an idle PAC stays within a few counts (QuickStart Guide)


class BioTacModel:
    """Turn a path, frame by frame, into the sensor's counts; what lies between the blocks is continuous.

    Parameters
    ----------
    scene
        How the finger feels.
    surface
        What it feels; may be changed between blocks.
    rng
        All randomness: electrodes at rest, where a sample is touched, noise.
    layout
        Kind of BioTac.
    """

    def __init__(self, scene: Scene, surface: Surface, rng: np.random.Generator, layout: Layout) -> None:
        self.surface = surface
        self._scene = scene
        self._rng = rng
        self._layout = layout
        self._filter = np.zeros((len(PAC_BAND), 2))
        self._cooled = 0.0  # share of the fall of temperature
        self._pac_slots = np.array([channel == PAC for channel in layout.slots])
        columns = 4
        places = np.arange(layout.electrodes)
        self._x_m = (places % columns - (columns - 1) / 2) * ELECTRODE_PITCH_M
        self._y_m = (places // columns - (layout.electrodes // columns) / 2) * ELECTRODE_PITCH_M
        self._rest = rng.uniform(*ELECTRODE_REST, layout.electrodes)
        self._origin_m = (0.0, 0.0)
        self.touch_elsewhere()

    @property
    def points_per_frame(self) -> int:
        """Points of the path, at 8.8 kHz, that one frame takes."""
        return OVERSAMPLING * len(self._layout.slots)

    def touch_elsewhere(self) -> None:
        """Let the sample lie otherwise from now on: no two touches meet the same place."""
        x_m, y_m = self._rng.uniform(0.0, SAMPLE_SIZE_M, 2)
        self._origin_m = (float(x_m), float(y_m))

    def advance(self, path: Path) -> NDArray[np.uint16]:
        """Return what is measured along the next piece of path.

        Parameters
        ----------
        path
            Points at 8.8 kHz, whole frames of them; slot i is sampled at point 2·i + 1.

        Returns
        -------
        (n_frames, n_slots) counts
        """
        placed = path.moved(*self._origin_m)
        texture_n = self._texture_n(placed, self._scene.contact.blur_at_m(placed.force_n))
        pressure_pa = PA_PER_N * (placed.force_n + texture_n)
        band_pa, self._filter = filters.sosfilt(PAC_BAND, pressure_pa, zi=self._filter)
        sampled = slice(OVERSAMPLING - 1, None, OVERSAMPLING)
        counts = (PAC_REST + band_pa[sampled] / PAC_PA).reshape(-1, len(self._layout.slots))
        starts = np.arange(0, len(path), self.points_per_frame)
        counts[:, list(self._layout.slow_slots)] = self._slow(placed.at(starts), pressure_pa[starts])
        effects = self._scene.effects
        noise = NOISE_SHARE * np.where(self._pac_slots, effects.noise_count, effects.static_noise_count)
        noisy: Array = counts + noise * self._rng.standard_normal(counts.shape)
        return np.clip(np.rint(noisy), 0, FULL_SCALE).astype(np.uint16)

    def _texture_n(self, path: Path, blur_m: Array) -> Array:
        """Return how the texture changes the force, (n,)."""
        gain = uneven_gain(path.x_m, path.y_m, self._scene.effects.unevenness)
        return gain * self._scene.contact.force_variation_n(self.surface, path, blur_m)

    def _slow(self, path: Path, pressure_pa: Array) -> Array:
        """Return the slow channels at the start of each frame, (n_frames, n_slow_channels)."""
        cooled = self._cool(path.force_n > 0)
        rate_1_s = np.diff(cooled, prepend=self._cooled) / self._layout.frame_s
        self._cooled = float(cooled[-1]) if len(cooled) else self._cooled
        tdc = TDC_REST - TDC_FALL * cooled
        tac = TAC_REST - TAC_PER_TDC_S * TDC_FALL * rate_1_s
        pdc = PDC_REST + pressure_pa / PDC_PA
        return np.column_stack([tdc, tac, pdc, self._electrodes(path)])

    def _cool(self, touching: NDArray[np.bool_]) -> Array:
        """Return how far the finger has cooled at each frame, (n_frames,): a lag of first order."""
        step = 1 - np.exp(-self._layout.frame_s / TOUCH_S)
        start = [(1 - step) * self._cooled]
        cooled, _ = filters.lfilter([step], [1, step - 1], touching.astype(np.float64), zi=start)
        return np.asarray(cooled, dtype=np.float64)

    def _electrodes(self, path: Path) -> Array:
        """Return the electrodes at each frame, (n_frames, n_electrodes): low where the load is."""
        force_n = path.force_n[:, None]
        radius_m = CONTACT_RADIUS_M * np.cbrt(np.maximum(force_n, 1e-9))
        nearness = np.maximum(0.0, 1 - (self._x_m**2 + self._y_m**2) / radius_m**2)
        n = len(self._rest)
        over = Path(
            (path.x_m[:, None] + self._x_m).ravel(),
            (path.y_m[:, None] + self._y_m).ravel(),
            np.repeat(path.force_n, n),
        )
        texture_n = self._texture_n(over, np.full(len(over), ELECTRODE_BLUR_M)).reshape(-1, n)
        # Squeezing stiffens: the fluid over an electrode thins out, and never vanishes.
        load = np.maximum(ELECTRODE_COUNTS_PER_N * nearness * (force_n + texture_n), 0.0)
        counts: Array = self._rest / (1 + load / self._rest)
        return counts

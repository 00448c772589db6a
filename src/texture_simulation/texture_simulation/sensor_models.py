# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""How each finger turns contact into samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal as filters

from texture_core.types import Array, Samples
from texture_drivers import anyskin, biotac, daq, pvdf, tsf85
from texture_drivers.biotac import FULL_SCALE, PAC, SLOT_RATE_HZ, BioTacLayout
from texture_drivers.biotac import LAYOUTS as BIOTACS
from texture_drivers.tsf85 import LAYOUTS as TSF85S
from texture_drivers.tsf85 import RATE_HZ, TSF85, Tsf85Layout
from texture_simulation.contact import SkinContact
from texture_simulation.devices import fingers as devices
from texture_simulation.effects import BatchShape
from texture_simulation.path import Filter, Trajectory, before_first
from texture_simulation.scene import Scene
from texture_simulation.surfaces import Surface

# --------------------
# From exact values to what a converter sends, with the effects on the way.


class Converter:
    """Turn samples of one stream into whole counts within a range."""

    def __init__(
        self,
        scene: Scene,
        rng: np.random.Generator,
        rate_hz: float,
        channels: int,
        limits: tuple[int, int],
        *,
        batch_shape: BatchShape,
        slow: bool = False,
        scale: float = 1.0,
    ) -> None:
        self._limits = limits
        self._scale = scale
        self._filters = [
            effect.start_signal(rng, rate_hz, batch_shape, channels, slow=slow)
            for effect in scene.effects_of('start_signal')
        ]

    def exact(self, counts: Samples) -> Samples:
        """Return the next samples, (..., n_samples, n_channels), with the effects, clipped and whole."""
        if self._filters:
            counts = counts / self._scale
            for apply in self._filters:
                counts = apply(counts)
            counts = counts * self._scale
        whole = np.rint(counts)
        return np.clip(whole, *self._limits, out=whole)


# --------------------
# What every simulated sensor has in common.


class SensorModel:
    """Turn a path, block by block, into what a sensor publishes; what lies between the blocks is continuous."""

    PATH_RATE_HZ: float  # points of the path a second
    UNIT_PER_COUNT: ClassVar[
        Mapping[str, float]
    ] = {}  # by topic, where the driver publishes another unit than the device sends

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
        self.touch = SkinContact(scene, surface, rng, self.PATH_RATE_HZ, finger=finger, batch_shape=batch_shape)
        self._finger = finger
        self._converter = partial(Converter, scene, rng, batch_shape=batch_shape)
        self._filter = partial(Filter, settled=settled)

    def measure(self, path: Trajectory, *, slow: bool = True) -> dict[str, Samples]:
        """Return what the device sends along the next section of path, by topic, (..., n_samples, n_channels)."""
        raise NotImplementedError

    def streams(self, path: Trajectory, *, slow: bool = True) -> Mapping[str, Samples]:
        """Return the same in the units that the driver publishes."""
        measured = self.measure(path, slow=slow)
        for topic in measured.keys() & self.UNIT_PER_COUNT.keys():
            measured[topic] = self.UNIT_PER_COUNT[topic] * measured[topic]
        return measured

    def _pressed_n(self, path: Trajectory) -> tuple[Trajectory, Array]:
        """Return where the skin goes, and the force on it there, (..., n)."""
        placed = self.touch.placed(path)
        return placed, placed.force_n + self.touch.variation_n(placed)


class SimulatedStream(NamedTuple):
    """What a topic holds."""

    topic: str
    sensor: str
    channels: tuple[str, ...]
    unit: str
    rate_hz: float
    delay_s: float = 0.0  # of the first sample, after the beginning


class SensorKind(NamedTuple):
    """A simulated sensor, and the emulated device through which it sends live."""

    make: Callable[..., SensorModel]  # from the arguments of `SensorModel`
    device: Callable[[Path, np.random.Generator], devices.EmulatedDevice]  # from its link
    path_rate_hz: float  # points of the path a second, as the model takes them
    step_points: int  # points of a frame or sample: the device is given multiples of these
    streams: tuple[SimulatedStream, ...]  # what the driver publishes; the fast one first

    @property
    def fast(self) -> SimulatedStream:
        """The fast stream."""
        return self.streams[0]


def individual_rng(finger: int) -> np.random.Generator:
    """Return the randomness out of which an individual of a sensor is made."""
    return np.random.default_rng([finger, 7])


# --------------------
# What a BioTac fingertip measures while it goes along a path.
#
# PAC: pressure of the fluid between 10 and 1040 Hz. PDC: that pressure itself. Electrodes: the fluid over them, which
# the load squeezes away. TDC, TAC: the finger is cooled by what it touches. Bands and resolutions of the pressures are
# those of the manual; the sensitivities are ours, in the order of magnitude of public recordings of slides at 10 N.

# A point of the path in a slot: at 0.4 m/s and below the skin blurs what 4.4 kHz would fold down.
BIOTAC_PATH_RATE_HZ = SLOT_RATE_HZ
PA_PER_N = 1500.0  # fluid pressure
PAC_PA, PDC_PA = 0.37, 36.5  # of a count
PAC_BASELINE, PDC_BASELINE = 2030.0, 2200.0  # PAC idles at mid-scale: 2020 to 2035 in the QuickStart Guide's sample
PAC_BAND = np.concatenate(
    [
        filters.butter(1, 10.0, 'highpass', fs=BIOTAC_PATH_RATE_HZ, output='sos'),
        filters.butter(2, 1040.0, 'lowpass', fs=BIOTAC_PATH_RATE_HZ, output='sos'),
    ]
)
PAC_POINTS = slice(1, None, 2)  # PAC is sampled in every second slot, at its end
ELECTRODE_BASELINE = (2800.0, 3400.0)  # range of the electrodes without load
ELECTRODE_COUNTS_PER_N = 400.0  # of the electrode under the load; falls off with the distance
ELECTRODE_PITCH_M = 3e-3
COLUMNS = 4
BIOTAC_CONTACT_RADIUS_M = 5e-3
ELECTRODE_BLUR_M = 1.5e-3
TDC_BASELINE, TAC_BASELINE = 2400.0, 2100.0
TDC_FALL = 30.0  # counts, after a long touch
TAC_PER_TDC_S = 20.0
TOUCH_S = 4.0  # time constant of cooling and warming
EFFECT_SCALE = 0.1  # counts of 12 bits; an idle PAC stays within a few (QuickStart Guide), a TSF-85 within some tens
BIOTAC_LIMITS = (0, FULL_SCALE)


class BioTacModel(SensorModel):
    """Turn a path, frame by frame, into the sensor's counts; see `SensorModel` for the arguments."""

    PATH_RATE_HZ = BIOTAC_PATH_RATE_HZ

    def __init__(self, *touched: Any, layout: BioTacLayout, **individual: Any) -> None:
        super().__init__(*touched, **individual)
        self._layout = layout
        self._band = self._filter(PAC_BAND)
        step = 1 - np.exp(-layout.frame_s / TOUCH_S)
        self._cool = Filter(np.array([[step, 0.0, 0.0, 1.0, step - 1, 0.0]]))
        self._cooled: Array | None = None  # fraction of the fall of temperature, (..., 1)
        row, column = np.divmod(np.arange(layout.electrodes)[:, None], COLUMNS)
        self._x_m = (column - (COLUMNS - 1) / 2) * ELECTRODE_PITCH_M
        self._y_m = (row - (layout.electrodes // COLUMNS) / 2) * ELECTRODE_PITCH_M
        self._baseline = individual_rng(self._finger).uniform(*ELECTRODE_BASELINE, (layout.electrodes, 1))
        convert = partial(self._converter, limits=BIOTAC_LIMITS, scale=EFFECT_SCALE)
        self._fast = convert(layout.pac_rate_hz, 1)
        self._slow = convert(layout.frame_rate_hz, len(layout.slow_slots), slow=True)

    def measure(self, path: Trajectory, *, slow: bool = True) -> dict[str, Samples]:
        """Return PAC, and the slow channels if wanted, in counts."""
        placed, pressed_n = self._pressed_n(path)
        pressure_pa = PA_PER_N * pressed_n  # in the fluid
        fast = {'signal': self._fast.exact(PAC_BASELINE + self._band(pressure_pa)[..., PAC_POINTS, None] / PAC_PA)}
        return {**fast, 'signal_static': self._slow.exact(self._frames(placed, pressure_pa))} if slow else fast

    def _frames(self, placed: Trajectory, pressure_pa: Array) -> Samples:
        """Return the slow channels at the start of each frame, (..., n_frames, n_slow_channels) counts."""
        starts = slice(0, None, len(self._layout.slots))
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
        radius_m = self.touch.patch_ratio * BIOTAC_CONTACT_RADIUS_M * np.cbrt(np.maximum(force_n, 1e-9))
        x_m, y_m = (
            np.asarray(centre)[..., None, :] if np.ndim(centre) else centre for centre in self.touch.centre_m(at)
        )
        nearness = np.maximum(0.0, 1 - ((self._x_m - x_m) ** 2 + (self._y_m - y_m) ** 2) / radius_m**2)
        texture_n = self.touch.static_variation_n(at, ELECTRODE_BLUR_M, (self._x_m, self._y_m))
        # Squeezing stiffens: the fluid over an electrode thins out, and never vanishes.
        load = np.maximum(ELECTRODE_COUNTS_PER_N * nearness * (force_n + texture_n), 0.0)
        return self._baseline / (1 + load / self._baseline)


def biotac_kind(layout: BioTacLayout) -> SensorKind:
    """Return a kind of BioTac."""
    return SensorKind(
        make=partial(BioTacModel, layout=layout),
        device=devices.EmulatedBioTac,
        path_rate_hz=BIOTAC_PATH_RATE_HZ,
        step_points=len(layout.slots),
        streams=(
            SimulatedStream('signal', biotac.PAC_SENSOR, (PAC,), biotac.UNIT, layout.pac_rate_hz, 1 / SLOT_RATE_HZ),
            SimulatedStream(
                'signal_static', biotac.SLOW_SENSOR, layout.slow_channels, biotac.UNIT, layout.frame_rate_hz
            ),
        ),
    )


# --------------------
# What the finger of Jamali & Sammut 2010 measures while it goes along a path.
#
# Four PVDF films and four strain gauges lie at random places in two layers of silicone. Each senses the pressure over
# its place, the blunter the deeper it lies: a film its changes (the charge leaks), a gauge the pressure itself. All
# pass a low-pass of 500 Hz and are sampled at 2.5 kHz. The sensitivities are ours: the paper gives none.

DAQ_RATE_HZ = daq.RATE_HZ
# A point a sample: the skin over an element averages over 0.2 mm and more, so that at 0.4 m/s and below nothing is left
# that 2.5 kHz would fold down; what is faster is blurred more (contact.py).
DAQ_PATH_RATE_HZ = DAQ_RATE_HZ
FILMS, GAUGES = 4, 4
ELEMENTS = FILMS + GAUGES
DAQ_CHANNELS = tuple(
    f'{element}_{layer}_{number}' for element in ('pvdf', 'strain') for layer in ('outer', 'inner') for number in (1, 2)
)  # as in the driver's daq.yaml
LAYER_BLUR_M = (1.5e-4, 4e-4)  # outer, inner; half of the films and half of the gauges lie in each
DAQ_BLUR_M = np.repeat(np.tile(LAYER_BLUR_M, 2), ELEMENTS // 4)[:, None]
PLACE_M = 4e-3  # largest distance of a place from the middle, along each side
VOLT_PER_N = (2.0, 6.0)  # range of the sensitivities
VOLT_PER_COUNT = 10.0 / 2**15
LEAK_HZ = 1.0  # corner of the films' amplifiers
DAQ_LEAK = filters.butter(1, LEAK_HZ, 'highpass', fs=DAQ_PATH_RATE_HZ, output='sos')
DAQ_BAND = filters.butter(4, 500.0, 'lowpass', fs=DAQ_PATH_RATE_HZ, output='sos')
DAQ_LIMITS = (-(2**15), 2**15 - 1)


class DaqModel(SensorModel):
    """Turn a path, block by block, into the converter's counts; see `SensorModel` for the arguments."""

    PATH_RATE_HZ = DAQ_PATH_RATE_HZ
    UNIT_PER_COUNT: ClassVar = {daq.TOPIC: VOLT_PER_COUNT}

    def __init__(self, *touched: Any, **individual: Any) -> None:
        super().__init__(*touched, **individual)
        self._offset_m, self.volt_per_n = _elements(self._finger)
        self._leak, self._band = self._filter(DAQ_LEAK), self._filter(DAQ_BAND)
        self._counts = self._converter(DAQ_RATE_HZ, ELEMENTS, DAQ_LIMITS)

    def measure(self, path: Trajectory, *, slow: bool = True) -> dict[str, Samples]:
        """Return the 8 channels in counts, (..., n_samples, 8)."""
        placed = self.touch.placed(path)
        # The force that each element senses, (..., 8, n).
        pressed_n = placed.force_n[..., None, :] + self.touch.variation_n(placed, DAQ_BLUR_M, self._offset_m)
        pressed_n[..., :FILMS, :] = self._leak(pressed_n[..., :FILMS, :])
        counts = np.swapaxes(self._band(pressed_n), -1, -2) * (self.volt_per_n / VOLT_PER_COUNT)
        return {daq.TOPIC: self._counts.exact(counts)}


@lru_cache(maxsize=16)
def _elements(finger: int) -> tuple[tuple[Array, Array], Array]:
    """Return where the elements of a finger lie, x and y, (8, 1) m each, and their sensitivities, (8,) V/N."""
    made = individual_rng(finger)
    offset_m = (made.uniform(-PLACE_M, PLACE_M, (ELEMENTS, 1)), made.uniform(-PLACE_M, PLACE_M, (ELEMENTS, 1)))
    return offset_m, made.uniform(*VOLT_PER_N, ELEMENTS) * made.choice([-1.0, 1.0], ELEMENTS)


DAQ_KIND = SensorKind(
    make=DaqModel,
    device=devices.EmulatedDaq,
    path_rate_hz=DAQ_PATH_RATE_HZ,
    step_points=1,
    streams=(SimulatedStream(daq.TOPIC, daq.SENSOR, DAQ_CHANNELS, 'V', DAQ_RATE_HZ),),
)


# --------------------
# What an AnySkin measures while it goes along a path: the field of its magnetic skin at five magnetometers.
#
# Where the skin is pressed and dragged the field changes in proportion to the force, which spreads over the
# magnetometers like a bell; their axes are not quite at right angles. All numbers are ours: none are published.

ANYSKIN_RATE_HZ = anyskin.USUAL_RATE_HZ
ANYSKIN_OVERSAMPLING = 10
ANYSKIN_PATH_RATE_HZ = ANYSKIN_OVERSAMPLING * ANYSKIN_RATE_HZ
SPACING_M = 5e-3
ANYSKIN_PLACES_M = ((0.0, 0.0), (SPACING_M, 0.0), (-SPACING_M, 0.0), (0.0, SPACING_M), (0.0, -SPACING_M))
ANYSKIN_BLUR_M = 4e-4
ANYSKIN_BAND = filters.butter(4, 40.0, 'lowpass', fs=ANYSKIN_PATH_RATE_HZ, output='sos')
FRICTION = 0.5  # fraction of the normal force that drags the skin while it slides
CREEP_M_S = 1e-3  # speed at which half of that is reached
CROSSTALK = 0.1  # standard deviation of what an axis of a magnetometer senses of another one
REACH_M = 5e-3  # distance from the middle at which a magnetometer senses e^-0.5 of the load of the middle
UT_PER_N = 600.0
UNLOADED_UT = 1500.0  # each axis of the field without load lies within plus and minus this
UT_PER_COUNT = 0.15
ANYSKIN_LIMITS = (
    -(2**15) * 10,
    2**15 * 10,
)  # ±49 mT: the magnetometer's range is wider than 16 bits at its finest step


class AnySkinModel(SensorModel):
    """Turn a path, block by block, into the field; see `SensorModel` for the arguments."""

    PATH_RATE_HZ = ANYSKIN_PATH_RATE_HZ

    def __init__(self, *touched: Any, **individual: Any) -> None:
        super().__init__(*touched, **individual)
        x_m, y_m = np.array(ANYSKIN_PLACES_M).T
        self._offset_m = x_m[:, None], y_m[:, None]
        fraction = np.exp(-0.5 * (x_m**2 + y_m**2) / REACH_M**2)
        self._fraction = (fraction / fraction.sum())[:, None]
        made = individual_rng(self._finger)
        self._coupling: Array = np.eye(3) + CROSSTALK * made.standard_normal((len(x_m), 3, 3))
        self._before: tuple[Array, Array] | None = None
        self._band = self._filter(ANYSKIN_BAND)
        channels = 3 * len(ANYSKIN_PLACES_M)
        self._unloaded_ut = individual_rng(self._finger).uniform(-UNLOADED_UT, UNLOADED_UT, channels)
        self._counts = self._converter(ANYSKIN_RATE_HZ, channels, ANYSKIN_LIMITS)

    def measure(self, path: Trajectory, *, slow: bool = True) -> dict[str, Samples]:
        """Return the field in µT, which the device itself computes, (..., n_samples, 15)."""
        forces_n = self._band(self._forces_n(path))[..., ANYSKIN_OVERSAMPLING - 1 :: ANYSKIN_OVERSAMPLING]
        by_channel = np.swapaxes(forces_n.reshape(*forces_n.shape[:-3], -1, forces_n.shape[-1]), -1, -2)
        counts = self._counts.exact((self._unloaded_ut + UT_PER_N * by_channel) / UT_PER_COUNT)
        return {anyskin.SIGNAL: UT_PER_COUNT * counts}

    def _forces_n(self, path: Trajectory) -> Array:
        """Return the force that each magnetometer senses along the next points, (..., n_magnetometers, 3, n)."""
        placed = self.touch.placed(path)
        blur_m = np.full_like(self._offset_m[0], ANYSKIN_BLUR_M)
        pressed_n = placed.force_n[..., None, :] + self.touch.variation_n(placed, blur_m, self._offset_m)
        normal_n = self._fraction * pressed_n
        # A part of the normal force drags the skin the way the finger goes.
        x_m, y_m = self._before or before_first(placed)
        self._before = placed.x_m[..., -1:], placed.y_m[..., -1:]
        x_m_s = self.PATH_RATE_HZ * np.diff(placed.x_m, prepend=x_m)
        y_m_s = self.PATH_RATE_HZ * np.diff(placed.y_m, prepend=y_m)
        scale = FRICTION / (np.hypot(x_m_s, y_m_s) + CREEP_M_S)
        x, y = scale * x_m_s, scale * y_m_s
        forces_n = np.stack([x[..., None, :] * normal_n, y[..., None, :] * normal_n, normal_n], axis=-2)
        return np.asarray(self._coupling @ forces_n)


ANYSKIN_KIND = SensorKind(
    make=AnySkinModel,
    device=devices.EmulatedAnySkin,
    path_rate_hz=ANYSKIN_PATH_RATE_HZ,
    step_points=ANYSKIN_OVERSAMPLING,
    streams=(
        SimulatedStream(
            anyskin.SIGNAL,
            anyskin.FIELD_SENSOR,
            anyskin.field_channels(anyskin.MAGNETOMETERS),
            anyskin.FIELD_UNIT,
            ANYSKIN_RATE_HZ,
        ),
    ),
)


# --------------------
# What the PVDF finger of Hu et al. 2014 measures while it goes along a path.
#
# The film lies over the whole contact and senses its force, less what leaks away; the force sensor behind it senses the
# slow part. The gains are ours: the paper gives none.

# A point a sample: at 0.4 m/s and below the skin blurs what 4 kHz would fold down; what is faster is blurred more.
PVDF_PATH_RATE_HZ = pvdf.FILM_RATE_HZ
# Eq. 5 for a force that is constant between points: the charge follows each step, and leaks by a constant fraction.
KEPT = math.exp(-1 / (pvdf.LEAK_S * PVDF_PATH_RATE_HZ))
LEAK_SECTIONS = np.array([[1.0, -1.0, 0.0, 1.0, -KEPT, 0.0]])
FILM_BAND = np.concatenate([filters.butter(2, 800.0, 'lowpass', fs=PVDF_PATH_RATE_HZ, output='sos'), LEAK_SECTIONS])
FORCE_BAND = filters.butter(2, 20.0, 'lowpass', fs=PVDF_PATH_RATE_HZ, output='sos')
POINTS_PER_FORCE = round(PVDF_PATH_RATE_HZ / pvdf.FORCE_RATE_HZ)
PVDF_LIMITS = (-(2**15), 2**15 - 1)


class PvdfModel(SensorModel):
    """Turn a path, block by block, into the controller's counts; see `SensorModel` for the arguments."""

    PATH_RATE_HZ = PVDF_PATH_RATE_HZ
    UNIT_PER_COUNT: ClassVar = {pvdf.FILM_TOPIC: pvdf.FILM_PC_PER_COUNT, pvdf.FORCE_TOPIC: pvdf.FORCE_N_PER_COUNT}

    def __init__(self, *touched: Any, **individual: Any) -> None:
        super().__init__(*touched, **individual)
        self._film, self._force_band = self._filter(FILM_BAND), self._filter(FORCE_BAND)
        self._points = 0
        self._fast = self._converter(pvdf.FILM_RATE_HZ, 1, PVDF_LIMITS)
        self._slow = self._converter(pvdf.FORCE_RATE_HZ, 1, PVDF_LIMITS, slow=True)

    def measure(self, path: Trajectory, *, slow: bool = True) -> dict[str, Samples]:
        """Return the charge of the film, and the force if wanted, in counts, (..., n_samples, 1) each."""
        _, force_n = self._pressed_n(path)
        fast = {pvdf.FILM_TOPIC: self._fast.exact(self._charge(force_n))}
        return {**fast, pvdf.FORCE_TOPIC: self._slow.exact(self._force(force_n))} if slow else fast

    def _charge(self, force_n: Array) -> Samples:
        """Return the counts of the charge, (..., n_samples, 1)."""
        charge_pc = pvdf.D33_PC_N * self._film(force_n)[..., None]
        return np.asarray(charge_pc / pvdf.FILM_PC_PER_COUNT)

    def _force(self, force_n: Array) -> Samples:
        """Return the counts of the force sensor, (..., n_force, 1)."""
        slow_n = self._force_band(force_n)
        first = -self._points % POINTS_PER_FORCE
        self._points += force_n.shape[-1]
        return slow_n[..., first::POINTS_PER_FORCE, None] / pvdf.FORCE_N_PER_COUNT


PVDF_KIND = SensorKind(
    make=PvdfModel,
    device=devices.EmulatedPvdf,
    path_rate_hz=PVDF_PATH_RATE_HZ,
    step_points=1,
    streams=(
        SimulatedStream(pvdf.FILM_TOPIC, pvdf.FILM_SENSOR, pvdf.FILM_CHANNELS, 'pC', pvdf.FILM_RATE_HZ),
        SimulatedStream(pvdf.FORCE_TOPIC, pvdf.FORCE_SENSOR, pvdf.FORCE_CHANNELS, 'N', pvdf.FORCE_RATE_HZ),
    ),
)


# --------------------
# What a TSF-85 fingertip measures while it goes along a path.
#
# Dynamic channel: rate of change of the force on the skin, 50 to 450 Hz, sampled at 1 kHz. Static channel: the pressure
# on the taxels. The counts per newton are ours: none are published.

TSF85_OVERSAMPLING = 2  # so that what lies above the band is filtered and not folded into it
TSF85_PATH_RATE_HZ = TSF85_OVERSAMPLING * RATE_HZ
COUNTS_PER_N_S = 60.0
TSF85_BAND = np.concatenate(
    [
        filters.butter(1, 50.0, 'highpass', fs=TSF85_PATH_RATE_HZ, output='sos'),
        filters.butter(4, 450.0, 'lowpass', fs=TSF85_PATH_RATE_HZ, output='sos'),
    ]
)
STATIC_COUNTS_PER_N = 3000.0
STATIC_BASELINE = (9000.0, 30000.0)  # range met in the field, without load
TAXEL_PITCH_M = 4e-3
TAXEL_BLUR_M = 1e-3
TSF85_CONTACT_RADIUS_M = 6e-3  # of the pressed area at 1 N
FAST_LIMITS, SLOW_LIMITS = (-(2**15), 2**15 - 1), (0, 2**16 - 1)


class Tsf85Model(SensorModel):
    """Turn a path, block by block, into the sensor's counts; see `SensorModel` for the arguments."""

    PATH_RATE_HZ = TSF85_PATH_RATE_HZ

    def __init__(self, *touched: Any, layout: Tsf85Layout = TSF85, **individual: Any) -> None:
        super().__init__(*touched, **individual)
        self._static_rate_hz = layout.static_rate_hz
        self._force_before_n: Array | None = None
        self._band = self._filter(TSF85_BAND)
        self._points = 0
        rows, columns = np.divmod(np.arange(layout.rows * layout.columns), layout.columns)
        self._taxel_x_m = (columns[:, None] - (layout.columns - 1) / 2) * TAXEL_PITCH_M
        self._taxel_y_m = (rows[:, None] - (layout.rows - 1) / 2) * TAXEL_PITCH_M
        self._baseline = individual_rng(self._finger).uniform(*STATIC_BASELINE, len(rows))
        self._fast = self._converter(RATE_HZ, 1, FAST_LIMITS)
        self._slow = self._converter(layout.static_rate_hz, len(rows), SLOW_LIMITS, slow=True)

    def measure(self, path: Trajectory, *, slow: bool = True) -> dict[str, Samples]:
        """Return the dynamic channel, and the taxels if wanted, in counts."""
        placed, force_n = self._pressed_n(path)
        fast = {'signal': self._fast.exact(self._dynamic(force_n))}
        return {**fast, 'signal_static': self._slow.exact(self._images(placed))} if slow else fast

    def _dynamic(self, force_n: Array) -> Samples:
        before = force_n[..., :1] if self._force_before_n is None else self._force_before_n
        self._force_before_n = force_n[..., -1:]
        rate_n_s = np.diff(force_n, prepend=before) * TSF85_PATH_RATE_HZ
        return self._band(COUNTS_PER_N_S * rate_n_s)[..., TSF85_OVERSAMPLING - 1 :: TSF85_OVERSAMPLING, None]

    def _images(self, placed: Trajectory) -> Samples:
        at = placed.at(self._image_points(len(placed)))
        texture_n = self.touch.static_variation_n(at, TAXEL_BLUR_M, (self._taxel_x_m, self._taxel_y_m))
        pressed_n = self._fractions(at.force_n) * (at.force_n[..., None, :] + texture_n)
        return self._baseline + STATIC_COUNTS_PER_N * np.swapaxes(pressed_n, -1, -2)

    def _image_points(self, n_points: int) -> NDArray[np.intp]:
        """Return which of the next points of the path fall on a tick of the static channel."""
        end = self._points + n_points
        ticks = np.arange(self._tick_from(self._points), self._tick_from(end))
        points: NDArray[np.intp] = (
            np.floor(ticks * TSF85_PATH_RATE_HZ / self._static_rate_hz).astype(np.intp) - self._points
        )
        self._points = end
        return points

    def _tick_from(self, point: int) -> int:
        """Return the first tick of the static channel at or after a point of the path."""
        return math.ceil(point * self._static_rate_hz / TSF85_PATH_RATE_HZ)

    def _fractions(self, force_n: Array) -> Array:
        """Return the fraction of the force on each taxel, (..., n_taxels, n): a dome as wide as the contact (Hertz)."""
        radius_m = TSF85_CONTACT_RADIUS_M * np.cbrt(np.maximum(force_n, 1e-9))[..., None, :]
        dome = np.maximum(0.0, 1 - (self._taxel_x_m**2 + self._taxel_y_m**2) / radius_m**2)
        return dome / np.maximum(dome.sum(axis=-2, keepdims=True), 1e-9)


def tsf85_kind(layout: Tsf85Layout) -> SensorKind:
    """Return a kind of TSF-85."""
    return SensorKind(
        make=partial(Tsf85Model, layout=layout),
        device=devices.EmulatedTsf85,
        path_rate_hz=TSF85_PATH_RATE_HZ,
        step_points=TSF85_OVERSAMPLING,
        streams=(
            SimulatedStream('signal', tsf85.DYNAMIC_SENSOR, tsf85.DYNAMIC_CHANNELS, tsf85.UNIT, RATE_HZ),
            SimulatedStream(
                'signal_static', tsf85.STATIC_SENSOR, layout.static_channels, tsf85.UNIT, layout.static_rate_hz
            ),
        ),
    )


# --------------------
# The simulated sensors by name: the `sensor` of a scene.

SENSORS: Mapping[str, SensorKind] = {
    'tsf85': tsf85_kind(TSF85S['tsf85']),  # 28 taxels at 60 Hz, dynamic channel at 1 kHz
    'tsf85_3x4': tsf85_kind(TSF85S['tsf85_3x4']),  # 12 taxels at 25 Hz, dynamic channel at 1 kHz
    'daq': DAQ_KIND,  # 4 PVDF films and 4 strain gauges at 2.5 kHz
    'biotac': biotac_kind(BIOTACS['biotac']),  # PAC at 2.2 kHz, 19 electrodes, pressure, temperature at 100 Hz
    'pvdf': PVDF_KIND,  # film at 4096 Hz with leaking charge, force at 64 Hz
    'anyskin': ANYSKIN_KIND,  # field at 5 magnetometers, 100 Hz
}

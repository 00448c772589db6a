"""Sensors on the emulator: a model on its device, brought forward in real time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path as FilePath
from typing import Protocol

import numpy as np

from texture_core.finger_state import FingerState
from texture_core.signal import NANOSECONDS
from texture_drivers.biotac.tables import LAYOUTS
from texture_drivers.tsf85.tables import LAYOUTS as TSF85S
from texture_drivers.tsf85.tables import RATE_HZ
from texture_simulation.devices.anyskin import EmulatedAnySkin
from texture_simulation.devices.biotac import EmulatedBioTac
from texture_simulation.devices.daq import EmulatedDaq
from texture_simulation.devices.device import EmulatedDevice
from texture_simulation.devices.papillarray import EmulatedPapillArray
from texture_simulation.devices.pvdf import EmulatedPvdf
from texture_simulation.devices.tsf85 import EmulatedTsf85
from texture_simulation.finger_track import FingerTrack
from texture_simulation.scene import Scene
from texture_simulation.sensors import anyskin, biotac, daq, papillarray, pvdf, tsf85
from texture_simulation.skin_contact import SkinContact
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory

# After a longer stall of the machine the rest is skipped, and the driver sees a loss: the line's buffer takes no more.
LONGEST_BURST_S = 0.25


class ContactModel(Protocol):
    """What a sensor model lets the emulator change."""

    touch: SkinContact


class LiveSensor:
    """Follow the finger with one sensor.

    Parameters
    ----------
    model, device
        What senses, and what sends.
    measure
        Measures along a piece of path and sends.
    skip
        Lets so many steps pass of which nothing is sent.
    rate_hz
        Steps a second: samples, or frames of them.
    points
        Of the path in a step.
    """

    def __init__(
        self,
        model: ContactModel,
        device: EmulatedDevice,
        measure: Callable[[Trajectory], None],
        skip: Callable[[int], None],
        *,
        rate_hz: float,
        points: int,
    ) -> None:
        self.model = model
        self.device = device
        self.done = 0  # steps, those that were skipped among them
        self.skipped = 0
        self._measure = measure
        self._skip = skip
        self._rate_hz = rate_hz
        self._points = points
        self._track = FingerTrack()
        self._start_ns: int | None = None

    def update(self, state: FingerState) -> None:
        """Take note of where the finger is."""
        self._track.update(state)

    def advance(self, now_ns: int) -> None:
        """Measure and send what is due; the first call is the beginning of time."""
        self._start_ns = now_ns if self._start_ns is None else self._start_ns
        due = int((now_ns - self._start_ns) / NANOSECONDS * self._rate_hz) - self.done
        skipped = max(0, due - round(LONGEST_BURST_S * self._rate_hz))
        if skipped:
            self.skipped += skipped
            self._skip(skipped)
        self.done += due
        if due > skipped:
            self._slide(due - skipped, self._start_ns + round(self.done / self._rate_hz * NANOSECONDS))

    def _slide(self, steps: int, until_ns: int) -> None:
        was_touching = self._track.touching
        path = self._track.advance(until_ns, self._points * steps, self._points * self._rate_hz)
        if not was_touching and self._track.touching:
            self.model.touch.relocate()
        self._measure(path)


def live_tsf85(
    scene: Scene,
    surface: Surface,
    link: FilePath,
    rng: np.random.Generator,
    *,
    layout: str = 'tsf85',
    finger: int = 0,
    long_stamps: bool = True,
) -> LiveSensor:
    """Return a TSF-85 of which one finger touches.

    Parameters
    ----------
    scene
        Scene: sensor, contact and effects.
    surface
        Surface that is touched.
    link
        Symbolic link that leads to the device.
    rng
        All random numbers: positions on the sample, effects, noise.
    layout
        Name of the layout of the fingertip.
    finger
        Which individual of the sensor.
    long_stamps
        64-bit stamps (firmware from 1.1.7 on) or 16-bit ones.

    Returns
    -------
    LiveSensor
        Closed when its context ends.
    """
    model = tsf85.Tsf85Model(scene, surface, rng, TSF85S[layout])
    device = EmulatedTsf85(link, rng, finger, long_stamps)
    return LiveSensor(
        model,
        device,
        lambda path: device.advance(*model.advance(path)),
        device.skip,
        rate_hz=RATE_HZ,
        points=tsf85.OVERSAMPLING,
    )


def live_biotac(scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator) -> LiveSensor:
    """Return a BioTac alone on its board.

    Parameters
    ----------
    scene
        Scene: sensor, contact and effects.
    surface
        Surface that is touched.
    link
        Symbolic link that leads to the device.
    rng
        All random numbers: positions on the sample, effects, noise.

    Returns
    -------
    LiveSensor
        Closed when its context ends.
    """
    layout = LAYOUTS['biotac']
    model, device = biotac.BioTacModel(scene, surface, rng, layout), EmulatedBioTac(link, rng)
    return LiveSensor(
        model,
        device,
        lambda path: device.advance(model.advance(path)[:, :, None]),
        device.skip,
        rate_hz=layout.frame_rate_hz,
        points=model.points_per_frame,
    )


def live_daq(scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator) -> LiveSensor:
    """Return the finger of paper 3.

    Parameters
    ----------
    scene
        Scene: sensor, contact and effects.
    surface
        Surface that is touched.
    link
        Symbolic link that leads to the device.
    rng
        All random numbers: positions on the sample, effects, noise.

    Returns
    -------
    LiveSensor
        Closed when its context ends.
    """
    model, device = daq.DaqModel(scene, surface, rng), EmulatedDaq(link, rng)
    return LiveSensor(
        model,
        device,
        lambda path: device.sample(model.advance(path)),
        lambda samples: device.skip(samples / daq.RATE_HZ),
        rate_hz=daq.RATE_HZ,
        points=daq.OVERSAMPLING,
    )


def live_pvdf(scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator) -> LiveSensor:
    """Return the finger of paper 5.

    Parameters
    ----------
    scene
        Scene: sensor, contact and effects.
    surface
        Surface that is touched.
    link
        Symbolic link that leads to the device.
    rng
        All random numbers: positions on the sample, effects, noise.

    Returns
    -------
    LiveSensor
        Closed when its context ends.
    """
    model, device = pvdf.PvdfModel(scene, surface, rng), EmulatedPvdf(link, rng)
    rate_hz = pvdf.PATH_RATE_HZ / pvdf.OVERSAMPLING
    return LiveSensor(
        model,
        device,
        lambda path: device.sample(*model.advance(path)),
        lambda samples: device.skip(samples / rate_hz),
        rate_hz=rate_hz,
        points=pvdf.OVERSAMPLING,
    )


def live_anyskin(scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator) -> LiveSensor:
    """Return an AnySkin.

    Parameters
    ----------
    scene
        Scene: sensor, contact and effects.
    surface
        Surface that is touched.
    link
        Symbolic link that leads to the device.
    rng
        All random numbers: positions on the sample, effects, noise.

    Returns
    -------
    LiveSensor
        Closed when its context ends.
    """
    model, device = anyskin.AnySkinModel(scene, surface, rng), EmulatedAnySkin(link, rng)
    return LiveSensor(
        model,
        device,
        lambda path: device.sample(model.advance(path)),
        device.skip,
        rate_hz=anyskin.RATE_HZ,
        points=anyskin.OVERSAMPLING,
    )


def live_papillarray(scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator) -> LiveSensor:
    """Return a PapillArray alone on its hub.

    Parameters
    ----------
    scene
        Scene: sensor, contact and effects.
    surface
        Surface that is touched.
    link
        Symbolic link that leads to the device.
    rng
        All random numbers: positions on the sample, effects, noise.

    Returns
    -------
    LiveSensor
        Not started: its first `advance` is the beginning of its time.
    """
    model, device = papillarray.PapillArrayModel(scene, surface, rng), EmulatedPapillArray(link, rng)
    return LiveSensor(
        model,
        device,
        lambda path: device.sample(model.advance(path)[:, None]),
        device.skip,
        rate_hz=papillarray.PATH_RATE_HZ,
        points=1,
    )


MakeLiveSensor = Callable[[Scene, Surface, FilePath, np.random.Generator], LiveSensor]
LIVE_SENSORS: Mapping[str, MakeLiveSensor] = {
    'tsf85': live_tsf85,
    'tsf85_3x4': partial(live_tsf85, layout='tsf85_3x4'),
    'biotac': live_biotac,
    'daq': live_daq,
    'pvdf': live_pvdf,
    'anyskin': live_anyskin,
    'papillarray': live_papillarray,
}

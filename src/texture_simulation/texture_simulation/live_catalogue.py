"""The sensors that can be emulated live: each model with the device that it sends through."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path as FilePath
from typing import Protocol

import numpy as np

from texture_drivers.biotac.tables import LAYOUTS
from texture_drivers.tsf85.tables import LAYOUTS as TSF85S
from texture_drivers.tsf85.tables import RATE_HZ
from texture_simulation.devices.anyskin import EmulatedAnySkin
from texture_simulation.devices.biotac import EmulatedBioTac
from texture_simulation.devices.daq import EmulatedDaq
from texture_simulation.devices.papillarray import EmulatedPapillArray
from texture_simulation.devices.pvdf import EmulatedPvdf
from texture_simulation.devices.tsf85 import EmulatedTsf85
from texture_simulation.live_sensor import LiveSensor
from texture_simulation.scene import Scene
from texture_simulation.sensors import anyskin, biotac, biotac_hand, daq, papillarray, pvdf, tsf85, tsf85_pair
from texture_simulation.surfaces.surface import Surface
from texture_simulation.trajectory import Trajectory


class MakeLiveSensor(Protocol):
    """Makes a live sensor."""

    def __call__(self, scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator, /) -> LiveSensor:
        """Return the sensor, not started: its first `advance` is the beginning of its time.

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
        """


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
    return _of_tsf85(model, EmulatedTsf85(link, rng, finger, long_stamps))


def live_tsf85_pair(
    scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator, *, long_stamps: bool = True
) -> LiveSensor:
    """Return a TSF-85 of which both fingers touch.

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
    long_stamps
        64-bit stamps (firmware from 1.1.7 on) or 16-bit ones.

    Returns
    -------
    LiveSensor
        Not started: its first `advance` is the beginning of its time.
    """
    return _of_tsf85(tsf85_pair.Tsf85Pair(scene, surface, rng), EmulatedTsf85(link, rng, long_stamps=long_stamps))


def _of_tsf85(model: tsf85.Tsf85Model | tsf85_pair.Tsf85Pair, device: EmulatedTsf85) -> LiveSensor:
    """Return the sensor of a TSF-85, whether one finger touches or both."""
    return LiveSensor(
        model,
        device,
        lambda path: device.advance(*model.advance(path)),
        device.skip,
        rate_hz=RATE_HZ,
        points=tsf85.OVERSAMPLING,
    )


def live_biotac(scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator) -> LiveSensor:
    """Return a BioTac alone on its board."""
    model, device = biotac.BioTacModel(scene, surface, rng, LAYOUTS['biotac']), EmulatedBioTac(link, rng)
    return _on_board(model, device, lambda path: device.advance(model.advance(path)[:, :, None]))


def live_biotac_hand(scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator) -> LiveSensor:
    """Return a board with BioTacs on two fingers."""
    model = biotac_hand.BioTacHand(scene, surface, rng, LAYOUTS['biotac'])
    device = EmulatedBioTac(link, rng, biotac_hand.SERIALS)
    return _on_board(model, device, lambda path: device.advance(model.advance(path)))


def _on_board(
    model: biotac.BioTacModel | biotac_hand.BioTacHand, device: EmulatedBioTac, advance: Callable[[Trajectory], None]
) -> LiveSensor:
    """Return the sensor of a board whose fingers are all served at the rate of its frames."""
    rate_hz, points = LAYOUTS['biotac'].frame_rate_hz, model.points_per_frame
    return LiveSensor(model, device, advance, device.skip, rate_hz=rate_hz, points=points)


def live_daq(scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator) -> LiveSensor:
    """Return the finger of paper 3."""
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
    """Return the finger of paper 5."""
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
    """Return an AnySkin."""
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
    """Return a PapillArray alone on its hub."""
    model, device = papillarray.PapillArrayModel(scene, surface, rng), EmulatedPapillArray(link, rng)
    return LiveSensor(
        model,
        device,
        lambda path: device.sample(model.advance(path)[:, None]),
        device.skip,
        rate_hz=papillarray.PATH_RATE_HZ,
        points=1,
    )


LIVE_SENSORS: Mapping[str, MakeLiveSensor] = {
    'tsf85': live_tsf85,
    'tsf85_pair': live_tsf85_pair,
    'tsf85_3x4': partial(live_tsf85, layout='tsf85_3x4'),
    'biotac': live_biotac,
    'biotac_hand': live_biotac_hand,
    'daq': live_daq,
    'pvdf': live_pvdf,
    'anyskin': live_anyskin,
    'papillarray': live_papillarray,
}

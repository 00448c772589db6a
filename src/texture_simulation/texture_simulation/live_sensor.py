"""Sensors beside the TSF-85 on the emulated bench: a model on its device, brought forward in real time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path as FilePath
from typing import Protocol

import numpy as np

from texture_core.finger import FingerState
from texture_core.signal import NANOSECONDS
from texture_simulation.devices.daq import EmulatedDaq
from texture_simulation.devices.pvdf import EmulatedPvdf
from texture_simulation.devices.sampler import EmulatedSampler
from texture_simulation.live import FingerTrack
from texture_simulation.path import Path
from texture_simulation.scene import Scene
from texture_simulation.sensors import daq, pvdf
from texture_simulation.surfaces import Surface

# After a longer stall of the machine the rest is skipped, and the driver sees a loss: the line's buffer takes no more.
LONGEST_BURST_S = 0.25


class Model(Protocol):
    """What a sensor model lets the bench change."""

    surface: Surface

    def touch_elsewhere(self) -> None:
        """Let the sample lie otherwise from now on."""


class LiveSensor:
    """Follow the finger with one sensor.

    Parameters
    ----------
    model, device
        What feels, and what sends.
    feel
        Measures along a piece of path and sends.
    rate_hz
        Samples a second.
    oversampling
        Points of the path in a sample.
    """

    def __init__(
        self,
        model: Model,
        device: EmulatedSampler,
        feel: Callable[[Path], None],
        *,
        rate_hz: float,
        oversampling: int,
    ) -> None:
        self.model = model
        self.device = device
        self._feel = feel
        self._rate_hz = rate_hz
        self._oversampling = oversampling
        self._track = FingerTrack()
        self._start_ns: int | None = None
        self._done = 0

    def update(self, state: FingerState) -> None:
        """Take note of where the finger is."""
        self._track.update(state)

    def advance(self, now_ns: int) -> None:
        """Measure and send what is due; the first call is the beginning of time."""
        self._start_ns = now_ns if self._start_ns is None else self._start_ns
        due = int((now_ns - self._start_ns) / NANOSECONDS * self._rate_hz) - self._done
        skipped = max(0, due - round(LONGEST_BURST_S * self._rate_hz))
        self.device.pass_by(skipped / self._rate_hz)
        self._done += due
        samples = due - skipped
        if samples:
            self._slide(samples, self._start_ns + round(self._done / self._rate_hz * NANOSECONDS))

    def _slide(self, samples: int, until_ns: int) -> None:
        was_touching = self._track.touching
        path = self._track.advance(until_ns, self._oversampling * samples, self._oversampling * self._rate_hz)
        if not was_touching and self._track.touching:
            self.model.touch_elsewhere()
        self._feel(path)


def live_daq(scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator) -> LiveSensor:
    """Return the finger of paper 3."""
    model, device = daq.DaqModel(scene, surface, rng), EmulatedDaq(link, rng)
    return LiveSensor(
        model,
        device,
        lambda path: device.feel(model.advance(path)),
        rate_hz=daq.RATE_HZ,
        oversampling=daq.OVERSAMPLING,
    )


def live_pvdf(scene: Scene, surface: Surface, link: FilePath, rng: np.random.Generator) -> LiveSensor:
    """Return the finger of paper 5."""
    model, device = pvdf.PvdfModel(scene, surface, rng), EmulatedPvdf(link, rng)
    return LiveSensor(
        model,
        device,
        lambda path: device.feel(*model.advance(path)),
        rate_hz=pvdf.PATH_RATE_HZ / pvdf.OVERSAMPLING,
        oversampling=pvdf.OVERSAMPLING,
    )


LIVE_SENSORS: Mapping[str, Callable[[Scene, Surface, FilePath, np.random.Generator], LiveSensor]] = {
    'daq': live_daq,
    'pvdf': live_pvdf,
}

"""The emulated bench: a scene under a finger, felt by an emulated sensor, in real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texture_core.finger import FingerState
from texture_core.parameters import param
from texture_core.signal import NANOSECONDS
from texture_drivers.tsf85.tables import RATE_HZ
from texture_simulation.devices.tsf85 import EmulatedTsf85
from texture_simulation.finger_link import FingerLink
from texture_simulation.live import FingerTrack
from texture_simulation.live_sensor import LIVE_SENSORS, LiveSensor
from texture_simulation.scene import Scene, load_scene
from texture_simulation.sensors.tsf85 import OVERSAMPLING, PATH_RATE_HZ, Tsf85Model
from texture_simulation.surfaces import Surface

BURST_S = 0.005
LONGEST_BURST_S = 0.5  # after a longer stall of the machine the rest is skipped, and the driver sees a loss
SAMPLE_NS = round(NANOSECONDS / RATE_HZ)


@dataclass(frozen=True)
class BenchParams:
    """What lies on the bench and where it is reached."""

    scene: str = param('bench', 'Scene that the package ships, or path of a scene file.')
    surface: str = param('glass', 'Surface under the finger; may be set while running: the sample is swapped.')
    seed: int = param(0, 'Seed of all randomness.', low=0)
    tsf85_link: str = param('/tmp/texture/tsf85', 'Symbolic link to create; the device path for the sensor node.')
    finger: int = param(0, 'Finger of the sensor that touches.', low=0, high=1)
    long_stamps: bool = param(True, 'Firmware with 64-bit stamps (from 1.1.7 on); false: older, with 16-bit stamps.')
    daq_link: str = param('', 'The same for the data acquisition finger of paper 3; empty: it is not there.')
    pvdf_link: str = param('', 'The same for the PVDF finger of paper 5; empty: it is not there.')
    finger_port: int = param(28500, 'UDP port on loopback where finger states arrive; 0: any.', low=0, high=65535)


class Bench:
    """Run a scene and its devices in a thread; usable as a context manager.

    Parameters
    ----------
    params
        See `BenchParams`.
    now_ns
        Clock of the finger states: CLOCK_MONOTONIC.

    Raises
    ------
    TextureError
        If the scene or the surface is unknown, or the port or the link cannot be had.
    """

    def __init__(self, params: BenchParams, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        rng = np.random.default_rng(params.seed)
        self.scene: Scene = load_scene(params.scene)
        self._now_ns = now_ns
        self._track = FingerTrack()
        self._model = Tsf85Model(self.scene, self._prepared(params.surface), rng)
        self.tsf85 = EmulatedTsf85(Path(params.tsf85_link).expanduser(), rng, params.finger, params.long_stamps)
        links = {'daq': params.daq_link, 'pvdf': params.pvdf_link}
        self.others: dict[str, LiveSensor] = {
            name: LIVE_SENSORS[name](self.scene, self._model.surface, Path(link).expanduser(), rng)
            for name, link in links.items()
            if link
        }
        self._link = FingerLink(params.finger_port)
        self._commands: list[Callable[[], None]] = []
        self._samples_done = 0
        self.skipped = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='bench', daemon=True)

    def __enter__(self) -> Bench:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def finger_port(self) -> int:
        """UDP port for `texture_core.finger.FingerState` datagrams."""
        return self._link.port

    @property
    def running(self) -> bool:
        """Whether time runs on the bench."""
        return self._thread.is_alive()

    @property
    def surface(self) -> str:
        """Name of the surface under the finger."""
        return self._model.surface.name

    def set_surface(self, name: str) -> None:
        """Swap the sample; UnknownName, with the nearest name, if there is none such."""
        surface = self._prepared(name)
        self._model.surface = surface
        for other in self.others.values():
            other.model.surface = surface

    def start(self) -> None:
        """Plug the devices in and let time run."""
        self.tsf85.plug()
        for other in self.others.values():
            other.device.plug()
        self._thread.start()

    def stop(self) -> None:
        """End the thread, unplug the devices, remove their links; may be called twice."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self.tsf85.unplug()
        for other in self.others.values():
            other.device.unplug()
        self._link.close()

    def unplug(self) -> None:
        """Pull the sensor's plug; returns when it is out."""
        self._in_thread(self.tsf85.unplug)

    def replug(self) -> None:
        """Plug the sensor in again; it gets another device name and counts from 0."""
        self._in_thread(self.tsf85.plug)

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals for the diagnostics."""
        return {
            'samples': self._samples_done,
            'skipped samples': self.skipped,
            'bytes nobody took': self.tsf85.dropped_bytes,
            **{f'bytes nobody took, {name}': other.device.dropped_bytes for name, other in self.others.items()},
            'finger states': self._link.received,
            'refused datagrams': self._link.refused,
        }

    def _prepared(self, name: str) -> Surface:
        """Return a surface whose tables are made, so that swapping takes no time."""
        surface = self.scene.surface(name)
        surface.height_m(np.zeros(1), np.zeros(1), np.zeros(1))
        return surface

    def _in_thread(self, command: Callable[[], None]) -> None:
        """Run a command between two bursts, for only the thread may touch the device."""
        if not self._thread.is_alive():
            command()
            return
        done = threading.Event()
        self._commands += [command, done.set]
        done.wait()

    def _run(self) -> None:
        start_ns = self._now_ns()
        while not self._stop.wait(BURST_S):
            while self._commands:
                self._commands.pop(0)()
            due = (self._now_ns() - start_ns) // SAMPLE_NS - self._samples_done
            self._skip(due - round(LONGEST_BURST_S * RATE_HZ))
            due = min(due, round(LONGEST_BURST_S * RATE_HZ))
            for state in self._link.states():
                self._update(state)
            if due > 0:
                self._samples_done += due
                self._advance(due, start_ns + self._samples_done * SAMPLE_NS)
            for other in self.others.values():
                other.advance(self._now_ns())

    def _update(self, state: FingerState) -> None:
        self._track.update(state)
        for other in self.others.values():
            other.update(state)

    def _skip(self, samples: int) -> None:
        if samples > 0:
            self._samples_done += samples
            self.skipped += samples
            self.tsf85.pass_by(samples)

    def _advance(self, samples: int, until_ns: int) -> None:
        """Make and send the samples up to a time."""
        was_touching = self._track.touching
        path = self._track.advance(until_ns, OVERSAMPLING * samples, PATH_RATE_HZ)
        if not was_touching and self._track.touching:
            self._model.touch_elsewhere()
        dynamic, images = self._model.advance(path)
        self.tsf85.advance(dynamic, images)

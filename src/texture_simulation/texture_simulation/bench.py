"""The emulated bench: a scene under a finger, felt by an emulated sensor, in real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from texture_core.catalogue import find
from texture_core.parameters import param
from texture_simulation.devices.device import Device
from texture_simulation.devices.faults import ByteFaults
from texture_simulation.finger_link import FingerLink
from texture_simulation.live_sensor import LIVE_SENSORS, MakeLive, live_tsf85
from texture_simulation.scene import Scene, load_scene

BURST_S = 0.005


@dataclass(frozen=True)
class BenchParams:
    """What lies on the bench and where it is reached."""

    scene: str = param('bench', 'Scene that the package ships, or path of a scene file.')
    surface: str = param('glass', 'Surface under the finger; may be set while running: the sample is swapped.')
    seed: int = param(0, 'Seed of all randomness.', low=0)
    sensor: str = param(
        '', 'Sensor on the bench, reached at `tsf85_link`; empty: that of the scene.', choices=('', *LIVE_SENSORS)
    )
    tsf85_link: str = param('/tmp/texture/tsf85', 'Symbolic link to create; the device path for the sensor node.')
    finger: int = param(0, 'Finger of a TSF-85 that touches.', low=0, high=1)
    long_stamps: bool = param(True, 'TSF-85 with 64-bit stamps (firmware from 1.1.7 on); false: older, with 16 bits.')
    daq_link: str = param('', 'The same for a data acquisition finger beside it; empty: it is not there.')
    pvdf_link: str = param('', 'The same for a PVDF finger beside it; empty: it is not there.')
    plugged: bool = param(True, 'Whether the sensor is plugged in; may be set while running.')
    bit_flips: float = param(
        0.0,
        'Probability that a bit of a byte flips on the line of the sensor; may be set while running.',
        low=0.0,
        high=1.0,
    )
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
        surface = self.scene.surface(params.surface)
        for other in self.scene.surfaces.values():  # all tables are made now: swapping takes no time and no memory
            other.height_m(np.zeros(1), np.zeros(1), np.zeros(1))
        tsf85 = {
            name: partial(live_tsf85, layout=name, finger=params.finger, long_stamps=params.long_stamps)
            for name in ('tsf85', 'tsf85_3x4')
        }
        makers: dict[str, MakeLive] = {**LIVE_SENSORS, **tsf85}
        sensor = params.sensor or self.scene.sensor
        find(makers, sensor, 'sensor')
        links = [(sensor, params.tsf85_link), ('daq', params.daq_link), ('pvdf', params.pvdf_link)]
        self._sensors = [
            makers[name](self.scene, surface, Path(link).expanduser(), rng) for name, link in links if link
        ]
        self.flip_bits(params.bit_flips)
        self._starts_plugged = params.plugged
        self._link = FingerLink(params.finger_port)
        self._commands: list[Callable[[], None]] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='bench', daemon=True)

    def __enter__(self) -> Bench:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def device(self) -> Device:
        """The device of the sensor on the bench; those beside it are left out."""
        return self._sensors[0].device

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
        return self._sensors[0].model.touch.surface.name

    def set_surface(self, name: str) -> None:
        """Swap the sample; UnknownName, with the nearest name, if there is none such."""
        surface = self.scene.surface(name)
        for sensor in self._sensors:
            sensor.model.touch.surface = surface

    def start(self) -> None:
        """Plug the devices in and let time run."""
        for sensor in self._sensors:
            sensor.device.plug()
        if not self._starts_plugged:
            self.unplug()
        self._thread.start()

    def stop(self) -> None:
        """End the thread, unplug the devices, remove their links; may be called twice."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        for sensor in self._sensors:
            sensor.device.unplug()
        self._link.close()

    def unplug(self) -> None:
        """Pull the sensor's plug; returns when it is out."""
        self._in_thread(self.device.unplug)

    def replug(self) -> None:
        """Plug the sensor in again; it gets another device name and counts from 0."""
        self._in_thread(self.device.plug)

    def flip_bits(self, probability: float) -> None:
        """Make the line of the sensor a bad one; 0 makes it a good one again."""
        self.device.faults = ByteFaults(flip=probability)

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals for the diagnostics."""
        return {
            'samples': self._sensors[0].done,
            'skipped samples': self._sensors[0].skipped,
            'bytes nobody took': sum(sensor.device.dropped_bytes for sensor in self._sensors),
            'finger states': self._link.received,
            'refused datagrams': self._link.refused,
        }

    def _in_thread(self, command: Callable[[], None]) -> None:
        """Run a command between two bursts, for only the thread may touch the device."""
        if not self._thread.is_alive():
            command()
            return
        done = threading.Event()
        self._commands += [command, done.set]
        done.wait()

    def _run(self) -> None:
        while not self._stop.wait(BURST_S):
            while self._commands:
                self._commands.pop(0)()
            states = self._link.states()
            for sensor in self._sensors:
                for state in states:
                    sensor.update(state)
                sensor.advance(self._now_ns())

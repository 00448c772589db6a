"""The emulator: a scene under a finger and an emulated sensor that measures it, in real time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from texture_core.catalogue import find
from texture_simulation.devices.device import EmulatedDevice
from texture_simulation.devices.faults import ByteFaults
from texture_simulation.devices.tsf85 import EmulatedTsf85
from texture_simulation.devices.tsf85_encoder import FINGERS
from texture_simulation.emulator_params import EmulatorParams
from texture_simulation.finger_receiver import FingerStateReceiver
from texture_simulation.live_catalogue import LIVE_SENSORS, MakeLiveSensor, live_tsf85, live_tsf85_pair
from texture_simulation.scene import Scene, load_scene

BURST_S = 0.005


class Emulator:
    """Run a scene and its devices in a thread; usable as a context manager.

    Parameters
    ----------
    params
        See `EmulatorParams`.
    now_ns
        Clock of the finger states: CLOCK_MONOTONIC.

    Raises
    ------
    TextureError
        If the scene or the surface is unknown, or the port or the link cannot be had.
    """

    def __init__(self, params: EmulatorParams, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
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
        pair = partial(live_tsf85_pair, long_stamps=params.long_stamps)
        makers: dict[str, MakeLiveSensor] = {**LIVE_SENSORS, **tsf85, 'tsf85_pair': pair}
        sensor = params.sensor or self.scene.sensor
        find(makers, sensor, 'sensor')
        links = [(sensor, params.sensor_link), ('daq', params.daq_link), ('pvdf', params.pvdf_link)]
        self._sensors = [
            makers[name](self.scene, surface, Path(link).expanduser(), rng) for name, link in links if link
        ]
        self.flip_bits(params.bit_flips)
        self._starts_plugged = params.plugged
        self._link = FingerStateReceiver(params.finger_port)
        self._commands: list[Callable[[], None]] = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name='emulator', daemon=True)
        self.unplug_finger(params.unplugged_finger)

    def __enter__(self) -> Emulator:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def device(self) -> EmulatedDevice:
        """The device of the sensor on the emulator; those beside it are left out."""
        return self._sensors[0].device

    @property
    def finger_port(self) -> int:
        """UDP port for `texture_core.finger_state.FingerState` datagrams."""
        return self._link.port

    @property
    def running(self) -> bool:
        """Whether time runs on the emulator."""
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

    def unplug_finger(self, finger: int) -> None:
        """Pull the plug of one finger of a TSF-85 out of its hub; -1 plugs all in."""
        device = self.device
        if isinstance(device, EmulatedTsf85):
            self._in_thread(partial(device.plug_fingers, [finger != other for other in range(FINGERS)]))

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

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The emulated rig: one scene, its finger, its devices, driven by the motion that an arm reports."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from texture_core.config import find, param
from texture_core.types import DEVICES, NANOSECONDS, FingerReceiver, FingerState
from texture_simulation import sensor_models as models
from texture_simulation.devices import fingers as devices
from texture_simulation.path import FingerTrack
from texture_simulation.scene import Scene, load_scene
from texture_simulation.surfaces import Surface

# --------------------
# Sensors on the emulator: a model on its device, brought forward in real time.

# After a longer stall of the machine the rest is skipped, and the driver sees a loss: the line's buffer takes no more.
LONGEST_BURST_S = 0.25


class LiveSensor:
    """Fingers of one sensor that slide together, each an individual that touches a separate place."""

    def __init__(
        self, fingers: Sequence[models.SensorModel], device: devices.EmulatedDevice, kind: models.SensorKind
    ) -> None:
        self.fingers = fingers
        self.device = device
        self.done = 0  # steps, those that were skipped among them
        self.skipped = 0
        self._points, self._points_hz = kind.step_points, kind.path_rate_hz
        self._rate_hz = kind.path_rate_hz / kind.step_points
        self._track = FingerTrack()
        self._start_ns: int | None = None

    @property
    def surface(self) -> Surface:
        """What is touched."""
        return self.fingers[0].touch.surface

    @surface.setter
    def surface(self, surface: Surface) -> None:
        for finger in self.fingers:
            finger.touch.surface = surface

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
            self.device.skip(skipped)
        self.done += due
        if due > skipped:
            self._slide(due - skipped, self._start_ns + round(self.done / self._rate_hz * NANOSECONDS))

    def _slide(self, steps: int, until_ns: int) -> None:
        was_touching = self._track.touching
        path = self._track.advance(until_ns, self._points * steps, self._points_hz)
        if not was_touching and self._track.touching:
            for finger in self.fingers:
                finger.touch.relocate()
        measured = [finger.measure(path) for finger in self.fingers]
        self.device.measure({topic: np.stack([one[topic] for one in measured], axis=-1) for topic in measured[0]})


# --------------------
# The sensors that can be emulated live: each model with the device that it sends through.


# Makes a live sensor, not started: its first `advance` is the beginning of its time. From a scene, the surface that is
# touched, the symbolic link that leads to the device, and all random numbers: positions, effects, noise.
MakeLiveSensor = Callable[[Scene, Surface, Path, np.random.Generator], LiveSensor]


def _live(kind: models.SensorKind, fingers: int = 1) -> MakeLiveSensor:
    """Return what makes a sensor of a kind with some fingers on its device."""

    def make(scene: Scene, surface: Surface, link: Path, rng: np.random.Generator) -> LiveSensor:
        made = [kind.make(scene.of_finger(finger), surface, rng, finger=finger) for finger in range(fingers)]
        return LiveSensor(made, kind.device(link, rng), kind)

    return make


SERIALS = ('BT-0', 'BT-1', 'BT-2')  # of the BioTacs of a hand, by socket
LIVE_SENSORS: Mapping[str, MakeLiveSensor] = {
    **{name: _live(kind) for name, kind in models.SENSORS.items()},
    'tsf85_pair': _live(models.SENSORS['tsf85'], 2),
    'biotac_hand': _live(
        models.SENSORS['biotac']._replace(device=partial(devices.EmulatedBioTac, serials=SERIALS)), len(SERIALS)
    ),
}


# --------------------
# The parameters of the emulated rig.


@dataclass(frozen=True)
class EmulatorParams:
    """What is emulated and where it is reached."""

    scene: str = param(
        'twelve_textures', 'Scene that is emulated: the name of a shipped one or the path of a scene file.'
    )
    surface: str = param('glass', 'Surface under the finger; setting it at run time swaps the sample.')
    seed: int = param(0, 'Seed of all randomness; equal seeds give equal signals.', low=0)
    sensor: str = param(
        '', "Emulated sensor, which appears at `sensor_link`; '' takes that of the scene.", choices=('', *LIVE_SENSORS)
    )
    sensor_link: str = param(
        f'{DEVICES}/sensor',
        'Path of the symbolic link to the emulated sensor, which is the device path of the sensor node.',
    )
    plugged: bool = param(True, 'Plugs the emulated sensor in; setting it to false at run time unplugs it.')
    unplugged_finger: int = param(
        -1, 'Finger of a TSF-85 whose plug is out of the hub, which may be set at run time; -1 is none.', low=-1, high=1
    )
    bit_flips: float = param(
        0.0,
        'Probability that one bit of a byte of the sensor flips on the line; it may be set at run time.',
        low=0.0,
        high=1.0,
    )
    finger_pipe: str = param(
        f'{DEVICES}/finger', 'Path of the created named pipe, on which the emulated arm sends the finger state.'
    )


# --------------------
# The emulator: a scene under a finger and an emulated sensor that measures it, in real time.

BURST_S = 0.005


class Emulator:
    """Run a scene and its devices in a thread; usable as a context manager."""

    def __init__(self, params: EmulatorParams, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        rng = np.random.default_rng(params.seed)
        self.scene: Scene = load_scene(params.scene)
        self._now_ns = now_ns
        surface = self.scene.surface(params.surface)
        for other in self.scene.surfaces.values():  # all tables are made now: swapping takes no time and no memory
            other.height_m(np.zeros(1), np.zeros(1), np.zeros(1))
        make = find(LIVE_SENSORS, params.sensor or self.scene.sensor, 'sensor')
        self._sensor = make(self.scene, surface, Path(params.sensor_link).expanduser(), rng)
        self.flip_bits(params.bit_flips)
        self._starts_plugged = params.plugged
        self._link = FingerReceiver(params.finger_pipe)
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
    def device(self) -> devices.EmulatedDevice:
        """The device of the sensor."""
        return self._sensor.device

    @property
    def running(self) -> bool:
        """Whether time runs on the emulator."""
        return self._thread.is_alive()

    @property
    def surface(self) -> str:
        """Name of the surface under the finger."""
        return self._sensor.surface.name

    def set_surface(self, name: str) -> None:
        """Swap the sample; UnknownName, with the nearest name, if there is none such."""
        self._sensor.surface = self.scene.surface(name)

    def start(self) -> None:
        """Plug the sensor in and let time run."""
        self.device.plug()
        if not self._starts_plugged:
            self.unplug()
        self._thread.start()

    def stop(self) -> None:
        """End the thread, unplug the sensor, remove its link; may be called twice."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self.device.unplug()
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
        if isinstance(device, devices.EmulatedTsf85):
            self._in_thread(partial(device.plug_fingers, [finger != other for other in range(devices.FINGERS)]))

    def flip_bits(self, probability: float) -> None:
        """Make the line of the sensor a bad one; 0 makes it a good one again."""
        self.device.faults = devices.ByteFaults(flip=probability)

    @property
    def counts(self) -> Mapping[str, int]:
        """Totals for the diagnostics."""
        return {
            'samples': self._sensor.done,
            'skipped samples': self._sensor.skipped,
            'unread bytes': self.device.dropped_bytes,
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
            for state in self._link.states():
                self._sensor.update(state)
            self._sensor.advance(self._now_ns())

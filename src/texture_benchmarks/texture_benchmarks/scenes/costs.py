"""What it costs to simulate: a slide offline, and an emulated device in real time."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texture_core.finger_state import FingerSender, FingerState
from texture_core.signal import NANOSECONDS
from texture_drivers.tsf85.protocol import start_command
from texture_simulation.emulator import Emulator
from texture_simulation.emulator_params import EmulatorParams
from texture_simulation.scene import Scene, load_scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.simulated_slide import SimulatedSlide
from texture_simulation.slide_batches import simulate_slide_streams

SCAN_S = 0.5
SLIDE = SimulatedSlide(0.1, 2.0, SCAN_S)
MANY = 100  # slides at once
ARM_PERIOD_S = 0.008  # as often as an arm tells where it is, and the line is read
READ_BYTES = 1 << 16
SETTLE_S = 0.3
SPEED_M_S, FORCE_N = 0.1, 2.0


@dataclass(frozen=True)
class ScanCost:
    """Milliseconds of computing for a slide of 0.5 s with all its channels: medians over all surfaces of a scene.

    `alone`: one slide at a time; `together`: each of many at once; `worst`: the dearest surface, together.
    """

    alone_ms: float
    together_ms: float
    worst_ms: float


@dataclass(frozen=True)
class DeviceLoad:
    """What an emulated device costs in real time.

    Parameters
    ----------
    cpu
        Share of one core that the process used, which emulates the device, moves the finger and reads the line.
    rate_hz, channels
        Of the fast stream, as it should be.
    made
        Steps of the sensor made, as share of those that were due; what is missing was skipped.
    unread_bytes
        What did not fit the line.
    """

    cpu: float
    rate_hz: float
    channels: int
    made: float
    unread_bytes: int


def scan_cost(scene: Scene, surfaces: Sequence[str], repeats: int, many: int = MANY) -> ScanCost:
    """Return what slides over some surfaces of a scene cost; `repeats` is that of single slides.

    Parameters
    ----------
    scene
        Surfaces, sensor and effects.
    surfaces
        Names of the surfaces.
    repeats
        Number of single slides over each surface.
    many
        Number of slides made at once.

    Returns
    -------
    ScanCost
        Times in ms.
    """
    alone = [_scan_ms(scene, name, 1, repeats) for name in surfaces]
    together = [_scan_ms(scene, name, many, max(1, repeats // 5)) for name in surfaces]
    return ScanCost(float(np.median(alone)), float(np.median(together)), max(together))


def stuck_surfaces(scene: Scene) -> Mapping[bool, list[str]]:
    """Return the surfaces of a scene without stick-slip (False) and with it (True)."""
    sticks = {name: hasattr(surface.friction, 'bristle_1_m') for name, surface in scene.surfaces.items()}
    return {kind: [name for name, value in sticks.items() if value is kind] for kind in (False, True)}


def live_load(name: str, surface: str, seconds: float) -> DeviceLoad:
    """Return what the emulated device of a scene costs while a finger slides over a surface in real time.

    Parameters
    ----------
    name
        Name of the scene.
    surface
        Name of the surface.
    seconds
        How long to measure.

    Returns
    -------
    DeviceLoad
        Share of a core.
    """
    scene = load_scene(name)
    stream = SENSORS[scene.sensor].fast
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder) / 'device'
        params = EmulatorParams(scene=name, surface=surface, sensor_link=str(link), finger_port=0)
        with Emulator(params) as bench, _Arm(bench.finger_port, link) as arm:
            arm.slide(SETTLE_S)
            before, unread = bench.counts, bench.device.dropped_bytes
            cpu_s, began_s = time.process_time(), time.monotonic()
            arm.slide(seconds)
            used_s, lasted_s = time.process_time() - cpu_s, time.monotonic() - began_s
            after = bench.counts
            steps, skipped = (after[key] - before[key] for key in ('samples', 'skipped samples'))
            return DeviceLoad(
                cpu=used_s / lasted_s,
                rate_hz=stream.rate_hz,
                channels=len(stream.channels),
                made=(steps - skipped) / max(1, steps),
                unread_bytes=bench.device.dropped_bytes - unread,
            )


def _scan_ms(scene: Scene, surface: str, count: int, repeats: int) -> float:
    """Return the median computing time of one of `count` slides at once."""
    rng = np.random.default_rng(0)
    simulate_slide_streams(scene, surface, 1, SLIDE, rng)  # makes what is made once: tiles of random relief
    times = []
    for _ in range(repeats):
        began = time.thread_time()
        simulate_slide_streams(scene, surface, count, SLIDE, rng)
        times.append(time.thread_time() - began)
    return 1000 * float(np.median(times)) / count


class _Arm:
    """Moves the finger along and reads the line, as arm and driver do; usable as a context manager."""

    def __init__(self, port: int, link: Path) -> None:
        self._bench = FingerSender(port)
        self._link = link
        self._x_m, self._speed_m_s = 0.0, SPEED_M_S

    def __enter__(self) -> _Arm:
        self._line = os.open(self._link, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        os.write(self._line, start_command())  # a TSF-85 waits for it, the others do not listen
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._line)
        self._bench.close()

    def slide(self, seconds: float) -> None:
        """Slide for a while."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s:
            now_ns = time.monotonic_ns()
            self._bench.send(FingerState(now_ns, x_m=self._x_m, vx_m_s=self._speed_m_s, force_n=FORCE_N))
            time.sleep(ARM_PERIOD_S)
            self._x_m += self._speed_m_s * (time.monotonic_ns() - now_ns) / NANOSECONDS
            self._read()

    def _read(self) -> None:
        try:
            while len(os.read(self._line, READ_BYTES)) == READ_BYTES:
                pass
        except BlockingIOError:
            return

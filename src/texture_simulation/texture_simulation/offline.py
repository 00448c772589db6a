"""Recordings without devices: whole explorations at thousands of times real time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.exploration import ExplorationState, Phase
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_drivers.tsf85 import tables
from texture_simulation.path import Path
from texture_simulation.scene import Scene
from texture_simulation.sensors.tsf85 import OVERSAMPLING, PATH_RATE_HZ, Tsf85Model
from texture_simulation.surfaces import Surface

Recording = dict[str, list[TactileSignal]]
BATCH_S = 0.05
APPROACH_S, CONTACT_S, LIFT_S = 0.2, 0.4, 0.2
PRESS_S = 0.1  # of the contact phase, from no force to all of it
SPEED_UP_S = 0.2  # the end of the contact phase
SLIDE_FROM_S = APPROACH_S + CONTACT_S
STATE_PERIOD_S = 0.1
DYNAMIC = (tables.DYNAMIC_SENSOR, tables.DYNAMIC_CHANNELS, tables.RATE_HZ)
STATIC = (tables.STATIC_SENSOR, tables.STATIC_CHANNELS, tables.STATIC_RATE_HZ)


def record(
    scene: Scene,
    surface: str,
    speed_m_s: float,
    force_n: float,
    duration_s: float,
    *,
    rng: np.random.Generator,
    direction_rad: float = 0.0,
    radius_m: float = 0.0,
    start_ns: int = 0,
) -> Recording:
    """Return steady sliding alone, by topic; see `simulate_exploration` for the arguments."""
    speed = np.full(_points(duration_s), speed_m_s)
    path = _path(speed, np.full_like(speed, force_n), direction_rad, radius_m)
    return _measure(scene, scene.surface(surface), path, start_ns, rng)


def simulate_exploration(
    scene: Scene,
    surface: str,
    speed_m_s: float,
    force_n: float,
    slide_s: float,
    *,
    start_ns: int,
    exploration_id: str,
    rng: np.random.Generator,
    direction_rad: float = 0.0,
    radius_m: float = 0.0,
) -> tuple[list[ExplorationState], Recording]:
    """Return the states and the signals, by topic, of one exploration: approach, contact, slide, lift, done.

    Parameters
    ----------
    scene, surface
        What is touched; `surface` is the name, and becomes the label in the states.
    speed_m_s, force_n
        As wanted. The finger's own differ from slide to slide by the scene's `speed_error` and `force_error`.
    slide_s
        Length of the steady part.
    start_ns
        Stamp of the first state and of the first sample.
    rng
        Decides where the sample is touched, the errors and the noise.
    direction_rad
        Direction of travel, from +x towards +y; at the start, for a circle.
    radius_m
        Of a circle, travelled anticlockwise; 0 for a straight line.
    """
    effects = scene.effects
    true_speed = speed_m_s * float(1 + effects.speed_error * rng.standard_normal())
    true_force = max(0.05 * force_n, force_n * float(1 + effects.force_error * rng.standard_normal()))
    path = _path(*_profile(true_speed, true_force, slide_s), direction_rad, radius_m)
    story = _Story(exploration_id, surface, speed_m_s, force_n, slide_s, start_ns, direction_rad, radius_m)
    return story.states(), _measure(scene, scene.surface(surface), path, start_ns, rng)


def _points(duration_s: float) -> int:
    return OVERSAMPLING * round(duration_s * tables.RATE_HZ)


def _profile(speed_m_s: float, force_n: float, slide_s: float) -> tuple[Array, Array]:
    """Return speed and force at each point of an exploration."""
    approach, contact, slide, lift = (_points(s) for s in (APPROACH_S, CONTACT_S, slide_s, LIFT_S))
    press, speed_up = np.linspace(0, 1, _points(PRESS_S)), np.linspace(0, 1, _points(SPEED_UP_S))
    force = [np.zeros(approach), press, np.ones(contact - len(press) + slide), press[::-1], np.zeros(lift - len(press))]
    speed = [np.zeros(approach + contact - len(speed_up)), speed_up, np.ones(slide), speed_up[::-1][:lift]]
    return speed_m_s * np.concatenate(speed), force_n * np.concatenate(force)


def _path(speed_m_s: Array, force_n: Array, direction_rad: float, radius_m: float) -> Path:
    """Return the path along a line or a circle at given speeds, (n,)."""
    way_m = np.cumsum(speed_m_s) / PATH_RATE_HZ
    heading = direction_rad + (way_m / radius_m if radius_m else np.zeros_like(way_m))
    if not radius_m:
        return Path(way_m * math.cos(direction_rad), way_m * math.sin(direction_rad), force_n)
    x_m = radius_m * (np.sin(heading) - math.sin(direction_rad))
    y_m = radius_m * (math.cos(direction_rad) - np.cos(heading))
    return Path(x_m, y_m, force_n)


@dataclass(frozen=True)
class _Story:
    """What an exploration tells about itself."""

    exploration_id: str
    surface: str
    speed_m_s: float
    force_n: float
    slide_s: float
    start_ns: int
    direction_rad: float
    radius_m: float

    def states(self) -> list[ExplorationState]:
        """Return the state at each change of phase, and regularly while sliding."""
        lift_s = SLIDE_FROM_S + self.slide_s
        times = np.arange(SLIDE_FROM_S, lift_s - 1e-9, STATE_PERIOD_S).tolist()
        return [
            self._state(0.0, Phase.APPROACH),
            self._state(APPROACH_S, Phase.CONTACT),
            *(self._sliding(at_s, min(STATE_PERIOD_S, lift_s - at_s)) for at_s in times),
            self._state(lift_s, Phase.LIFT),
            self._state(lift_s + LIFT_S, Phase.DONE),
        ]

    def _state(self, at_s: float, phase: Phase) -> ExplorationState:
        return ExplorationState(
            stamp_ns=self.start_ns + round(at_s * NANOSECONDS),
            exploration_id=self.exploration_id,
            motion='circular' if self.radius_m else 'linear_slide',
            phase=phase,
            progress=at_s / (SLIDE_FROM_S + self.slide_s + LIFT_S),
            surface=self.surface,
        )

    def _sliding(self, at_s: float, steady_s: float) -> ExplorationState:
        turned_rad = (at_s - SLIDE_FROM_S) * self.speed_m_s / self.radius_m if self.radius_m else 0.0
        return replace(
            self._state(at_s, Phase.SLIDE),
            steady_s=steady_s,
            speed_m_s=self.speed_m_s,
            force_n=self.force_n,
            direction_rad=self.direction_rad + turned_rad,
        )


def _measure(scene: Scene, surface: Surface, path: Path, start_ns: int, rng: np.random.Generator) -> Recording:
    dynamic, images = Tsf85Model(scene, surface, rng).advance(path)
    return {
        'signal': _batches(dynamic[:, None], DYNAMIC, start_ns),
        'signal_static': _batches(images, STATIC, start_ns),
    }


def _batches(
    counts: NDArray[np.int16] | NDArray[np.uint16], stream: tuple[str, tuple[str, ...], float], start_ns: int
) -> list[TactileSignal]:
    """Cut (n_samples, n_channels) into batches."""
    sensor, channels, rate_hz = stream
    samples = counts.astype(np.float32)
    per_batch = round(BATCH_S * rate_hz)
    return [
        TactileSignal(
            stamp_ns=start_ns + round(first / rate_hz * NANOSECONDS),
            sensor=sensor,
            channels=channels,
            unit=tables.UNIT,
            sampling_rate_hz=rate_hz,
            first_sample=first,
            samples=samples[first : first + per_batch],
        )
        for first in range(0, len(samples), per_batch)
    ]

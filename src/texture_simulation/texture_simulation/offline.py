"""Recordings without devices: whole explorations at thousands of times real time."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from texture_core.arrays import Array, Samples
from texture_core.catalogue import find
from texture_core.exploration import ExplorationState, Phase
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_simulation.effects.protocols import SlideEffect
from texture_simulation.frictions import sliding_coefficient
from texture_simulation.scene import Scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.sensors.model import SensorKind, SimulatedStream
from texture_simulation.simulated_slide import SimulatedSlide, trajectory_along
from texture_simulation.slide_batches import simulate_slide_streams, simulate_slides

__all__ = [
    'SimulatedRecording',
    'SimulatedSlide',
    'record',
    'simulate_exploration',
    'simulate_slide_streams',
    'simulate_slides',
]

SimulatedRecording = dict[str, list[TactileSignal]]
BATCH_S = 0.05
APPROACH_S, CONTACT_S, LIFT_S = 0.2, 0.4, 0.2
PRESS_S = 0.1  # of the contact phase, from no force to all of it
SPEED_UP_S = 0.2  # the end of the contact phase
SLIDE_FROM_S = APPROACH_S + CONTACT_S
STATE_PERIOD_S = 0.1


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
    finger: int = 0,
) -> SimulatedRecording:
    """Return steady sliding alone, by topic; see `simulate_exploration` for the arguments.

    Parameters
    ----------
    scene
        Scene: sensor, contact and effects.
    surface
        Name of the surface.
    speed_m_s
        Wanted speed.
    force_n
        Wanted normal force.
    duration_s
        Duration of the slide.
    rng
        All random numbers: positions on the sample, effects, noise.
    direction_rad
        Direction of travel, from +x towards +y; at the start, for a circle.
    radius_m
        Radius of a circle, travelled anticlockwise; 0 is a straight line.
    start_ns
        Stamp of the first sample.
    finger
        Which individual of the sensor.

    Returns
    -------
    SimulatedRecording
        Signals of steady sliding.
    """
    sliding = SimulatedSlide(speed_m_s, force_n, duration_s, direction_rad, radius_m)
    kind = find(SENSORS, scene.sensor, 'sensor model')
    streams = simulate_slide_streams(scene, surface, 1, sliding, rng, finger=finger)
    return {stream.topic: _batches(streams[stream.topic][0], stream, start_ns) for stream in kind.streams}


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
    finger: int = 0,
) -> tuple[list[ExplorationState], SimulatedRecording]:
    """Return the states and the signals, by topic, of one exploration: approach, contact, slide, lift, done.

    Parameters
    ----------
    scene, surface
        What is touched; `surface` is the name, and becomes the label in the states.
    speed_m_s, force_n
        As wanted. The finger's own differ from slide to slide if the scene has a `slide_error`.
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
    finger
        Which individual of the sensor: each has traits of its own.
    exploration_id
        Id of the exploration in its states.

    Returns
    -------
    SimulatedRecording
        States and signals, in the order of time.
    """
    kind = find(SENSORS, scene.sensor, 'sensor model')
    speed, force = np.array([speed_m_s]), np.array([force_n])
    for effect in scene.effects_of(SlideEffect):
        speed, force = effect.slide(speed, force, rng)
    travelled_m, pressed_n = _profile(float(speed[0]), float(force[0]), slide_s, kind)
    path = trajectory_along(
        travelled_m, pressed_n, SimulatedSlide(speed_m_s, force_n, slide_s, direction_rad, radius_m)
    )
    streams = kind.make(scene.of_finger(finger), scene.surface(surface), rng, finger=finger).streams(path)
    timeline = _ExplorationTimeline(
        exploration_id,
        surface,
        speed_m_s,
        force_n,
        slide_s,
        start_ns,
        direction_rad,
        radius_m,
        _tangential_n(scene, surface, float(speed[0]), float(force[0])),
    )
    return timeline.states(), {
        stream.topic: _batches(streams[stream.topic], stream, start_ns) for stream in kind.streams
    }


def _tangential_n(scene: Scene, surface: str, speed_m_s: float, force_n: float) -> float:
    """Return what a wrist sensor without errors would measure; NaN of a surface whose friction nobody states."""
    friction = scene.surface(surface).friction
    return math.nan if friction is None else force_n * float(sliding_coefficient(friction, np.array(speed_m_s)))


def _profile(speed_m_s: float, force_n: float, slide_s: float, kind: SensorKind) -> tuple[Array, Array]:
    """Return the way and the force at each point of an exploration, whole steps of the sensor."""
    contact_s, lift_s = APPROACH_S + CONTACT_S, APPROACH_S + CONTACT_S + slide_s
    end_s = lift_s + LIFT_S
    n_points = kind.step_points * math.ceil(end_s * kind.path_rate_hz / kind.step_points - 1e-6)
    time_s = np.arange(1, n_points + 1) / kind.path_rate_hz
    pressed = np.interp(time_s, [APPROACH_S, APPROACH_S + PRESS_S, lift_s, lift_s + PRESS_S], [0.0, 1.0, 1.0, 0.0])
    moving = np.interp(time_s, [contact_s - SPEED_UP_S, contact_s, lift_s, lift_s + LIFT_S], [0.0, 1.0, 1.0, 0.0])
    return np.cumsum(speed_m_s * moving) / kind.path_rate_hz, force_n * pressed


@dataclass(frozen=True)
class _ExplorationTimeline:
    """What an exploration tells about itself."""

    exploration_id: str
    surface: str
    speed_m_s: float
    force_n: float
    slide_s: float
    start_ns: int
    direction_rad: float
    radius_m: float
    tangential_force_n: float

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
            tangential_force_n=self.tangential_force_n,
        )


def _batches(samples: Samples, stream: SimulatedStream, start_ns: int) -> list[TactileSignal]:
    """Cut (n_samples, n_channels) into batches."""
    values = samples.astype(np.float32)
    per_batch = max(1, round(BATCH_S * stream.rate_hz))
    return [
        TactileSignal(
            stamp_ns=start_ns + round((stream.delay_s + first / stream.rate_hz) * NANOSECONDS),
            sensor=stream.sensor,
            channels=stream.channels,
            units=(stream.unit,) * len(stream.channels),
            sampling_rate_hz=stream.rate_hz,
            first_sample=first,
            samples=values[first : first + per_batch],
        )
        for first in range(0, len(values), per_batch)
    ]

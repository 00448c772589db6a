# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Simulate slides without a clock: batches, bags, data sets."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.config import find
from texture_core.types import NANOSECONDS, Array, ExplorationState, Phase, Samples, TactileSignal
from texture_recordings.bags import BagWriter
from texture_simulation.friction import sliding_coefficient
from texture_simulation.path import SimulatedSlide, trajectory_along
from texture_simulation.scene import Scene, load_scene
from texture_simulation.sensor_models import SENSORS, SensorKind, SimulatedStream

# --------------------
# Simulate many short slides at once, as plain arrays: for training, where thousands are needed.

POINTS_AT_ONCE = 40_000  # so that what is computed stays in the processor's cache


def simulate_slides(
    scene: Scene, surface: str, count: int, sliding: SimulatedSlide, rng: np.random.Generator, *, finger: int = 0
) -> Samples:
    """Return steady slides over one surface: the fast stream, (count, n_samples, n_channels).

    Each slide meets another place of the sample, with the scene's effects. The samples are in the unit the driver
    publishes. Speed, force and direction of `sliding` may be arrays (count,).
    """
    return simulate_slide_streams(scene, surface, count, sliding, rng, finger=finger, slow=False)['signal']


def simulate_slide_streams(
    scene: Scene,
    surface: str,
    count: int,
    sliding: SimulatedSlide,
    rng: np.random.Generator,
    *,
    finger: int = 0,
    slow: bool = True,
) -> dict[str, Samples]:
    """Return the same by topic, with the slow stream if the sensor has one."""
    kind = find(SENSORS, scene.sensor, 'sensor model')
    touched = scene.surface(surface)
    lengths = {stream.topic: round(sliding.duration_s * stream.rate_hz) for stream in kind.streams}
    n_points = kind.step_points * math.ceil(sliding.duration_s * kind.path_rate_hz / kind.step_points - 1e-6)
    made: dict[str, list[Samples]] = {}
    for speed_m_s, force_n, part in _parts(scene, count, sliding, rng, n_points * len(kind.fast.channels)):
        model = kind.make(
            scene.of_finger(finger), touched, rng, finger=finger, batch_shape=(len(speed_m_s),), settled=True
        )
        path = part.steady_path(speed_m_s, force_n, n_points, kind.path_rate_hz)
        for topic, samples in model.streams(path, slow=slow).items():
            made.setdefault(topic, []).append(samples[:, : lengths[topic]])
    return {topic: np.concatenate(parts) for topic, parts in made.items()}


def _parts(
    scene: Scene, count: int, sliding: SimulatedSlide, rng: np.random.Generator, points: int
) -> Iterator[tuple[Array, Array, SimulatedSlide]]:
    """Yield speed and force, (n, 1) each, as they become, and how these n slides go."""
    speed_m_s, force_n, direction, x_m, y_m = (
        np.broadcast_to(np.asarray(value, dtype=np.float64), (count,))
        for value in (
            sliding.speed_m_s, sliding.force_n, sliding.direction_rad, sliding.start_x_m, sliding.start_y_m
        )
    )  # fmt: skip
    for effect in scene.effects_of('slide'):
        speed_m_s, force_n = effect.slide(speed_m_s, force_n, rng)
    size = max(1, POINTS_AT_ONCE // points)
    for first in range(0, count, size):
        here = slice(first, first + size)
        part = SimulatedSlide(
            speed_m_s[here], force_n[here], sliding.duration_s, direction[here], sliding.radius_m, x_m[here], y_m[here]
        )
        yield speed_m_s[here, None], force_n[here, None], part


# --------------------
# Recordings without devices: whole explorations at thousands of times real time.

SimulatedRecording = dict[str, list[TactileSignal]]
BATCH_S = 0.05
APPROACH_S, CONTACT_S, LIFT_S = 0.2, 0.4, 0.2
PRESS_S = 0.1  # of the contact phase, from no force to all of it
SPEED_UP_S = 0.2  # the end of the contact phase
SLIDE_FROM_S = APPROACH_S + CONTACT_S
STATE_PERIOD_S = 0.1


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
    finger: int = 0,
) -> tuple[list[ExplorationState], SimulatedRecording]:
    """Return the states and the signals, by topic, of one exploration: approach, contact, slide, lift, done.

    Parameters
    ----------
    scene, surface
        What is touched; `surface` is the name, and becomes the label in the states.
    speed_m_s, force_n
        As wanted. Those of the finger differ from slide to slide if the scene has a `slide_error`.
    slide_s
        Length of the steady part.
    start_ns
        Stamp of the first state and of the first sample.
    rng
        Decides where the sample is touched, the errors and the noise.
    direction_rad
        Direction of travel, from +x towards +y.
    finger
        Which individual of the sensor: each has individual traits.
    exploration_id
        Id of the exploration in its states.

    Returns
    -------
    SimulatedRecording
        States and signals, in the order of time.
    """
    kind = find(SENSORS, scene.sensor, 'sensor model')
    speed, force = np.array([speed_m_s]), np.array([force_n])
    for effect in scene.effects_of('slide'):
        speed, force = effect.slide(speed, force, rng)
    travelled_m, pressed_n = _profile(float(speed[0]), float(force[0]), slide_s, kind)
    path = trajectory_along(travelled_m, pressed_n, SimulatedSlide(speed_m_s, force_n, slide_s, direction_rad))
    streams = kind.make(scene.of_finger(finger), scene.surface(surface), rng, finger=finger).streams(path)
    friction = scene.surface(surface).friction
    # What a wrist sensor without errors would measure; NaN of a surface whose friction is not defined.
    tangential_n = math.nan if friction is None else float(force[0] * sliding_coefficient(friction, speed)[0])
    slide = {
        'speed_m_s': speed_m_s,
        'force_n': force_n,
        'direction_rad': direction_rad,
        'tangential_force_n': tangential_n,
    }
    begun = ExplorationState(start_ns, exploration_id, 'linear_slide', Phase.APPROACH, 0.0, surface=surface)
    return _states(begun, slide_s, slide), {
        stream.topic: _batches(streams[stream.topic], stream, start_ns) for stream in kind.streams
    }


def _profile(speed_m_s: float, force_n: float, slide_s: float, kind: SensorKind) -> tuple[Array, Array]:
    """Return the way and the force at each point of an exploration, whole steps of the sensor."""
    contact_s, lift_s = APPROACH_S + CONTACT_S, APPROACH_S + CONTACT_S + slide_s
    end_s = lift_s + LIFT_S
    n_points = kind.step_points * math.ceil(end_s * kind.path_rate_hz / kind.step_points - 1e-6)
    time_s = np.arange(1, n_points + 1) / kind.path_rate_hz
    pressed = np.interp(time_s, [APPROACH_S, APPROACH_S + PRESS_S, lift_s, lift_s + PRESS_S], [0.0, 1.0, 1.0, 0.0])
    moving = np.interp(time_s, [contact_s - SPEED_UP_S, contact_s, lift_s, lift_s + LIFT_S], [0.0, 1.0, 1.0, 0.0])
    return np.cumsum(speed_m_s * moving) / kind.path_rate_hz, force_n * pressed


def _states(begun: ExplorationState, slide_s: float, slide: Mapping[str, float]) -> list[ExplorationState]:
    """Return the state at each change of phase, and regularly while sliding with the speed and force of `slide`."""
    lift_s, end_s = SLIDE_FROM_S + slide_s, SLIDE_FROM_S + slide_s + LIFT_S

    def state(at_s: float, phase: Phase, **more: Any) -> ExplorationState:
        stamp_ns = begun.stamp_ns + round(at_s * NANOSECONDS)
        return replace(begun, stamp_ns=stamp_ns, phase=phase, progress=at_s / end_s, **more)

    def sliding(at_s: float) -> ExplorationState:
        return state(at_s, Phase.SLIDE, **slide, steady_s=min(STATE_PERIOD_S, lift_s - at_s))

    return [
        state(0.0, Phase.APPROACH),
        state(APPROACH_S, Phase.CONTACT),
        *(sliding(at_s) for at_s in np.arange(SLIDE_FROM_S, lift_s - 1e-9, STATE_PERIOD_S).tolist()),
        state(lift_s, Phase.LIFT),
        state(end_s, Phase.DONE),
    ]


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


# --------------------
# Slides over the surfaces of a simulated scene, as labelled bags: no recording is needed, and any number is had.

START_NS = 1_000_000_000 * NANOSECONDS
PAUSE_NS = NANOSECONDS
DELAY_NS = 100_000  # a batch is logged this long after its last sample, a state at its stamp
Logged = tuple[int, str, Any]


@dataclass(frozen=True)
class SlidePlan:
    """How each surface is explored."""

    slides: int = 10  # over each surface
    speed_m_s: float = 0.1
    force_n: float = 2.0
    slide_s: float = 3.0  # duration of the steady part
    direction_rad: float = 0.0  # of travel, from +x towards +y
    fingers: int = 1  # that slide together; the topics of several are 'finger0/signal' and so on


def write_simulated(
    out: str | Path,
    plan: SlidePlan,
    rng: np.random.Generator,
    scene: str = 'twelve_textures',
    surfaces: Sequence[str] = (),
) -> list[Path]:
    """Write one bag a surface, named after it, and return their paths."""
    table = load_scene(scene)
    chosen = [table.surface(name).name for name in surfaces] or list(table.surfaces)
    start_ns = START_NS
    for surface in chosen:
        start_ns = _write_surface(Path(out) / surface, table, plan, start_ns, rng)
    return [Path(out) / surface for surface in chosen]


def _write_surface(path: Path, scene: Scene, plan: SlidePlan, start_ns: int, rng: np.random.Generator) -> int:
    """Write the bag of one surface, named as the path; return when the next one may start."""
    first: dict[str, int] = {}
    with BagWriter(path) as bag:
        for number in range(1, plan.slides + 1):
            states, signals = _slide(scene, plan, start_ns, f'{path.name}/slide{number:02d}', rng)
            logged: list[Logged] = [(state.stamp_ns, 'exploration', state) for state in states]
            for topic, batches in signals.items():
                logged += [(one.end_ns + DELAY_NS, topic, one) for one in _running_on(batches, first, topic)]
            logged.sort(key=lambda one: one[0])
            for log_ns, topic, value in logged:
                bag.write(topic, value, log_ns)
            start_ns = logged[-1][0] + PAUSE_NS
    return start_ns


def _slide(
    scene: Scene, plan: SlidePlan, start_ns: int, exploration_id: str, rng: np.random.Generator
) -> tuple[list[ExplorationState], dict[str, Iterable[TactileSignal]]]:
    """Return the states of a slide, and the signals of all its fingers by topic, each finger with individual traits."""
    surface = exploration_id.rpartition('/')[0]
    signals: dict[str, Iterable[TactileSignal]] = {}
    for finger in reversed(range(plan.fingers)):
        states, of_finger = simulate_exploration(
            scene, surface, plan.speed_m_s, plan.force_n, plan.slide_s,
            start_ns=start_ns, exploration_id=exploration_id, rng=rng,
            direction_rad=plan.direction_rad, finger=finger,
        )  # fmt: skip
        prefix = f'finger{finger}/' if plan.fingers > 1 else ''
        signals |= {f'{prefix}{topic}': batches for topic, batches in of_finger.items()}
    return states, signals


def _running_on(batches: Iterable[TactileSignal], first: dict[str, int], topic: str) -> list[TactileSignal]:
    """Number the samples of a slide on from those of the slide before, as a driver does that is not restarted."""
    offset = first.get(topic, 0)
    moved = [replace(batch, first_sample=batch.first_sample + offset) for batch in batches]
    first[topic] = moved[-1].next_sample
    return moved

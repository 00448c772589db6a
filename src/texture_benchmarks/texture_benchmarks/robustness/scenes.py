"""Simulated slides over surfaces under conditions that nobody trained: what no recording can be turned into."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from texture_benchmarks.robustness.trial import TOPIC
from texture_core.arrays import Samples
from texture_core.catalogue import find
from texture_core.exploration import ExplorationState, Phase
from texture_core.signal import TactileSignal
from texture_recordings.labelled_slide import LabelledSlide
from texture_simulation.effects.finger_spread import FingerSpread
from texture_simulation.scene import Scene, load_scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.sensors.model import SimulatedStream
from texture_simulation.simulated_slide import SimulatedSlide
from texture_simulation.slide_batches import simulate_slides
from texture_simulation.stick_slip.friction import StickSlip

SCENE = 'twelve_textures'
SPEED_M_S, FORCE_N, SLIDE_S = 0.1, 2.0, 2.0
KINETIC = 0.5  # coefficient of friction where there is friction
STRIBECK_M_S = 0.2  # so wide that the skin hangs at SPEED_M_S, too
TRAINED_BY, OTHERS = (0,), (1, 2, 3, 4, 5, 6, 7, 8)  # individuals of the sensor


@dataclass(frozen=True, eq=False)
class TouchConditions:
    """How the surfaces of a scene are measured."""

    scene: Scene
    sliding: SimulatedSlide
    fingers: Sequence[int] = TRAINED_BY


@dataclass(frozen=True)
class ShiftedCondition:
    """One thing that differs more and more from what was trained.

    Parameters
    ----------
    touch_conditions
        How surfaces are measured at a strength.
    strengths
        The first is what was trained.
    axis
        What the strength is, with its unit.
    trained
        How surfaces were measured in learning.
    """

    touch_conditions: Callable[[float], TouchConditions]
    strengths: Sequence[float]
    axis: str
    trained: Callable[[], TouchConditions]


def _usual() -> TouchConditions:
    return TouchConditions(load_scene(SCENE), SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S))


def _pressed(strength: float) -> TouchConditions:
    touch_conditions = _usual()
    return replace(touch_conditions, sliding=replace(touch_conditions.sliding, force_n=strength * FORCE_N))


def _turned(strength: float) -> TouchConditions:
    touch_conditions = _usual()
    return replace(touch_conditions, sliding=replace(touch_conditions.sliding, direction_rad=math.radians(strength)))


def _sticking(strength: float) -> TouchConditions:
    touch_conditions = _usual()
    friction = StickSlip(static=strength * KINETIC, kinetic=KINETIC, stribeck_m_s=STRIBECK_M_S)
    rubbing = {name: replace(surface, friction=friction) for name, surface in touch_conditions.scene.surfaces.items()}
    return replace(touch_conditions, scene=replace(touch_conditions.scene, surfaces=rubbing))


def _gliding() -> TouchConditions:
    return _sticking(1.0)


def _other_fingers(strength: float) -> TouchConditions:
    touch_conditions = _usual()
    spread = {**touch_conditions.scene.effects, 'finger_spread': FingerSpread(strength)}
    return replace(touch_conditions, scene=replace(touch_conditions.scene, effects=spread), fingers=OTHERS)


CONDITIONS: Mapping[str, ShiftedCondition] = {
    'weaker force': ShiftedCondition(
        _pressed, (1.0, 0.9, 0.8, 0.65, 0.5, 0.35, 0.25), 'force, of that trained', _usual
    ),
    'stronger force': ShiftedCondition(
        _pressed, (1.0, 1.1, 1.25, 1.5, 2.0, 2.5, 3.0), 'force, of that trained', _usual
    ),
    'turned direction': ShiftedCondition(
        _turned, (0.0, 2.0, 5.0, 10.0, 20.0, 45.0, 90.0), 'angle to that trained (°)', _usual
    ),
    'another finger': ShiftedCondition(
        _other_fingers, (0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5), 'spread of the gain among fingers', _usual
    ),
    'stick-slip': ShiftedCondition(
        _sticking, (1.0, 1.05, 1.1, 1.15, 1.2, 1.3, 1.5), 'static over kinetic friction', _gliding
    ),
}


def simulate_slide_signals(
    touch_conditions: TouchConditions, count: int, rng: np.random.Generator
) -> list[LabelledSlide]:
    """Return `count` slides over each surface, assigned to the fingers, at the rate of the sensor.

    Parameters
    ----------
    touch_conditions
        Scene, speed, force and fingers.
    count
        Slides over each surface.
    rng
        Places, effects and noise.

    Returns
    -------
    list of LabelledSlide
    """
    stream = find(SENSORS, touch_conditions.scene.sensor, 'sensor model').fast
    each = max(1, count // len(touch_conditions.fingers))
    slides = []
    for surface, finger in product(touch_conditions.scene.surfaces, touch_conditions.fingers):
        samples = simulate_slides(touch_conditions.scene, surface, each, touch_conditions.sliding, rng, finger=finger)
        slides += [
            _recorded(stream, surface, touch_conditions.sliding, each * finger + number, own)
            for number, own in enumerate(samples)
        ]
    return slides


def _recorded(
    stream: SimulatedStream, surface: str, sliding: SimulatedSlide, number: int, samples: Samples
) -> LabelledSlide:
    slide = LabelledSlide(Path(), f'{surface}/{number}', surface, number, 0, None)
    state = ExplorationState(
        0, slide.exploration_id, 'linear_slide', Phase.SLIDE, steady_s=sliding.duration_s, surface=surface
    )
    signal = TactileSignal(
        0,
        stream.sensor,
        stream.channels,
        (stream.unit,) * len(stream.channels),
        stream.rate_hz,
        0,
        samples.astype(np.float32),
    )
    return replace(slide, signals={TOPIC: [signal]}, states=[state])

"""Simulated slides with forces and motions that were not trained: what cannot be computed from recorded slides."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from texture_benchmarks.robustness.scenes import FORCE_N, SCENE, SPEED_M_S
from texture_recordings.slide_dataset import SlideDataset
from texture_simulation.scene import load_scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.simulated_slide import SimulatedSlide
from texture_simulation.slide_batches import simulate_slide_streams

SLIDE_S = 3.0
TRAINED_SLIDES, TESTED_SLIDES = 25, 5  # of each of the 12 surfaces; 300 in all show an error rate of 1 %
CIRCLE_M = 0.005  # radius
TRAINED_MOTION = 'linear_slide'


@dataclass(frozen=True, eq=False)
class Condition:
    """How a surface is explored.

    Parameters
    ----------
    sliding
        Speed, force, direction and radius.
    motion
        Name of the exploratory motion.
    """

    sliding: SimulatedSlide
    motion: str = TRAINED_MOTION


TRAINED = Condition(SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S))


def _force(times: float) -> Condition:
    return Condition(dataclasses.replace(TRAINED.sliding, force_n=times * FORCE_N))


SIMULATED: Mapping[str, Condition] = {
    **{f'force × {times:g}, simulated': _force(times) for times in (0.5, 0.7, 0.8, 1.25, 1.4, 2.0)},
    'circle, simulated': Condition(dataclasses.replace(TRAINED.sliding, radius_m=CIRCLE_M), 'circular'),
    'across, simulated': Condition(dataclasses.replace(TRAINED.sliding, direction_rad=math.pi / 2)),
}


def simulate(condition: Condition, count: int, rng: np.random.Generator, *, told: bool) -> SlideDataset:
    """Return `count` slides over each surface of the scene, with all streams of its sensor.

    Parameters
    ----------
    condition
        How the surfaces are explored.
    count
        Slides of each surface.
    rng
        Chooses places, effects and noise.
    told
        Whether the slides tell motion, speed, force and direction, as those of a robot do.

    Returns
    -------
    SlideDataset
    """
    scene = load_scene(SCENE)
    parts = {
        surface: simulate_slide_streams(scene, surface, count, condition.sliding, rng) for surface in scene.surfaces
    }
    streams = {stream.topic: stream for stream in SENSORS[scene.sensor].streams}
    sliding = condition.sliding
    circle = bool(sliding.radius_m)
    return SlideDataset.from_arrays(
        {topic: [samples for part in parts.values() for samples in part[topic]] for topic in streams},
        [surface for surface in parts for _ in range(count)],
        {topic: stream.rate_hz for topic, stream in streams.items()},
        channels={topic: stream.channels for topic, stream in streams.items()},
        motion=condition.motion if told else TRAINED_MOTION,
        speed_m_s=float(sliding.speed_m_s) if told else math.nan,
        force_n=float(sliding.force_n) if told else math.nan,
        direction_rad=float(sliding.direction_rad) if told and not circle else math.nan,
    )

"""Simulate many short slides at once, as plain arrays: for training, where thousands are needed."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from texture_core.arrays import Array, Samples
from texture_core.catalogue import find
from texture_simulation.effects.protocols import SlideEffect
from texture_simulation.scene import Scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.simulated_slide import SimulatedSlide

POINTS_AT_ONCE = 40_000  # so that what is computed stays in the processor's cache


def simulate_slides(
    scene: Scene, surface: str, count: int, sliding: SimulatedSlide, rng: np.random.Generator, *, finger: int = 0
) -> Samples:
    """Return steady slides over one surface: the fast stream, (count, n_samples, n_channels).

    Each slide meets another place of the sample, with the scene's effects. The samples are in the unit the driver
    publishes. Speed, force and direction of `sliding` may be arrays (count,).

    Parameters
    ----------
    scene
        Scene: sensor, contact and effects.
    surface
        Name of the surface.
    count
        Number of slides.
    sliding
        Speed, force, direction and duration of the slides.
    rng
        All random numbers: positions on the sample, effects, noise.
    finger
        Which individual of the sensor.

    Returns
    -------
    (count, n_samples, n_channels)
        In the unit the driver publishes.
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
    """Return the same by topic, with the slow stream if the sensor has one.

    Parameters
    ----------
    scene, surface
        What is touched.
    count
        How many slides.
    sliding
        How each goes.
    rng
        Decides where the sample is touched, and all effects.
    finger
        Which individual of the sensor.
    slow
        Whether the slow stream is wanted.

    Returns
    -------
    dict
        Samples by topic, (count, n_samples, n_channels).
    """
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
    speed_m_s, force_n, direction = (
        np.broadcast_to(np.asarray(value, dtype=np.float64), (count,))
        for value in (sliding.speed_m_s, sliding.force_n, sliding.direction_rad)
    )
    for effect in scene.effects_of(SlideEffect):
        speed_m_s, force_n = effect.slide(speed_m_s, force_n, rng)
    size = max(1, POINTS_AT_ONCE // points)
    for first in range(0, count, size):
        here = slice(first, first + size)
        part = SimulatedSlide(speed_m_s[here], force_n[here], sliding.duration_s, direction[here], sliding.radius_m)
        yield speed_m_s[here, None], force_n[here, None], part

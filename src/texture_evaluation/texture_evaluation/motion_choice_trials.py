"""Slides over simulated textures with several motions, and how soon different choices of motions recognise them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.catalogue import find
from texture_core.window import Window
from texture_estimation.motion import Motion
from texture_estimation.next_motion import Explorations
from texture_features.feature_set import FeatureSet
from texture_features.windows import CutWindow
from texture_simulation.scans import scans
from texture_simulation.scene import Scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.sliding import Sliding

# Chooses a motion: log-posterior, motions, number of the slide, random numbers.
Choose = Callable[[Explorations, Array, Sequence[Motion], int, np.random.Generator], Motion]


def _informed(
    known: Explorations, posterior: Array, motions: Sequence[Motion], slide: int, rng: np.random.Generator
) -> Motion:
    return known.best(posterior, motions).motion


def _in_order(
    known: Explorations, posterior: Array, motions: Sequence[Motion], slide: int, rng: np.random.Generator
) -> Motion:
    return motions[slide % len(motions)]


def _by_direction(
    known: Explorations, posterior: Array, motions: Sequence[Motion], slide: int, rng: np.random.Generator
) -> Motion:
    ordered = sorted(motions, key=lambda motion: motion.direction_rad)
    return ordered[slide % len(ordered)]


def _at_random(
    known: Explorations, posterior: Array, motions: Sequence[Motion], slide: int, rng: np.random.Generator
) -> Motion:
    return motions[int(rng.integers(len(motions)))]


CHOICES: Mapping[str, Choose] = {
    'informed': _informed,
    'fixed order, turning first': _in_order,  # the order of the motions
    'fixed order, turning last': _by_direction,  # every speed and force in one direction, then the next
    'random': _at_random,
}


def described(
    scene: Scene, motions: Sequence[Motion], count: int, features: FeatureSet, rng: np.random.Generator
) -> Array:
    """Return the features of slides, each one window long: (n_motions, n_textures, count, n_features)."""
    return np.stack(
        [
            np.stack([_values(scene, texture, motion, count, features=features, rng=rng) for texture in scene.surfaces])
            for motion in motions
        ]
    )


def learnt(scene: Scene, motions: Sequence[Motion], values: Array) -> Explorations:
    """Learn from what `described` gave; the textures keep the order of their names."""
    n_motions, n_textures, count, n_features = values.shape
    return Explorations.learnt(
        values.reshape(-1, n_features),
        np.tile(np.repeat(list(scene.surfaces), count), n_motions).tolist(),
        [motion for motion in motions for _ in range(n_textures * count)],
    )


def right_after(
    scene: Scene,
    known: Explorations,
    motions: Sequence[Motion],
    values: Array,
    *,
    choose: Choose,
    n_slides: int,
    rng: np.random.Generator,
) -> AnyArray:
    """Return whether the most probable texture is the true one, (n_trials, n_slides), after each slide.

    Parameters
    ----------
    scene, known, motions
        What is explored, what is known of it, and what may be done.
    values : (n_motions, n_textures, n_trials * n_slides, n_features)
        Test slides: a trial over a texture has `n_slides` of its own for each motion, the same for any choice.
    choose
        Which motion is next.
    rng
        Of a choice at random.
    """
    places = {motion: number for number, motion in enumerate(motions)}
    right = []
    for number, texture in enumerate(scene.surfaces):
        truth = known.textures.index(texture)
        for first in range(0, values.shape[2] - n_slides + 1, n_slides):
            posterior, row = known.ignorance, []
            for slide in range(n_slides):
                motion = choose(known, posterior, motions, slide, rng)
                posterior = known.update(posterior, motion, values[places[motion], number, first + slide])
                row.append(int(posterior.argmax()) == truth)
            right.append(row)
    return np.array(right)


def _values(
    scene: Scene, texture: str, motion: Motion, count: int, *, features: FeatureSet, rng: np.random.Generator
) -> Array:
    """Return the features of slides over one texture with one motion, (count, n_features)."""
    sliding = Sliding(motion.speed_m_s, motion.force_n, motion.duration_s, motion.direction_rad)
    pieces = _pieces(scene, motion, scans(scene, texture, count, sliding, rng))
    return np.stack([vector.values for vector in features.describe_many(pieces)])


def _pieces(scene: Scene, motion: Motion, samples: Array) -> Iterator[CutWindow]:
    stream = find(SENSORS, scene.sensor, 'sensor model').fast
    speed, force, length = motion.speed_m_s, motion.force_n, motion.duration_s
    for number, felt in enumerate(samples):
        window = Window(felt.astype(np.float64), stream.rate_hz, stream.channels, 0, speed, force)
        yield CutWindow(0, str(number), length, length, {'signal': window}, speed, force, '')

"""Slides over simulated textures with several motions, and how soon different choices of motions recognise them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.catalogue import find
from texture_core.slide_motion import SlideMotion
from texture_core.window import Window
from texture_estimation.log_probabilities import log_softmax
from texture_estimation.next_motion.next_touch_model import NextTouchModel
from texture_features.feature_set import FeatureSet
from texture_features.windowing.windows import CutWindow
from texture_simulation.scene import Scene
from texture_simulation.sensors.catalogue import SENSORS
from texture_simulation.simulated_slide import SimulatedSlide
from texture_simulation.slide_batches import simulate_slides

# Chooses a motion, by the log-posterior and the number of the slide.
ChooseMotion = Callable[[Array, int], SlideMotion]
PLANNED, SIMULATED = 8, 20  # slides that are planned, and simulated trials of each texture by which they are


def _informed(known: NextTouchModel, motions: Sequence[SlideMotion], rng: np.random.Generator) -> ChooseMotion:
    return lambda posterior, slide: known.best_motion(posterior, motions).motion


def _planned(known: NextTouchModel, motions: Sequence[SlideMotion], rng: np.random.Generator) -> ChooseMotion:
    """Fixed order of motions with the largest mean information gain in simulated trials."""
    truth = np.repeat(np.arange(len(known.textures)), SIMULATED)
    posteriors = np.tile(known.uniform_log_prior, (len(truth), 1))
    order: list[SlideMotion] = []
    for _ in range(PLANNED):
        reported = {motion: sum(known.information(own, motion) for own in posteriors) for motion in motions}
        order.append(max(motions, key=reported.__getitem__))
        measured = known.gaussians[order[-1]]
        places = measured.means[truth] + rng.standard_normal((len(truth), measured.means.shape[1]))
        posteriors = log_softmax(posteriors + measured.log_likelihoods(places))
    return lambda posterior, slide: order[slide % PLANNED]


def _in_order(known: NextTouchModel, motions: Sequence[SlideMotion], rng: np.random.Generator) -> ChooseMotion:
    return lambda posterior, slide: motions[slide % len(motions)]


def _by_direction(known: NextTouchModel, motions: Sequence[SlideMotion], rng: np.random.Generator) -> ChooseMotion:
    ordered = sorted(motions, key=lambda motion: motion.direction_rad)
    return lambda posterior, slide: ordered[slide % len(ordered)]


def _at_random(known: NextTouchModel, motions: Sequence[SlideMotion], rng: np.random.Generator) -> ChooseMotion:
    return lambda posterior, slide: motions[int(rng.integers(len(motions)))]


CHOICES: Mapping[str, Callable[[NextTouchModel, Sequence[SlideMotion], np.random.Generator], ChooseMotion]] = {
    'informed': _informed,
    'fixed order, planned': _planned,
    'fixed order, turning first': _in_order,  # the order of the motions
    'fixed order, turning last': _by_direction,  # every speed and force in one direction, then the next
    'random': _at_random,
}


def extracted(
    scene: Scene, motions: Sequence[SlideMotion], count: int, features: FeatureSet, rng: np.random.Generator
) -> Array:
    """Return the features of slides, each one window long: (n_motions, n_textures, count, n_features).

    Parameters
    ----------
    scene
        What is explored.
    motions
        How.
    count
        Slides of each motion over each texture.
    features
        What is computed of them.
    rng
        Places, effects and noise.

    Returns
    -------
    (n_motions, n_textures, count, n_features)
    """
    return np.stack(
        [
            np.stack([_values(scene, texture, motion, count, features=features, rng=rng) for texture in scene.surfaces])
            for motion in motions
        ]
    )


def training(scene: Scene, motions: Sequence[SlideMotion], values: Array) -> NextTouchModel:
    """Learn from what `extracted` gave; the textures keep the order of their names.

    Parameters
    ----------
    scene
        Names the textures.
    motions
        How the slides were made.
    values : (n_motions, n_textures, count, n_features)
        Features of slides.

    Returns
    -------
    NextTouchModel
    """
    n_motions, n_textures, count, n_features = values.shape
    return NextTouchModel.fit(
        values.reshape(-1, n_features),
        np.tile(np.repeat(list(scene.surfaces), count), n_motions).tolist(),
        [motion for motion in motions for _ in range(n_textures * count)],
    )


@dataclass(frozen=True, eq=False)
class Trials:
    """Whether the most probable texture is right, and its probability, after each slide: (n_trials, n_slides)."""

    right: AnyArray
    probability: Array

    def until(self, sure: float) -> tuple[float, float]:
        """Return the mean number of slides until a probability, or all, and the share of trials that are right then."""
        over = self.probability >= sure
        over[:, -1] = True
        ends = over.argmax(axis=1)
        return float(ends.mean()) + 1.0, float(self.right[np.arange(len(ends)), ends].mean())


def explored(
    textures: Sequence[str],
    known: NextTouchModel,
    motions: Sequence[SlideMotion],
    values: Array,
    *,
    choose: ChooseMotion,
    n_slides: int,
) -> Trials:
    """Explore each texture in trials of several slides.

    Parameters
    ----------
    textures, known, motions
        What is explored, what is known of it, and what may be done.
    values : (n_motions, n_textures, n_trials * n_slides, n_features)
        Test slides: a trial over a texture has `n_slides` of its own for each motion, the same for any choice.
    choose
        Which motion is next.
    n_slides
        Slides of a trial.

    Returns
    -------
    Trials
        What each trial decided after each slide.
    """
    places = {motion: number for number, motion in enumerate(motions)}
    right, probability = [], []
    for number, texture in enumerate(textures):
        truth = known.textures.index(texture)
        for first in range(0, values.shape[2] - n_slides + 1, n_slides):
            posteriors = [known.uniform_log_prior]
            for slide in range(n_slides):
                motion = choose(posteriors[-1], slide)
                posteriors.append(known.update(posteriors[-1], motion, values[places[motion], number, first + slide]))
            right.append([int(posterior.argmax()) == truth for posterior in posteriors[1:]])
            probability.append([float(np.exp(posterior.max())) for posterior in posteriors[1:]])
    return Trials(np.array(right), np.array(probability))


def _values(
    scene: Scene, texture: str, motion: SlideMotion, count: int, *, features: FeatureSet, rng: np.random.Generator
) -> Array:
    """Return the features of slides over one texture with one motion, (count, n_features)."""
    sliding = SimulatedSlide(motion.speed_m_s, motion.force_n, motion.duration_s, motion.direction_rad)
    events = _events(scene, motion, simulate_slides(scene, texture, count, sliding, rng))
    return np.stack([vector.values for vector in features.extract_many(events)])


def _events(scene: Scene, motion: SlideMotion, samples: Array) -> Iterator[CutWindow]:
    stream = find(SENSORS, scene.sensor, 'sensor model').fast
    speed, force, length = motion.speed_m_s, motion.force_n, motion.duration_s
    for number, measured in enumerate(samples):
        window = Window(measured.astype(np.float64), stream.rate_hz, stream.channels, 0, speed, force)
        yield CutWindow(0, str(number), length, length, {'signal': window}, speed, force, '')

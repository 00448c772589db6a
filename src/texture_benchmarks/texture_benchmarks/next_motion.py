# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Slides needed to recognise a texture: with motions chosen for what they tell, in a fixed order, and at random."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from texture_benchmarks.study import DATA, BenchmarkOptions, BenchmarkResult, imported
from texture_core.config import find
from texture_core.types import AnyArray, Array, SlideMotion, Window
from texture_estimation.learners.learner import log_softmax
from texture_estimation.next_motion import NextTouchModel, log_likelihoods
from texture_estimation.recipe import load_recipe
from texture_features.feature_set import FeatureSet
from texture_features.windows import CutWindow, WindowBatch
from texture_recordings.dataset import SlideDataset
from texture_recordings.slides import SlideSamples
from texture_simulation.offline import simulate_slides
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import Scene, load_scene
from texture_simulation.sensor_models import SENSORS

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
        means = known.means[known.motions.index(order[-1])]
        places = means[truth] + rng.standard_normal((len(truth), means.shape[1]))
        posteriors = log_softmax(posteriors + log_likelihoods(places, means))
    return lambda posterior, slide: order[slide % PLANNED]


def _at_random(known: NextTouchModel, motions: Sequence[SlideMotion], rng: np.random.Generator) -> ChooseMotion:
    return lambda posterior, slide: motions[int(rng.integers(len(motions)))]


CHOICES: Mapping[str, Callable[[NextTouchModel, Sequence[SlideMotion], np.random.Generator], ChooseMotion]] = {
    'informed': _informed,
    'fixed order, planned': _planned,
    'random': _at_random,
}


def extracted(
    scene: Scene, motions: Sequence[SlideMotion], count: int, features: FeatureSet, rng: np.random.Generator
) -> Array:
    """Return the features of slides, each one window long: (n_motions, n_textures, count, n_features)."""
    return np.stack(
        [
            np.stack([_values(scene, texture, motion, count, features=features, rng=rng) for texture in scene.surfaces])
            for motion in motions
        ]
    )


def training(scene: Scene, motions: Sequence[SlideMotion], values: Array) -> NextTouchModel:
    """Learn from what `extracted` gave; the textures keep the order of their names."""
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
    """Explore each texture in trials of several slides."""
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


SCENE, RECIPE = 'oriented', 'default'
SLIDE_S = 0.5
FORCES_N, SPEEDS_M_S = (2.0, 1.0), (0.1, 0.05)
DIRECTIONS_RAD = tuple(k * math.pi / 4 for k in range(4))
MOTIONS = tuple(
    SlideMotion('linear_slide', direction, speed, force, SLIDE_S)
    for force, speed, direction in itertools.product(FORCES_N, SPEEDS_M_S, DIRECTIONS_RAD)
)
TRAINED = 20  # slides of each texture with each motion
TRIALS, SLIDES = 20, 8
SEEDS = 5
SURE = 0.95


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Explore each texture many times with each way to choose; count how often the most probable texture is right.

    Share of trials in which it is right after 1 to 8 slides of 0.5 s, one window each, described by recipe fast: mean
    over seeds; mean number of slides, and share right, when a trial ends at a probability of 0.95.
    """
    seeds, trials = (1, 3) if options.quick else (SEEDS, TRIALS)
    motions = MOTIONS[:4] if options.quick else MOTIONS
    parts = [_trials([options.seed, seed], motions, trials) for seed in range(seeds)]
    right = {name: np.mean([part[name].right.mean(axis=0) for part in parts], axis=0) for name in CHOICES}
    until = {name: np.mean([part[name].until(SURE) for part in parts], axis=0) for name in CHOICES}
    return BenchmarkResult(
        name='next_motion',
        measured=run.__doc__,
        data=f'simulated scene {SCENE}: {len(load_scene(SCENE).surfaces)} textures, {len(motions)} motions',
        split=(
            f'for each of {seeds} seeds {TRAINED} slides of each texture and motion for training and {trials} trials a '
            'texture on other slides, the same slides for every way to choose'
        ),
        numbers={
            'accuracy': {name: shares.tolist() for name, shares in right.items()},
            'until_sure': {
                name: dict(zip(('slides', 'right'), reported.tolist(), strict=True)) for name, reported in until.items()
            },
        },
    )


def _trials(seed: Sequence[int], motions: Sequence[SlideMotion], trials: int) -> dict[str, Trials]:
    """Return the trials by the way to choose."""
    scene, features = load_scene(SCENE), load_recipe(RECIPE).feature_set
    rng = np.random.default_rng(seed)
    known = training(scene, motions, extracted(scene, motions, TRAINED, features, rng))
    tests = extracted(scene, motions, trials * SLIDES, features, rng)
    return {
        name: explored(list(scene.surfaces), known, motions, tests, choose=way(known, motions, rng), n_slides=SLIDES)
        for name, way in CHOICES.items()
    }


# Among recorded speeds and forces: each texture of ntp21 has one slide of 52 to 60 mm with each motion.
TOUCH_M, TOUCHES = 0.006, 4
RECORDED = 'touches of 6 mm, every other one trained on'
Part = Mapping[tuple[SlideMotion, str], Array]  # touches (n_touches, n_features) by motion and texture


def run_recorded(options: BenchmarkOptions) -> BenchmarkResult:
    """Choose among four speeds and four forces of recorded slides, touch by touch.

    Share of trials in which the most probable texture is right after 1 to 4 touches, described by the mean over the
    taxels of the features of recipe fast.
    """
    with imported(options, 'ntp21') as bags:
        slides = SlideDataset.from_bags(bags[:4] if options.quick else bags).samples('signal')
    parts: tuple[dict[tuple[SlideMotion, str], Array], ...] = ({}, {})
    for slide in slides:
        motion = SlideMotion('linear_slide', 0.0, round(slide.speed_m_s, 3), round(slide.force_n, 2), 0.0)
        touches = _touches(slide)
        for number, part in enumerate(parts):
            part[motion, slide.surface] = touches[number::2]
    draws = [_recorded_trials(parts, trained, [options.seed, 0, trained]) for trained in (0, 1)]
    accuracy = {name: np.mean([shares[name] for shares in draws], axis=0).tolist() for name in CHOICES}
    return BenchmarkResult(
        name='next_motion_recorded',
        measured=run_recorded.__doc__,
        data=DATA['ntp21'],
        split='every other touch of each slide for training, the others for test, and the other way round',
        numbers={RECORDED: {'accuracy': accuracy}},
    )


def _touches(slide: SlideSamples) -> Array:
    """Return the features of the touches of a slide, means over the taxels, in the order of time."""
    length = round(TOUCH_M / slide.speed_m_s * slide.rate_hz)
    count = len(slide.samples) // length
    batch = WindowBatch(slide.samples[: count * length].reshape(count, length, -1), slide.rate_hz)
    [signal] = [item for item in load_recipe(RECIPE).feature_set.inputs if item.topic == 'signal']
    values: Array = np.concatenate([feature(batch) for _, feature in signal.features], axis=-1).mean(axis=1)
    return values


def _recorded_trials(parts: Sequence[Part], trained: int, seed: Sequence[int]) -> dict[str, Array]:
    """Return the share right after each touch by the way to choose.

    A touch comes again within a trial only where there are fewer than TOUCHES.
    """
    rng, known_part, tested = np.random.default_rng(seed), parts[trained], parts[1 - trained]
    textures = sorted({texture for _, texture in tested})
    motions = sorted({motion for motion, _ in tested}, key=lambda motion: (motion.speed_m_s, motion.force_n))
    keys = [(motion, texture, len(own)) for (motion, texture), own in known_part.items()]
    known = NextTouchModel.fit(
        np.concatenate(list(known_part.values())),
        [texture for _, texture, count in keys for _ in range(count)],
        [motion for motion, _, count in keys for _ in range(count)],
    )

    def drawn(touches: Array) -> Array:
        few = len(touches) < TOUCHES
        return np.concatenate([touches[rng.choice(len(touches), TOUCHES, replace=few)] for _ in range(TRIALS)])

    values = np.stack([np.stack([drawn(tested[motion, texture]) for texture in textures]) for motion in motions])
    by_way = {}
    for name, way in CHOICES.items():
        choose = way(known, motions, rng)
        done = explored(textures, known, motions, values, choose=choose, n_slides=TOUCHES)
        by_way[name] = done.right.mean(axis=0)
    return by_way

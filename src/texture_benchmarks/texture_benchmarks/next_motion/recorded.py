"""Touches of recorded slides: which speed and force to choose next, among those at which each texture was recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from texture_benchmarks.imported_data import imported
from texture_benchmarks.next_motion.chart import slides_chart
from texture_benchmarks.next_motion.trial import CHOICES, ChooseMotion, explored
from texture_benchmarks.recipes.run import DATA
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.arrays import Array
from texture_core.slide_motion import SlideMotion
from texture_estimation.next_motion.next_touch_model import NextTouchModel
from texture_estimation.recipe import load_recipe
from texture_features.feature import WindowBatch
from texture_recordings.slide_dataset import SlideDataset
from texture_recordings.slide_samples import SlideSamples

RECIPE = 'fast'
TRIALS, SLIDES, SEEDS = 20, 4, 1
SHOWN = 'touches of 6 mm, every other one trained on'
QUICK_TEXTURES = 4
WAYS = {name: CHOICES[name] for name in ('informed', 'fixed order, planned', 'random')}
BEST = 'best fixed order of two, found on the tested touches'
PARTS = ('trained on', 'tested')


@dataclass(frozen=True)
class TouchSplit:
    """How a slide is cut into touches, and which of them are trained on.

    Parameters
    ----------
    touch_m, touch_s
        Length of a touch: a distance, or a time where the distance is 0.
    alternate
        Whether every other touch is trained on; else those of the first half of the slide are.
    """

    touch_m: float = 0.0
    touch_s: float = 0.0
    alternate: bool = True

    def samples(self, slide: SlideSamples) -> int:
        """Return the length of a touch in samples."""
        seconds = self.touch_m / slide.speed_m_s if self.touch_m else self.touch_s
        return max(LEAST_SAMPLES, round(seconds * slide.rate_hz))

    def parts(self, touches: Array) -> tuple[Array, Array]:
        """Return the touches of a slide in two parts.

        Parameters
        ----------
        touches : (n_touches, n_features)
            In the order of time.

        Returns
        -------
        two of (n_touches, n_features)
            Trained on and tested, or the other way round.
        """
        middle = len(touches) // 2
        return (touches[::2], touches[1::2]) if self.alternate else (touches[:middle], touches[middle:])


LEAST_SAMPLES = 16
# A slide is 52 to 60 mm long; one at 0.1 m/s lasts 0.6 s. Each texture has one slide with each motion.
PROTOCOLS: Mapping[str, TouchSplit] = {
    SHOWN: TouchSplit(touch_m=0.006),
    'touches of 12 mm, every other one trained on': TouchSplit(touch_m=0.012),
    'touches of 0.15 s, every other one trained on': TouchSplit(touch_s=0.15),
    'touches of 12 mm, the first half trained on': TouchSplit(touch_m=0.012, alternate=False),
    'touches of 0.15 s, the first half trained on': TouchSplit(touch_s=0.15, alternate=False),
}


@dataclass(frozen=True, eq=False)
class RecordedTouches:
    """Features of the touches of all slides, in two parts.

    Parameters
    ----------
    textures, motions
        Every texture was recorded once with every motion.
    parts
        By part: motion and texture → (n_touches, n_features) in the order of time.
    """

    textures: Sequence[str]
    motions: Sequence[SlideMotion]
    parts: Sequence[Mapping[tuple[SlideMotion, str], Array]]

    @classmethod
    def of(cls, slides: Sequence[SlideSamples], protocol: TouchSplit) -> RecordedTouches:
        """Cut each slide into touches, and describe them by the mean over the taxels.

        Parameters
        ----------
        slides
            One of each texture with each speed and force.
        protocol
            How slides are cut.
        """
        parts: tuple[dict[tuple[SlideMotion, str], Array], ...] = ({}, {})
        for slide in slides:
            own = protocol.parts(_described(slide, protocol.samples(slide)))
            for part, touches in zip(parts, own, strict=True):
                part[_motion(slide), slide.surface] = touches
        return cls(sorted({texture for _, texture in parts[0]}), sorted({m for m, _ in parts[0]}, key=_order), parts)

    def training(self, part: int) -> NextTouchModel:
        """Return what one part tells of the textures under each motion."""
        keys = list(product(self.motions, self.textures))
        values = [self.parts[part][key] for key in keys]
        return NextTouchModel.fit(
            np.concatenate(values),
            [texture for (_, texture), own in zip(keys, values, strict=True) for _ in own],
            [motion for (motion, _), own in zip(keys, values, strict=True) for _ in own],
        )

    def drawn(self, part: int, trials: int, rng: np.random.Generator) -> Array:
        """Return touches of one part for trials.

        Parameters
        ----------
        part
            Of which the touches are.
        trials
            Of each texture; within one, a touch comes again only where there are fewer than SLIDES.
        rng
            Draws the touches.

        Returns
        -------
        (n_motions, n_textures, trials * SLIDES, n_features)
            As `explored` takes them.
        """
        return np.stack(
            [
                np.stack([_picked(self.parts[part][motion, texture], trials, rng) for texture in self.textures])
                for motion in self.motions
            ]
        )


@dataclass(frozen=True, eq=False)
class Found:
    """What one protocol found.

    Parameters
    ----------
    right : (n_draws, SLIDES)
        Share of trials that are right after each touch, by the way to choose.
    best_of_two
        Share right after two touches in the best order that is the same for all textures, known with hindsight.
    """

    right: Mapping[str, Array]
    best_of_two: float

    def numbers(self) -> dict[str, Any]:
        """Return the figures."""
        accuracy = {name: shares.mean(axis=0).tolist() for name, shares in self.right.items()}
        after_two = {name: shares[1] for name, shares in accuracy.items()}
        return {
            'accuracy': accuracy,
            'deviation': {name: shares.std(axis=0).tolist() for name, shares in self.right.items()},
            BEST: self.best_of_two,
            'informed_less_planned_order_after_two': after_two['informed'] - after_two['fixed order, planned'],
            'informed_less_best_order_after_two': after_two['informed'] - self.best_of_two,
        }


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Choose among four speeds and four forces of recorded slides, touch by touch."""
    with imported(options, 'ntp21') as bags:
        slides = SlideDataset.from_bags(bags[:QUICK_TEXTURES] if options.quick else bags).samples('signal')
    protocols = {SHOWN: PROTOCOLS[SHOWN]} if options.quick else PROTOCOLS
    seeds = [[options.seed, number] for number in range(1 if options.quick else SEEDS)]
    found = {name: _find(RecordedTouches.of(slides, protocol), seeds) for name, protocol in protocols.items()}
    path = options.out / 'next_motion_recorded.png'
    return BenchmarkResult(
        name='next_motion_recorded',
        measured=(
            f'share of trials in which the most probable texture is right after 1 to {SLIDES} touches at a chosen '
            f'speed and force, described by the mean over the taxels of the features of recipe {RECIPE}; after two '
            'touches also in that order of two, the same for all textures, which is right most often on the tested '
            'touches themselves'
        ),
        data=DATA['ntp21'],
        split=(
            'touches of one part of each slide for training, of the other part for test, and the other way round; '
            f'{len(seeds)} draws of {TRIALS} trials a texture each'
        ),
        numbers={name: own.numbers() for name, own in found.items()},
        charts=(slides_chart(found[SHOWN].right, (), path, 'ntp21, recorded, 4 speeds and 4 forces'),),
    )


def _find(touches: RecordedTouches, seeds: Sequence[Sequence[int]]) -> Found:
    draws = [_trials(touches, trained, seed) for seed in seeds for trained in range(len(PARTS))]
    right = {name: np.stack([shares[name] for shares, _ in draws]) for name in WAYS}
    return Found(right, float(np.mean([best for _, best in draws])))


def _trials(touches: RecordedTouches, trained: int, seed: Sequence[int]) -> tuple[dict[str, Array], float]:
    """Return the share right after each touch by the way to choose, and that of the best fixed order of two."""
    rng, known = np.random.default_rng([*seed, trained]), touches.training(trained)
    values = touches.drawn(1 - trained, TRIALS, rng)

    def shares(choose: ChooseMotion) -> Array:
        done = explored(touches.textures, known, touches.motions, values, choose=choose, n_slides=SLIDES)
        right: Array = done.right.mean(axis=0)
        return right

    by_way = {name: shares(way(known, touches.motions, rng)) for name, way in WAYS.items()}
    return by_way, _best_of_two(touches, known, values)


def _best_of_two(touches: RecordedTouches, known: NextTouchModel, values: Array) -> float:
    """Return the share right of the best order of two motions, chosen with hindsight."""
    truth = np.repeat([known.textures.index(texture) for texture in touches.textures], TRIALS)
    likelihoods = [
        [
            known.gaussians[motion].log_likelihoods(own[:, number::SLIDES].reshape(len(truth), -1) @ known.projection)
            for number in (0, 1)
        ]
        for motion, own in zip(touches.motions, values, strict=True)
    ]
    return max(
        float(np.mean((one[0] + other[1]).argmax(axis=1) == truth)) for one, other in product(likelihoods, likelihoods)
    )


def _picked(values: Array, trials: int, rng: np.random.Generator) -> Array:
    few = len(values) < SLIDES
    return np.concatenate([values[rng.choice(len(values), SLIDES, replace=few)] for _ in range(trials)])


def _described(slide: SlideSamples, length: int) -> Array:
    count = len(slide.samples) // length
    batch = WindowBatch(slide.samples[: count * length].reshape(count, length, -1), slide.rate_hz)
    [signal] = [item for item in load_recipe(RECIPE).feature_set.inputs if item.topic == 'signal']
    values: Array = np.concatenate([feature(batch) for _, feature in signal.features], axis=-1).mean(axis=1)
    return values


def _motion(slide: SlideSamples) -> SlideMotion:
    return SlideMotion('linear_slide', 0.0, round(slide.speed_m_s, 3), round(slide.force_n, 2), 0.0)


def _order(motion: SlideMotion) -> tuple[float, float]:
    return motion.speed_m_s, motion.force_n

"""Slides needed to recognise a texture: with motions chosen for what they tell, in a fixed order, and at random."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence

import numpy as np

from texture_benchmarks.next_motion.chart import slides_chart
from texture_benchmarks.next_motion.trial import CHOICES, Trials, explored, extracted, training
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.arrays import Array
from texture_core.slide_motion import SlideMotion
from texture_estimation.next_motion.next_touch_model import NextTouchModel
from texture_estimation.recipe import load_recipe
from texture_simulation.scene import load_scene

SCENE, RECIPE = 'oriented', 'fast'
SLIDE_S = 0.5
FORCES_N, SPEEDS_M_S = (2.0, 1.0), (0.1, 0.05)
DIRECTIONS_RAD = tuple(k * math.pi / 4 for k in range(4))
# In an order that turns before it changes the speed, then the force: the kindest of the simple ones.
MOTIONS = tuple(
    SlideMotion('linear_slide', direction, speed, force, SLIDE_S)
    for force, speed, direction in itertools.product(FORCES_N, SPEEDS_M_S, DIRECTIONS_RAD)
)
TRAINED = 20  # slides of each texture with each motion
TRIALS, SLIDES = 20, 8
SEEDS = 5
WANTED = (0.9, 0.95)
SURE = 0.95


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Explore each texture many times with each way to choose; count how often the most probable texture is right."""
    seeds, trials = (1, 3) if options.quick else (SEEDS, TRIALS)
    motions = MOTIONS[:4] if options.quick else MOTIONS
    parts = [_trials([options.seed, seed], motions, trials) for seed in range(seeds)]
    right = {name: np.stack([part[name].right.mean(axis=0) for part, _ in parts]) for name in CHOICES}
    until = {name: np.mean([part[name].until(SURE) for part, _ in parts], axis=0) for name in CHOICES}
    return BenchmarkResult(
        name='next_motion',
        measured=(
            f'share of trials in which the most probable texture is right after 1 to {SLIDES} slides of {SLIDE_S} s, '
            f'one window each, described by recipe {RECIPE}: mean and standard deviation over seeds; slides until '
            'that mean is wanted; mean number of slides, and share right, when a trial ends at a probability of '
            f'{SURE}; computing time of one choice'
        ),
        data=f'simulated scene {SCENE}: {len(load_scene(SCENE).surfaces)} textures, {len(motions)} motions',
        split=(
            f'for each of {seeds} seeds {TRAINED} slides of each texture and motion for training and {trials} trials a '
            'texture on other slides, the same slides for every way to choose'
        ),
        numbers={
            'accuracy': {name: shares.mean(axis=0).tolist() for name, shares in right.items()},
            'deviation': {name: shares.std(axis=0).tolist() for name, shares in right.items()},
            'slides_wanted': {
                str(wanted): {name: _slides_until(shares.mean(axis=0), wanted) for name, shares in right.items()}
                for wanted in WANTED
            },
            'until_sure': {
                name: dict(zip(('slides', 'right'), reported.tolist(), strict=True)) for name, reported in until.items()
            },
            'choosing_us': float(np.median([cost for _, cost in parts])),
        },
        charts=(slides_chart(right, WANTED, options.out / 'next_motion.png'),),
    )


def _trials(seed: Sequence[int], motions: Sequence[SlideMotion], trials: int) -> tuple[dict[str, Trials], float]:
    """Return the trials by the way to choose, and the microseconds of one choice."""
    scene, features = load_scene(SCENE), load_recipe(RECIPE).feature_set
    rng = np.random.default_rng(seed)
    known = training(scene, motions, extracted(scene, motions, TRAINED, features, rng))
    tests = extracted(scene, motions, trials * SLIDES, features, rng)
    done = {
        name: explored(list(scene.surfaces), known, motions, tests, choose=way(known, motions, rng), n_slides=SLIDES)
        for name, way in CHOICES.items()
    }
    return done, _choosing_us(known, motions)


def _choosing_us(known: NextTouchModel, motions: Sequence[SlideMotion], repeats: int = 20) -> float:
    start_s = time.process_time()
    for _ in range(repeats):
        known.best_motion(known.uniform_log_prior, motions)
    return 1e6 * (time.process_time() - start_s) / repeats


def _slides_until(accuracy: Array, wanted: float) -> int | None:
    """Return the number of slides from which on the accuracy is as wanted; None if it never is."""
    short = np.flatnonzero(accuracy < wanted)
    first = int(short[-1]) + 1 if len(short) else 0
    return first + 1 if first < len(accuracy) else None

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Textures added slide by slide against a training on the same slides, and slides needed with chosen motions."""

from __future__ import annotations

import itertools
import math
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult, recorded
from texture_core.types import Array, SlideMotion, Window
from texture_estimation.incremental import IncrementalClassifier
from texture_estimation.learners.mlp import Mlp
from texture_estimation.model import TextureModel
from texture_estimation.next_motion import NextTouchModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.training import train
from texture_evaluation.cross_validation import predict_slides
from texture_evaluation.metrics import window_accuracy
from texture_evaluation.train import training_examples
from texture_features.feature_set import FeatureSet, LabelledFeatures
from texture_features.windows import CutWindow, WindowBatch
from texture_recordings.dataset import SlideDataset
from texture_recordings.slides import SlideSamples
from texture_simulation.offline import simulate_slides
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import load_scene
from texture_simulation.sensor_models import SENSORS

Scores = dict[str, dict[str, float]]  # accuracy of test windows and of whole test slides by model and test
OLD, NEW_ONES = 'incremental, old textures', 'incremental, new textures'


def run_incremental(
    recipe: Recipe,
    examples: LabelledFeatures,
    new: Sequence[str],
    *,
    last_training: int,
    stages: Sequence[int],
    path: Path,
) -> tuple[dict[int, Scores], dict[str, float], list[float]]:
    """Train all labels but `new`, and add these slide by slide, in the folder of `path`.

    Returns the scores by the number of slides of each new texture, those on the old textures alone before any slide
    was added, and the processor time of adding each, s.
    """
    numbers = np.array([int(group.rsplit('/', 1)[1].removeprefix('slide')) for group in examples.groups])
    is_new = np.isin(examples.labels, list(new))
    test, training = numbers > last_training, numbers <= last_training
    base = train(recipe, examples.take(training & ~is_new))
    base.save(path)
    incremental, add_s, scores = IncrementalClassifier(base, path), list[float](), dict[int, Scores]()
    for stage, before in zip(stages, (0, *stages), strict=False):
        for number, label in itertools.product(range(before + 1, stage + 1), new):
            [slide] = set(examples.groups[(numbers == number) & (examples.labels == label)].tolist())
            for vector in examples.vectors(slide):
                incremental.observe(vector)
            began_s = time.process_time()
            incremental.add(label, slide)
            add_s.append(time.process_time() - began_s)
        retrained = train(recipe, examples.take(training & (~is_new | (numbers <= stage))))
        scores[stage] = {
            'incremental': score(incremental.model, examples.take(test)),
            'retrained': score(retrained, examples.take(test)),
            NEW_ONES: score(incremental.model, examples.take(test & is_new)),
            OLD: score(incremental.model, examples.take(test & ~is_new)),
        }
    return scores, score(base, examples.take(test & ~is_new)), add_s


def score(model: TextureModel, examples: LabelledFeatures) -> dict[str, float]:
    """Return the accuracy of the windows and of the whole slides."""
    results = list(predict_slides(model, examples).values())
    slides = float(np.mean([one.end.label == one.surface for one in results]))
    return {'windows': window_accuracy(results), 'slides': slides}


# --------------------
# Slides needed to recognise a texture: with motions chosen by information gain, in a fixed order, and at random.

SIMULATED, RECORDED = 'simulated', 'recorded'
SCENE, SLIDE_S = 'oriented', 0.5
TOUCH_FEATURES = FeatureSet.from_mapping(
    {'inputs': {'signal': {'features': [{'mean_log_bands': {'bands': 32}}, 'moments']}}}
)
MOTIONS = tuple(
    SlideMotion('linear_slide', quarter * math.pi / 4, speed, force, SLIDE_S)
    for force, speed, quarter in itertools.product((2.0, 1.0), (0.1, 0.05), range(4))
)
TRAINED_SLIDES, SLIDES, TRIALS, SEEDS = 20, 8, 20, 5  # TRAINED_SLIDES of each texture with each motion
TOUCH_M, TOUCHES = 0.006, 4  # each texture of ntp21 has one slide of 52 to 60 mm with each speed and force


def right_after_slides(
    known: NextTouchModel, motions: Sequence[SlideMotion], values: Array, rng: np.random.Generator, n_slides: int
) -> dict[str, Array]:
    """Return the accuracy of trials after each slide, by the strategy that chooses motions.

    `values` are features of slides (n_motions, n_textures, n_trials · n_slides, n_features), in the order of the known
    textures. The fixed order is the one that is chosen most often.
    """
    chosen: list[SlideMotion] = []
    ways: Mapping[str, Callable[[Array, int], SlideMotion]] = {
        'informed': lambda posterior, _: known.best_motion(posterior, motions).motion,
        'fixed order': lambda _, slide: Counter(chosen[slide::n_slides]).most_common(1)[0][0],
        'random': lambda *_: motions[int(rng.integers(len(motions)))],
    }
    fractions = {}
    for name, choose in ways.items():
        right = []
        for truth, first in itertools.product(range(values.shape[1]), range(0, values.shape[2], n_slides)):
            posterior = known.uniform_log_prior
            for slide in range(n_slides):
                motion = choose(posterior, slide)
                chosen += [motion] * (name == 'informed')
                posterior = known.update(posterior, motion, values[motions.index(motion), truth, first + slide])
                right.append(int(posterior.argmax()) == truth)
        fractions[name] = np.reshape(right, (-1, n_slides)).mean(axis=0)
    return fractions


def known_from(motions: Sequence[SlideMotion], values: Array, textures: Sequence[str]) -> NextTouchModel:
    """Learn from features of slides, (n_motions, n_textures, n_slides, n_features)."""
    n_motions, _, count, n_features = values.shape
    return NextTouchModel.fit(
        values.reshape(-1, n_features),
        np.tile(np.repeat(textures, count), n_motions).tolist(),
        np.repeat(np.array(motions, dtype=object), len(textures) * count).tolist(),
    )


def simulated_slides(motions: Sequence[SlideMotion], count: int, rng: np.random.Generator) -> Array:
    """Return the features of slides of one window each, (n_motions, n_textures, count, n_features)."""
    scene = load_scene(SCENE)
    stream = SENSORS[scene.sensor].fast
    cells = []
    for motion, surface in itertools.product(motions, sorted(scene.surfaces)):
        speed, force = motion.speed_m_s, motion.force_n
        samples = simulate_slides(
            scene, surface, count, SimulatedSlide(speed, force, SLIDE_S, motion.direction_rad), rng
        )
        windows = [Window(raw.astype(np.float64), stream.rate_hz, stream.channels, 0, speed, force) for raw in samples]
        events = [CutWindow(0, '', SLIDE_S, SLIDE_S, {'signal': window}, speed, force, '') for window in windows]
        cells.append(np.stack([vector.values for vector in TOUCH_FEATURES.extract_many(events)]))
    return np.stack(cells).reshape(len(motions), len(scene.surfaces), count, -1)


def recorded_touches(slide: SlideSamples) -> Array:
    """Return the features of the touches of a slide, means over the taxels, in the order of time."""
    length = round(TOUCH_M / slide.speed_m_s * slide.rate_hz)
    count = len(slide.samples) // length
    batch = WindowBatch(slide.samples[: count * length].reshape(count, length, -1), slide.rate_hz)
    [raw] = TOUCH_FEATURES.inputs
    return np.concatenate([feature(batch) for _, feature in raw.features], axis=-1).mean(axis=1)


def chosen_motions(options: BenchmarkOptions, dataset: SlideDataset) -> dict[str, dict[str, list[float]]]:
    """Return the accuracy after each slide, simulated and recorded, by the strategy that chooses motions."""
    found: dict[str, list[dict[str, Array]]] = {SIMULATED: [], RECORDED: []}

    # Simulated: other slides of the same textures and motions.
    textures = sorted(load_scene(SCENE).surfaces)
    motions, seeds, trials = (MOTIONS[:4], 1, 3) if options.quick else (MOTIONS, SEEDS, TRIALS)
    for seed in range(seeds):
        rng = np.random.default_rng([options.seed, seed])
        known = known_from(motions, simulated_slides(motions, TRAINED_SLIDES, rng), textures)
        tested = simulated_slides(motions, trials * SLIDES, rng)
        found[SIMULATED].append(right_after_slides(known, motions, tested, rng, SLIDES))

    # Recorded: every other touch of each slide is trained, and the others are drawn for the test.
    names = list(dict.fromkeys(dataset.labels.tolist()))
    slides = dataset.select(labels=names[: 4 if options.quick else None]).samples('signal')
    touches = {
        (SlideMotion('linear_slide', 0.0, round(one.speed_m_s, 3), round(one.force_n, 2), 0.0), one.surface): (
            recorded_touches(one)
        )
        for one in slides
    }
    kinds, surfaces = list(dict.fromkeys(motion for motion, _ in touches)), sorted({name for _, name in touches})
    for trained in (0, 1):
        rng = np.random.default_rng([options.seed, trained])
        tests = [(motion, name, values[trained::2]) for (motion, name), values in touches.items()]
        known = NextTouchModel.fit(
            np.concatenate([values for *_, values in tests]),
            [name for _, name, values in tests for _ in values],
            [motion for motion, _, values in tests for _ in values],
        )

        def drawn(values: Array, rng: np.random.Generator = rng) -> Array:
            few = len(values) < TOUCHES  # only then a touch comes again within a trial
            return np.concatenate([values[rng.choice(len(values), TOUCHES, replace=few)] for _ in range(TRIALS)])

        cells = [drawn(touches[cell][1 - trained :: 2]) for cell in itertools.product(kinds, surfaces)]
        tested = np.stack(cells).reshape(len(kinds), len(surfaces), TRIALS * TOUCHES, -1)
        found[RECORDED].append(right_after_slides(known, kinds, tested, rng, TOUCHES))
    return {
        source: {way: np.mean([one[way] for one in parts], axis=0).round(4).tolist() for way in parts[0]}
        for source, parts in found.items()
    }


# --------------------
# The study.

RECIPE = 'default'
TRAINED, STAGES, NEW, DRAWS = 30, (1, 2, 5, 10, 30), 5, 3
QUICK_SLIDES, QUICK_TRAINED, QUICK_STAGES = '1-3,31-32', 3, (1, 2)
QUICK_MATERIALS = ('material01', 'material02', 'material03', 'material04')
FOLDS = 2  # for the calibration alone: less to wait for


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on 15 materials, add 5 more, test on later slides of all; several draws of the five.

    Accuracy of test windows and of whole test slides (final estimate), mean over the draws; processor
    time of adding a slide, stored on disk. Chosen motions: accuracy of the most probable texture over trials
    after each slide, of simulated slides of 0.5 s (scene oriented, 16 motions) and of recorded touches of 6 mm (ntp21,
    16 speeds and forces, every other touch of each slide trained on), both described by mean_log_bands and moments.
    """
    recipe = load_recipe(RECIPE)
    if isinstance(recipe.learner, Mlp):
        recipe = replace(recipe, learner=replace(recipe.learner, folds=FOLDS))
    stages, last_training = (QUICK_STAGES, QUICK_TRAINED) if options.quick else (STAGES, TRAINED)
    size, count = (1, 1) if options.quick else (NEW, DRAWS)
    slides = recorded(options, 'biotac20', (QUICK_SLIDES, QUICK_MATERIALS), topics=recipe.feature_set.topics)
    examples = training_examples(recipe, slides)
    with tempfile.TemporaryDirectory() as folder:
        labels, rng = np.unique(examples.labels), np.random.default_rng(options.seed)
        draws = [rng.permutation(labels)[:size] for _ in range(count)]
        given: Any = {'last_training': last_training, 'stages': stages}
        runs = [
            run_incremental(recipe, examples, draw.tolist(), **given, path=Path(folder) / f'draw{number}')
            for number, draw in enumerate(draws)
        ]
    chosen = chosen_motions(options, recorded(options, 'ntp21'))
    return BenchmarkResult(
        data=f'BioTac vibration, {len(labels)} materials (github dexrob/BioTac_slide_20_50, Gao et al. 2020), recipe '
        f'{RECIPE} calibrated in {FOLDS} parts',
        split=f'{count} draws of {size} new materials: trained on slides 1-{last_training} of the others, trained '
        f'slide by slide from slide 1 on, tested on the slides after {last_training} of all',
        numbers={**_numbers(runs, draws, stages), 'chosen_motions': chosen},
    )


def _numbers(runs: Sequence[tuple[Any, ...]], draws: Sequence[Any], stages: Sequence[int]) -> dict[str, Any]:
    """Return the scores, mean over the runs, and the times of adding a slide."""

    def mean(scores: Sequence[Mapping[str, float]]) -> dict[str, float]:
        return {name: round(float(np.mean([one[name] for one in scores])), 4) for name in scores[0]}

    add_ms = 1000 * np.concatenate([add_s for *_, add_s in runs])
    return {
        'new': [sorted(draw.tolist()) for draw in draws],
        'slides': {
            str(stage): {which: mean([scores[stage][which] for scores, *_ in runs]) for which in runs[0][0][stage]}
            for stage in stages
        },
        'old textures before any added slide': mean([before for _, before, _ in runs]),
        'add_ms': {
            'added_slides': len(add_ms),
            'median': round(float(np.median(add_ms)), 1),
        },
    }

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What collecting at several places brings, on simulated samples that vary along their length; and their anchor."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import signal
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_core.types import Array
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_evaluation.cross_validation import interval, predict_slides
from texture_evaluation.train import training_examples
from texture_recordings.dataset import SlideDataset
from texture_simulation.offline import simulate_slides
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import Scene, load_scene
from texture_simulation.sensor_models import SENSORS

SCENE, RECIPE = 'varying', 'default'
SEEDS, QUICK_SEEDS = 6, 1  # of the fields over the samples
SPEED_M_S, FORCE_N, SLIDE_S = 0.022, 2.0, 2.5  # of the anchor: half of the 11 cm of the recorded slides
HALVES_M = (0.0, 0.055)
ASTRAY_M = 5e-4  # standard deviation of where a slide over a track begins
TRAINED, TESTED = 30, 10
PLACES = 6
PATCH_M = 0.1  # side of the patch on which places are drawn
NEW_PLACES = 8  # of each surface, tested
FIGURES = ('right', 'accepted_correct', 'accepted_wrong')


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on slides of one half of a track, and at one or six places; test at the other half, and at new places.

    The anchor: a support vector machine on log bands and moments, trained on one half of a track, as on the recorded
    slides. The comparison: a recipe trained on six slides of one track, or on one slide at each of six places and
    directions, tested on slides at new places: label right, right and known, wrong and known; 95 % intervals of the
    differences by bootstrap over samples × surfaces.
    """
    halves, slides = [], []
    for seed in range(QUICK_SEEDS if options.quick else SEEDS):
        scene, rng = reseeded(load_scene(SCENE), seed), np.random.default_rng([options.seed, seed])
        halves.append(_halves(scene, rng))
        slides.append(_new_places(scene, rng))
    track, places = (np.concatenate([one[which] for one in slides]) for which in (0, 1))  # (n_cells, 4)
    total = places[:, -1].sum()
    same, other = np.mean(halves, axis=0)
    numbers: dict[str, Any] = {
        'anchor': {'same_half': float(same), 'other_half': float(other)},
        'new_places': {
            'slides': int(total),
            **{
                name: {figure: float(own[:, column].sum() / total) for column, figure in enumerate(FIGURES)}
                for name, own in (('one_track', track), ('six_places', places))
            },
            'gain_interval': {
                figure: interval(np.stack([places[:, column] - track[:, column], places[:, -1]], axis=1))
                for column, figure in enumerate(FIGURES)
            },
        },
    }
    return BenchmarkResult(
        name='places',
        measured=run.__doc__,
        data=f'simulated scene {SCENE}, its samples drawn {len(halves)} times; recipe {RECIPE}',
        split=f'anchor: slides 1-{TRAINED} of one half of a track trained, {TESTED} others tested on either half, '
        f'{SLIDE_S:g} s at {SPEED_M_S:g} m/s; six slides of each surface trained, {NEW_PLACES} new places tested',
        numbers=numbers,
    )


def reseeded(scene: Scene, seed: int) -> Scene:
    """Return the scene with other samples of its surfaces."""
    surfaces = {
        name: replace(one, variation=replace(one.variation, seed=one.variation.seed + seed))
        for name, one in scene.surfaces.items()
        if one.variation
    }
    return replace(scene, surfaces=surfaces)


def _halves(scene: Scene, rng: np.random.Generator) -> Array:
    """Return the fractions that a plain classifier has right on the half that it was trained on, and on the other."""
    count = TRAINED + TESTED
    by_half = []
    for start_m in HALVES_M:
        x_m, y_m = (start + ASTRAY_M * rng.standard_normal(count) for start in (start_m, 0.0))
        sliding = SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S, start_x_m=x_m, start_y_m=y_m)
        made = [simulate_slides(scene, name, count, sliding, rng)[..., 0] for name in scene.surfaces]
        by_half.append(_plain_features(np.stack(made), SENSORS[scene.sensor].fast.rate_hz))
    codes = np.repeat(np.arange(len(scene.surfaces)), count)
    early = np.tile(np.arange(count) < TRAINED, len(scene.surfaces))
    found = []
    for own, other in ((0, 1), (1, 0)):
        model = make_pipeline(StandardScaler(), SVC(C=10.0))
        model.fit(by_half[own][early], codes[early])
        found.append([model.score(by_half[half][~early], codes[~early]) for half in (own, other)])
    return np.asarray(np.mean(found, axis=0))


def _plain_features(samples: Array, rate_hz: float) -> Array:
    """Return 48 log bands and the moments of slides, (n_surfaces, n_slides, n_samples), one row a slide."""
    hertz, power = signal.welch(samples.reshape(-1, samples.shape[-1]), rate_hz, nperseg=512)
    edges = np.clip(np.searchsorted(hertz, np.geomspace(4.0, rate_hz / 2, 49)), 1, len(hertz) - 1)
    bands = [power[:, low : max(high, low + 1)].mean(axis=1) for low, high in itertools.pairwise(edges)]
    deviation = samples.reshape(len(power), -1) - samples.reshape(len(power), -1).mean(axis=1, keepdims=True)
    rms = deviation.std(axis=1)
    moments = [np.log(rms), *(np.mean(deviation**order, axis=1) / rms**order for order in (3, 4))]
    return np.column_stack([*np.log(np.array(bands) + 1e-12), *moments])


def _new_places(scene: Scene, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return FIGURES and slides tested of each surface, (n_surfaces, 4), trained on one track and at six places."""
    scattered = rng.uniform(0.0, PATCH_M, (2, len(scene.surfaces), PLACES + NEW_PLACES))
    turned = rng.uniform(-np.pi, np.pi, (len(scene.surfaces), PLACES + NEW_PLACES))
    track = ASTRAY_M * rng.standard_normal((2, len(scene.surfaces), PLACES))
    recipe = load_recipe(RECIPE)
    tested = slides_at(scene, scattered[..., PLACES:], turned[:, PLACES:], rng).features(recipe.feature_set)
    found = []
    for places, directions in ((track, 0.0 * turned[:, :PLACES]), (scattered[..., :PLACES], turned[:, :PLACES])):
        slides = slides_at(scene, places, directions, rng)
        if places is not track:  # as in the bags of `texture collect`
            slides = SlideDataset(tuple(replace(one, place=f'at {one.number}') for one in slides))
        results = predict_slides(train(recipe, training_examples(recipe, slides)), tested).values()
        cells = []
        for name in scene.surfaces:
            own = [(one.end.label == name, one.end.known) for one in results if one.surface == name]
            known = [right for right, is_known in own if is_known]
            cells.append([sum(right for right, _ in own), sum(known), len(known) - sum(known), len(own)])
        found.append(np.array(cells, dtype=np.float64))
    return found[0], found[1]


def slides_at(scene: Scene, places_m: Array, directions_rad: Array, rng: np.random.Generator) -> SlideDataset:
    """Return a slide over each surface at each place, (2, n_surfaces, n_places), in each direction."""
    stream, count = SENSORS[scene.sensor].fast, places_m.shape[-1]
    made = [
        simulate_slides(
            scene, name, count, SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S, turned, 0.0, x_m, y_m), rng
        )
        for name, x_m, y_m, turned in zip(scene.surfaces, *places_m, directions_rad, strict=True)
    ]  # fmt: skip
    return SlideDataset.from_arrays(
        {'signal': [one for slides in made for one in slides]},
        [name for name in scene.surfaces for _ in range(count)],
        {'signal': stream.rate_hz},
        channels={'signal': stream.channels},
        speed_m_s=SPEED_M_S,
        force_n=FORCE_N,
        direction_rad=directions_rad.ravel().tolist(),
    )

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What `texture check` brings back: another finger by one plate, another day by a slide of each surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from texture_benchmarks.borders import DATES, DAY, BorderTrial, fingersense, for_recipe, recipe_of
from texture_benchmarks.disturbances import ROWS, TRAINED, disturbed, simulate
from texture_benchmarks.study import DATA, BenchmarkOptions, BenchmarkResult, imported, map_forked
from texture_benchmarks.trust import Outcome, evaluate_slides
from texture_estimation.incremental import adapted
from texture_estimation.model import TextureModel
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_evaluation.check import statistics_of
from texture_evaluation.cross_validation import interval, predict_slides
from texture_evaluation.train import training_examples
from texture_features.correction import CORRECTED, Correction, compare
from texture_recordings.dataset import LabelledSlide, SlideDataset

FINGER, RESPONSE_DB = ROWS['another finger'], 2.0
TRAINED_ON, REFERENCE, TODAY, TESTED = '1-30', '30', '31', '32,35,38'
OF_DAY = 'taxels-any-day'


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Test a model with another finger or on another day, before and after `texture check`.

    Other finger: slides under a smooth random response of 2 dB, right and known, wrong and known, before and after a
    correction by one slide over one material, each material in turn as the plate. Other day: a date left out of the
    training; labels right at the end before and after one slide of each fabric of that date, the middle one in the
    order recorded, is labelled; those slides are not tested. 95 % intervals by bootstrap over surfaces × dates.
    """
    if options.quick:
        slides = simulate(TRAINED, 9, np.random.default_rng(options.seed), told=True)
        finger = _other_finger(slides, 'fast', ('1-6', '6', '7', '8-9'), 1)
        return BenchmarkResult('finger_check', run.__doc__, 'simulated scene', 'simulated', {'other_finger': finger})
    with imported(options, 'biotac20') as bags:
        slides = SlideDataset.from_bags(bags)
    finger = _other_finger(slides, 'default', (TRAINED_ON, REFERENCE, TODAY, TESTED))
    trials = [trial for trial in fingersense(options, since='2021-05-23') if DAY in trial.tested]
    return BenchmarkResult(
        name='finger_check',
        measured=run.__doc__,
        data=f'{DATA["biotac20"]}, the other finger computed; fingersense: four fabrics on dates of May and June '
        '2021, 16 taxels at a nominal 50 Hz',
        split=f'biotac20, default: trained on slides {TRAINED_ON}, plate of the training slide {REFERENCE}, of the '
        f'other finger slide {TODAY}, tested {TESTED}, the same track; fingersense, {OF_DAY}: one date out of '
        f'{", ".join(DATES)}, trained on all others from 23 May on',
        numbers={'other_finger': finger, 'other_day': _other_day(trials)},
    )


def _other_finger(
    slides: SlideDataset, recipe_name: str, split: tuple[str, str, str, str], most: int | None = None
) -> dict[str, Any]:
    """Return how slides of another finger end before and after a correction by each surface as the plate."""
    trained, reference, today, tested = (slides.select(numbers) for numbers in split)
    model = train(load_recipe(recipe_name), training_examples(load_recipe(recipe_name), trained))
    other = [disturbed(one, FINGER, RESPONSE_DB, np.random.default_rng(0)) for one in tested]
    plates = sorted(set(slides.labels.tolist()))[:most]
    pairs = [(reference.select(labels=[plate])[0], today.select(labels=[plate])[0]) for plate in plates]
    outcomes = map_forked(partial(_corrected, model, other, pairs), list(range(len(plates))))
    return {
        'slides': len(tested),
        'undisturbed': _counts(Outcome.of(evaluate_slides(model, tested.slides))),
        'before': _counts(Outcome.of(evaluate_slides(model, other))),
        'after': dict(zip(plates, map(_counts, outcomes), strict=True)),
    }


def _corrected(
    model: TextureModel,
    other: Sequence[LabelledSlide],
    pairs: Sequence[tuple[LabelledSlide, LabelledSlide]],
    which: int,
) -> Outcome:
    reference, today = pairs[which]
    theirs = disturbed(today, FINGER, RESPONSE_DB, np.random.default_rng(0))
    topics = ['signal']
    before, after = (statistics_of(slide, topics) for slide in (reference, theirs))
    correction = Correction.of({topic: compare(before[topic], after[topic]) for topic in topics})
    return Outcome.of(evaluate_slides(corrected(model, correction), other))


def corrected(model: TextureModel, correction: Correction) -> TextureModel:
    """Return a model whose features are those of a corrected finger."""
    feature_set = replace(model.recipe.feature_set, correction=correction, _layouts={})
    fingerprint = f'{model.feature_set}{CORRECTED}{correction.fingerprint}'
    return replace(model, feature_set=fingerprint, recipe=replace(model.recipe, feature_set=feature_set))


def _counts(outcome: Outcome) -> dict[str, int]:
    return {
        'right': outcome.label_right,
        'accepted_correct': outcome.final_right,
        'accepted_wrong': outcome.final_wrong,
    }


def _other_day(trials: Sequence[BorderTrial]) -> dict[str, Any]:
    recipe = recipe_of(OF_DAY)
    cells: dict[str, list[list[float]]] = {'before': [], 'after': []}
    for trial in trials:
        examples = training_examples(recipe, for_recipe(trial.trained, recipe))
        model, tested = train(recipe, examples), for_recipe(trial.tested[DAY], recipe)
        own = {name: [one for one in tested if one.surface == name] for name in set(tested.labels.tolist())}
        shots = [slides[(len(slides) - 1) // 2] for slides in own.values()]
        rest = SlideDataset(tuple(one for one in tested if one not in shots)).features(recipe.feature_set)
        today = adapted(model, examples, SlideDataset(tuple(shots)).features(recipe.feature_set))
        for name, judged in (('before', model), ('after', today)):
            results = list(predict_slides(judged, rest).values())
            for surface in own:
                right = [one.end.label == surface for one in results if one.surface == surface]
                cells[name].append([sum(right), len(right)])
    arrays = {name: np.array(values, dtype=np.float64) for name, values in cells.items()}
    return {
        'slides': int(arrays['after'][:, 1].sum()),
        **{name: float(own[:, 0].sum() / own[:, 1].sum()) for name, own in arrays.items()},
        'interval': {name: interval(own) for name, own in arrays.items()},
    }

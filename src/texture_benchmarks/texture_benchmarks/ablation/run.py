"""Ablation of features, parameters, units and channels: accuracy and computing time without each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from texture_benchmarks.ablation.chart import ablation_chart
from texture_benchmarks.ablation.variants import (
    HALVED,
    KEPT_CHANNELS,
    SHIPPED,
    SLOW_VARIANTS,
    VARIANTS,
    WITHIN,
    Changes,
    changed,
    with_slow_channels,
)
from texture_benchmarks.recipes.run import (
    ALL_CHANNELS,
    DATA,
    LAST_TRAINED,
    QUICK_LAST_TRAINED,
    RATE_HZ,
    VIBRATION,
    biotac20_settings,
)
from texture_benchmarks.recipes.trial import all_at_rate, comparable, latencies_us
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.errors import InvalidData
from texture_estimation.channels import with_channels
from texture_estimation.classification.decision_fitting import DEFAULT_TEMPERING_EXPONENT
from texture_estimation.model import TextureModel
from texture_estimation.open_set.error_bound import ErrorBound
from texture_estimation.recipe import Recipe, load_recipe
from texture_features.labelled_features import LabelledFeatures
from texture_recordings.slide_dataset import SlideDataset

FOLDS, QUICK_FOLDS = 3, 2
QUICK = (SHIPPED, 'without moments')


@dataclass(frozen=True, eq=False)
class _Case:
    """One way to recognise."""

    recipe: Recipe
    dataset: SlideDataset


@dataclass(frozen=True, eq=False)
class _AblationResult:
    """What came of it: a model, the share of held-out windows that were right, and the windows of later slides."""

    case: _Case
    model: TextureModel
    held_out: float
    later: LabelledFeatures

    def right_later(self) -> float:
        """Return the share of the later windows that are recognised."""
        said = self.model.decide(self.later.values)
        return float(np.mean([own == label for own, label in zip(said, self.later.labels, strict=True)]))


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Leave out one thing after the other; evaluate by slides held out, look at the later ones once."""
    settings = biotac20_settings(options)
    vibration, everything = settings[VIBRATION].dataset, settings[ALL_CHANNELS].dataset
    numbers = {
        VIBRATION: _figures(_vibration_cases(vibration), options),
        ALL_CHANNELS: _figures(_channel_cases(everything), options),
    }
    return BenchmarkResult(
        name='ablation',
        measured='share of single windows of 0.5 s recognised; median time from window to estimate (µs); count of '
        f'values. Of what is at most {100 * WITHIN:g} point below the best the quickest is `smallest`',
        data=DATA['biotac20'],
        split=f'chosen by `held_out`: slides 1-{LAST_TRAINED} of each material, a third of them held out in turn, '
        f'neighbours in time together; `later`, trained on slides 1-{LAST_TRAINED} and tested on the later ones, '
        'is shown for what ships, the best and the smallest',
        numbers=numbers,
        charts=(ablation_chart(numbers, options.out / 'ablation.png'),),
    )


def _vibration_cases(dataset: SlideDataset) -> dict[str, _Case]:
    recipe = with_channels(load_recipe('default'), 'fast')
    cases = {name: _case(recipe, changes, RATE_HZ, dataset) for name, changes in VARIANTS.items()}
    slower = all_at_rate(dataset, 'signal', RATE_HZ / 2)
    return {**cases, HALVED: _case(recipe, {}, RATE_HZ / 2, slower)}


def _channel_cases(dataset: SlideDataset) -> dict[str, _Case]:
    recipe = load_recipe('vibration-and-taxels')
    rate_hz = dataset[0].signals['signal'][0].sampling_rate_hz
    cases = {name: _case(recipe, changes, rate_hz, dataset) for name, changes in SLOW_VARIANTS.items()}
    for name, channels in KEPT_CHANNELS.items():
        kept = SlideDataset(tuple(with_slow_channels(slide, channels) for slide in dataset))
        cases[name] = _case(recipe, {}, rate_hz, kept)
    return cases


def _case(recipe: Recipe, changes: Changes, rate_hz: float, dataset: SlideDataset) -> _Case:
    return _Case(comparable(changed(recipe, changes), rate_hz, of_motion=False), dataset)


def _figures(cases: Mapping[str, _Case], options: BenchmarkOptions) -> dict[str, Any]:
    used = {name: case for name, case in cases.items() if name in QUICK or not options.quick}
    tried = {name: _try(case, options.quick) for name, case in used.items()}
    latencies = latencies_us({name: (item.case.recipe, item.model, item.case.dataset) for name, item in tried.items()})
    best = max(tried, key=lambda name: tried[name].held_out)
    good = [name for name, item in tried.items() if item.held_out >= tried[best].held_out - WITHIN]
    smallest = min(good, key=lambda name: latencies[name]['median'])
    return {
        'variants': {
            name: {
                'values': len(item.model.names),
                'held_out': item.held_out,
                'change_points': round(100 * (item.held_out - tried[SHIPPED].held_out), 2),
                'latency_us': latencies[name]['median'],
            }
            for name, item in tried.items()
        },
        'best': best,
        'smallest': smallest,
        'later': {name: tried[name].right_later() for name in dict.fromkeys((SHIPPED, best, smallest))},
    }


def _try(case: _Case, quick: bool) -> _AblationResult:
    last = QUICK_LAST_TRAINED if quick else LAST_TRAINED
    features = case.dataset.features(case.recipe.feature_set)
    first = [slide.name for slide in case.dataset if slide.number <= last]
    training_features = features.of_slides(first)
    later = features.take(~np.isin(features.groups, first))
    labels, codes = np.unique(training_features.labels, return_inverse=True)
    groups = np.unique(training_features.groups, return_inverse=True)[1]
    learner = replace(case.recipe.learner, folds=QUICK_FOLDS if quick else FOLDS)
    fitted = learner.fit(training_features.values, codes, groups)
    model = TextureModel(
        name=case.recipe.name,
        labels=tuple(labels.tolist()),
        names=training_features.names,
        feature_set=training_features.feature_set,
        recipe=case.recipe,
        parameters=fitted.parameters,
        tempering_exponent=DEFAULT_TEMPERING_EXPONENT,
        error_bound=ErrorBound(0, case.recipe.training.max_error_rate),  # no slide is held out: never certain
    )
    if fitted.held_out is None:
        raise InvalidData('slides for training are too short to hold any out; record longer ones')
    return _AblationResult(case, model, float(np.mean(fitted.held_out.argmax(axis=1) == codes)), later)

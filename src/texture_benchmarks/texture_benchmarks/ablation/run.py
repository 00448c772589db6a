"""Ablation of features, parameters, units and channels: accuracy and computing time without each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.recipes.run import (
    ALL_CHANNELS,
    DATA,
    LAST_TRAINED,
    QUICK_LAST_TRAINED,
    RATE_HZ,
    VIBRATION,
    biotac20_settings,
)
from texture_benchmarks.recipes.trial import all_at_rate, comparable, latency_us
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_core.errors import InvalidData
from texture_estimation.classification.training import DEFAULT_TEMPERING_EXPONENT
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_evaluation.charts import COLOURS, chart
from texture_evaluation.train import with_channels
from texture_features.labelled_features import LabelledFeatures
from texture_recordings.slide_dataset import SlideDataset
from texture_recordings.slides import LabelledSlide

Changes = Mapping[str, Mapping[str, Any] | None]  # feature or learner → parameters that differ; None leaves it out

SHIPPED = 'as shipped'
FOLDS, QUICK_FOLDS = 3, 2
WITHIN = 0.01  # of the best: what is no worse than that may ship
ROUNDS = 3  # of timing; the quickest counts, as other work on the machine only adds
# Of `default`, on the vibration alone.
VARIANTS: Mapping[str, Changes] = {
    SHIPPED: {},
    'without mean_log_bands': {'mean_log_bands': None},
    'without moments': {'moments': None},
    'without power_autocorrelation (`fast`)': {'power_autocorrelation': None},
    'mean_log_bands alone': {'moments': None, 'power_autocorrelation': None},
    'log_bands too': {'log_bands': {}},
    'log_bands for moments': {'moments': None, 'log_bands': {}},
    '16 bands': {'mean_log_bands': {'bands': 16}},
    '24 bands': {'mean_log_bands': {'bands': 24}},
    'segments overlap by 0.62': {'mean_log_bands': {'overlap': 0.625}},
    'segments overlap by 0.5': {'mean_log_bands': {'overlap': 0.5}},
    '10 lags': {'power_autocorrelation': {'lags': 10}},
    '8 lags': {'power_autocorrelation': {'lags': 8}},
    '32 units': {'mlp': {'hidden': 32}},
    '64 units': {'mlp': {'hidden': 64}},
    '256 units': {'mlp': {'hidden': 256}},
}
HALVED = 'sampled at 500 Hz'
# Of `vibration-and-taxels`: features left out, or channels of the slow input kept.
SLOW_VARIANTS: Mapping[str, Changes] = {
    SHIPPED: {},
    'without power_autocorrelation': {'power_autocorrelation': None},
    'segments overlap by 0.62': {'mean_log_bands': {'overlap': 0.625}},
    'without log_variance': {'log_variance': None},
    'without log_difference_variance': {'log_difference_variance': None},
    'without level': {'mean': None},
    'vibration alone': {'log_variance': None, 'log_difference_variance': None, 'mean': None},
    'slow channels alone': {'mean_log_bands': None, 'moments': None, 'power_autocorrelation': None},
}
KEPT_CHANNELS: Mapping[str, tuple[str, ...]] = {
    'of the slow ones the electrodes': tuple(f'electrode{number}' for number in range(1, 20)),
    'of the slow ones every third electrode': tuple(f'electrode{number}' for number in range(1, 20, 3)),
    'of the slow ones the pressure': ('pdc',),
    'of the slow ones the temperatures': ('tdc', 'tac'),
}
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
        charts=(_chart(numbers, options.out / 'ablation.png'),),
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
        kept = SlideDataset(tuple(_with_slow_channels(slide, channels) for slide in dataset))
        cases[name] = _case(recipe, {}, rate_hz, kept)
    return cases


def _case(recipe: Recipe, changes: Changes, rate_hz: float, dataset: SlideDataset) -> _Case:
    return _Case(comparable(changed(recipe, changes), rate_hz, of_motion=False), dataset)


def changed(recipe: Recipe, changes: Changes) -> Recipe:
    """Return a recipe with other parameters, without some features, or with more of them at its first input."""
    content = recipe.as_mapping()
    learner = recipe.learner_name
    inputs = {topic: _by_name(section) for topic, section in content['inputs'].items()}
    for name, parameters in changes.items():
        if name != learner:
            own = next((features for features in inputs.values() if name in features), next(iter(inputs.values())))
            own[name] = None if parameters is None else {**own.get(name, {}), **parameters}
    kept = {
        topic: [{name: own} for name, own in features.items() if own is not None] for topic, features in inputs.items()
    }
    return Recipe.from_mapping(
        {
            **content,
            'inputs': {topic: {**content['inputs'][topic], 'features': own} for topic, own in kept.items() if own},
            'learner': {learner: {**content['learner'][learner], **(changes.get(learner) or {})}},
        },
        recipe.name,
    )


def _by_name(section: Mapping[str, Any]) -> dict[str, Any]:
    return {name: parameters for feature in section['features'] for name, parameters in feature.items()}


def _with_slow_channels(item: LabelledSlide, channels: Sequence[str]) -> LabelledSlide:
    slow = item.signals['signal_static']
    columns = [slow[0].channels.index(name) for name in channels]
    chosen = [
        replace(
            batch,
            channels=tuple(channels),
            units=tuple(batch.units[column] for column in columns) if batch.units else (),
            samples=batch.samples[:, columns],
        )
        for batch in slow
    ]
    return replace(item, signals={**item.signals, 'signal_static': chosen})


def _figures(cases: Mapping[str, _Case], options: BenchmarkOptions) -> dict[str, Any]:
    used = {name: case for name, case in cases.items() if name in QUICK or not options.quick}
    tried = {name: _try(case, options.quick) for name, case in used.items()}
    times = [[_median_us(item) for item in tried.values()] for _ in range(ROUNDS)]
    latencies = dict(zip(tried, np.min(times, axis=0).tolist(), strict=True))
    best = max(tried, key=lambda name: tried[name].held_out)
    good = [name for name, item in tried.items() if item.held_out >= tried[best].held_out - WITHIN]
    smallest = min(good, key=lambda name: latencies[name])
    return {
        'variants': {
            name: {
                'values': len(item.model.names),
                'held_out': item.held_out,
                'change_points': round(100 * (item.held_out - tried[SHIPPED].held_out), 2),
                'latency_us': round(latencies[name], 1),
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
    )
    if fitted.held_out is None:
        raise InvalidData('slides for training are too short to hold any out; record longer ones')
    return _AblationResult(case, model, float(np.mean(fitted.held_out.argmax(axis=1) == codes)), later)


def _median_us(item: _AblationResult) -> float:
    return latency_us(item.case.recipe, item.model, item.case.dataset)['median']


def _chart(numbers: Mapping[str, Any], path: Path) -> Path:
    with chart(path, (11.0, 0.9 + 0.24 * sum(len(own['variants']) for own in numbers.values()))) as figure:
        figure.suptitle(
            'What recognition could do without (BioTac, 20 materials, slides held out of the first 30)',
            x=0.02, ha='left', fontweight='bold',
        )  # fmt: skip
        heights = [len(own['variants']) for own in numbers.values()]
        grid = figure.subplots(len(numbers), 2, sharey='row', squeeze=False, height_ratios=heights)
        for (term_effect, cost), (name, own) in zip(grid, numbers.items(), strict=True):
            variants = sorted(own['variants'].items(), key=lambda item: item[1]['held_out'])
            rows = np.arange(len(variants))
            colours = [COLOURS[5 if each in (own['smallest'], SHIPPED) else 0] for each, _ in variants]
            term_effect.barh(rows, [figures['change_points'] for _, figures in variants], color=colours)
            term_effect.set(yticks=rows, yticklabels=[each for each, _ in variants], title=name)
            term_effect.set_xlabel('single windows recognised, against as shipped (points)')
            cost.barh(rows, [figures['latency_us'] for _, figures in variants], color=colours)
            cost.set_xlabel('time from window to estimate (µs)')
            cost.set_title(f'smallest within {100 * WITHIN:g} point of the best: {own["smallest"]}')
    return path

"""What is left out or changed, and recipes with these changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from texture_estimation.recipe import Recipe
from texture_recordings.labelled_slide import LabelledSlide

Changes = Mapping[str, Mapping[str, Any] | None]  # feature or learner → parameters that differ; None leaves it out
SHIPPED = 'as released'
WITHIN = 0.01  # of the best: what is no worse than that may be released
# Of `default`, on the vibration alone.
VARIANTS: Mapping[str, Changes] = {
    SHIPPED: {},
    'without mean_log_bands': {'mean_log_bands': None},
    'without moments': {'moments': None},
    'without power_autocorrelation (`fast`)': {'power_autocorrelation': None},
    'mean_log_bands alone': {'moments': None, 'power_autocorrelation': None},
    'with log_bands': {'log_bands': {}},
    'log_bands instead of moments': {'moments': None, 'log_bands': {}},
    '16 bands': {'mean_log_bands': {'bands': 16}},
    'segments overlap by 0.62': {'mean_log_bands': {'overlap': 0.625}},
    'segments overlap by 0.5': {'mean_log_bands': {'overlap': 0.5}},
    '8 lags': {'power_autocorrelation': {'lags': 8}},
    '64 units': {'mlp': {'hidden': 64}},
    '128 units': {'mlp': {'hidden': 128}},
    '512 units': {'mlp': {'hidden': 512}},
}
HALVED = 'sampled at 500 Hz'
# Of `vibration-and-taxels`: features left out, or channels of the slow input kept.
SLOW_VARIANTS: Mapping[str, Changes] = {
    SHIPPED: {},
    'without power_autocorrelation': {'power_autocorrelation': None},
    'without log_variance': {'log_variance': None},
    'without log_difference_variance': {'log_difference_variance': None},
    'vibration alone': {'log_variance': None, 'log_difference_variance': None},
    'slow channels alone': {'mean_log_bands': None, 'moments': None, 'power_autocorrelation': None},
}
KEPT_CHANNELS: Mapping[str, tuple[str, ...]] = {
    'slow channels: electrodes only': tuple(f'electrode{number}' for number in range(1, 20)),
    'slow channels: every third electrode': tuple(f'electrode{number}' for number in range(1, 20, 3)),
    'slow channels: pressure only': ('pdc',),
    'slow channels: temperatures only': ('tdc', 'tac'),
}


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


def with_slow_channels(item: LabelledSlide, channels: Sequence[str]) -> LabelledSlide:
    """Return a slide with these of its slow channels alone."""
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

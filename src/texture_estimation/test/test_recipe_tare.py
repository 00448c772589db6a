"""Shipped recipes whose features change with the level of a signal state the tare that they expect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from texture_core.config import shipped
from texture_core.types import Array
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness import load_roughness_recipe
from texture_features.feature import WindowBatch
from texture_features.feature_set import InputFeatures

LOADERS = {'recipes': load_recipe, 'roughness': load_roughness_recipe}
RECIPES = {
    name: load(name).feature_set.inputs
    for kind, load in LOADERS.items()
    for name in sorted(shipped('texture_estimation', f'config/{kind}'))
}
RATE_HZ, SAMPLES = 1000.0, 1000
CHANNELS = ('a', 'b', 'c', 'd')
LEVELS = np.array([1.0, 2.0, 3.0, 4.0])  # multiples that differ from channel to channel, as levels of taxels do


def features_at(item: InputFeatures, level: float) -> list[Array]:
    """Return what each feature of an input gives for the same noise on another level."""
    rng = np.random.default_rng(0)
    windows = [
        WindowBatch(
            rng.normal(size=(SAMPLES, len(CHANNELS))) + level * LEVELS,
            RATE_HZ,
            np.array(0.05),
            np.array(1.0),
            channels=CHANNELS,
            tangential_force_n=np.array(0.3),
        )
        for _ in item.window_names
    ]
    window = windows[0] if len(windows) == 1 else replace(windows[0], joined=tuple(windows[1:]))
    return [np.asarray(feature(window)) for _, feature in item.features]


def sees_level(item: InputFeatures) -> bool:
    """Return whether a feature of an input changes when every channel moves to another level."""
    pairs = zip(features_at(item, 0.5), features_at(item, 50.0), strict=True)
    return not all(np.allclose(low, high, rtol=1e-6, atol=1e-6) for low, high in pairs)


@pytest.mark.parametrize('name', RECIPES)
def test_an_input_states_a_tare_exactly_if_its_features_see_the_level(name: str) -> None:
    assert [bool(item.tare) for item in RECIPES[name]] == [sees_level(item) for item in RECIPES[name]]


def test_features_that_see_the_level_are_found() -> None:
    seen = {name for name, inputs in RECIPES.items() if any(map(sees_level, inputs))}
    assert seen == {'any-speed', 'jamali-amplitude', 'taxels', 'taxels-any-day', 'taxels-changes', 'taxels-signal'}

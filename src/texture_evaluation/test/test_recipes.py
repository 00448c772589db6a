"""Every shipped recipe, from bags to decisions."""

from dataclasses import replace
from pathlib import Path

import pytest

from texture_core.resources import folder
from texture_estimation.classification.training import train
from texture_estimation.recipe import load_recipe
from texture_evaluation.evaluate import evaluate
from texture_recordings.slide_dataset import SlideDataset

SHIPPED = sorted(path.stem for path in folder('texture_estimation', 'config/recipes').glob('*.yaml'))
OF_ONE_FINGER = [name for name in SHIPPED if '/' not in ''.join(load_recipe(name).feature_set.topics)]


@pytest.mark.parametrize('name', OF_ONE_FINGER)
def test_each_recipe_learns_distinct_simulated_surfaces_and_recognises_them(name: str, simulated: Path) -> None:
    recipe = load_recipe(name)
    # The slides are shorter than the windows of some papers.
    windows = replace(recipe.feature_set.windows, length_s=min(0.5, recipe.feature_set.windows.length_s))
    recipe = replace(recipe, feature_set=replace(recipe.feature_set, windows=windows))
    examples = SlideDataset.from_bags([simulated], '1-4').features(
        replace(recipe.feature_set, windows=recipe.training_windows)
    )
    figures = evaluate(train(recipe, examples), [simulated], '5-6').as_json()
    assert figures['window_accuracy'] > 0.6
    assert figures['accuracy_at_s']['1.0'] > 0.6

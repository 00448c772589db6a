# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every shipped recipe, from bags to decisions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from texture_core.config import shipped
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.training import train
from texture_evaluation.evaluate import evaluate, evaluate_dataset
from texture_evaluation.metrics import window_accuracy
from texture_evaluation.train import train_from_bags, training_examples
from texture_recordings.dataset import SlideDataset
from texture_simulation.offline import SlidePlan, write_simulated

SHIPPED = sorted(shipped('texture_estimation', 'config/recipes'))
# Which taxels change together: so it is with this.
OF_CHANGES = ('taxels-any-day',)
# The friction of these surfaces is not simulated.
OF_FRICTION = ('friction-svm',)
# Variables, box and kernel were searched for each pair of the four ridges; they hold for no other surfaces.
OF_RIDGES = ('ets-linear-svm-pairs',)
# The simulated slides are of one finger and along one axis.
OF_ONE_FINGER = [
    name
    for name in SHIPPED
    if not {'/', '@'} & set(''.join(load_recipe(name).feature_set.window_names))
    and name not in (*OF_CHANGES, *OF_FRICTION, *OF_RIDGES)
]


@pytest.mark.parametrize('name', OF_ONE_FINGER)
def test_each_recipe_learns_distinct_simulated_surfaces_and_recognises_them(name: str, simulated: Path) -> None:
    recipe = load_recipe(name)
    # The slides are shorter than the windows of some papers.
    length_s = min(0.5, recipe.feature_set.windows.length_s)
    windows = replace(recipe.feature_set.windows, length_s=length_s, hop_s=min(0.1, length_s), skip_s=0.0)
    training = replace(recipe.training, hop_s=min(0.25, recipe.training.hop_s))
    recipe = replace(recipe, feature_set=replace(recipe.feature_set, windows=windows), training=training)
    examples = SlideDataset.from_bags([simulated], '1-4').features(
        replace(recipe.feature_set, windows=recipe.training_windows)
    )
    figures = evaluate(train(recipe, examples), [simulated], '5-6').as_json()
    assert figures['window_accuracy'] > 0.6
    assert figures['accuracy_at_s']['1.0'] > 0.6


@pytest.mark.parametrize('name', OF_FRICTION)
def test_a_recipe_of_friction_learns_from_bags_of_sheets_that_differ_in_it(name: str, tmp_path: Path) -> None:
    plan, sheets = SlidePlan(slides=6, slide_s=1.2), ('dusty_plastic', 'oiled_plastic')
    bags = write_simulated(tmp_path / 'bags', plan, np.random.default_rng(5), 'sticky', sheets)
    examples = training_examples(load_recipe(name), SlideDataset.from_bags(bags))
    friction = examples.X[:, examples.names.index('signal/friction')]
    # kinetic + (static - kinetic) exp(-(v / stribeck)²) + viscous v at 0.1 m/s, by the numbers of the scene
    expected = {'dusty_plastic': 0.3 + 0.05 * np.exp(-4.0), 'oiled_plastic': 0.05 + 0.05 * np.exp(-25.0) + 0.02}
    for sheet, coefficient in expected.items():
        of_sheet = friction[np.array(examples.y) == sheet]
        # Speed and force of the finger deviate from the state by 2 and 5 %.
        assert np.median(of_sheet) == pytest.approx(coefficient, rel=0.1)
    model = train_from_bags(name, bags, '1-4', out=tmp_path / 'model')
    assert evaluate(model, bags, '5-6').as_json()['window_accuracy'] > 0.8


def slides_of_days(days: tuple[int, ...]) -> SlideDataset:
    """Return ten slides of each of two surfaces a day: neighbours change together, or those two taxels away."""
    slides = []
    for day in days:
        rng = np.random.default_rng(day)
        levels = rng.uniform(200.0, 600.0, 6)  # of the day, as the finger was mounted and tared
        labels = [surface for surface in ('cork', 'felt') for _ in range(10)]
        samples = []
        for surface in labels:
            steps = rng.normal(size=(400, 6))
            together = steps + np.roll(steps, 1 if surface == 'cork' else 2, axis=1)
            samples.append(levels * rng.uniform(0.8, 1.2) + 10.0 * together)
        made = SlideDataset.from_arrays(
            {'signal_static': samples}, labels, {'signal_static': 50.0}, sensor='skin', session=f'day {day}'
        )
        for slide in made:
            (batch,) = slide.signals['signal_static']
            tared = {'signal_static': (replace(batch, tared=True),)}
            slides.append(replace(slide, number=slide.number + 10 * day, signals=tared))
    return SlideDataset(tuple(slides))


@pytest.mark.parametrize('name', OF_CHANGES)
def test_what_changes_together_is_recognised_on_a_day_with_other_levels(name: str) -> None:
    recipe, trained, tested = load_recipe(name), slides_of_days((0, 1, 2)), slides_of_days((3,))
    model = train(recipe, training_examples(recipe, trained))
    assert model.acceptance.domain.places == 3
    assert 'sessions held out in turn' in model.training['calibration']
    finals = [result.estimates[-1] for result in evaluate_dataset(model, tested).known]
    right = [final.label == slide.surface for final, slide in zip(finals, tested, strict=True)]
    assert all(right)
    assert np.mean([final.accepted for final in finals]) > 0.7
    # On the levels, which the day gives, the same slides are guessed.
    features = {'signal_static': {'features': ['mean']}}
    levels = Recipe.from_mapping({'inputs': features, 'learner': 'discriminant'}, 'levels')
    guessed = evaluate_dataset(train(levels, training_examples(levels, trained)), tested)
    assert window_accuracy(guessed.known) < 0.8

# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from texture_estimation.roughness import Grades, load_roughness_recipe
from texture_estimation.search import (
    ArrayStream,
    RecipeSpace,
    RoughnessTask,
    SearchParams,
    SearchSlides,
    SlideArrays,
    optimise,
)

GRADES = Grades({f'surface_{number}': float(number) for number in range(1, 6)})


def hisses(count: int = 8) -> SlideArrays:
    """Return scans of 0.5 s at 1 kHz whose level rises with the grade."""
    rng = np.random.default_rng(0)
    levels = np.repeat(1.5 ** np.arange(5), count)
    samples = levels[:, None] * rng.normal(size=(len(levels), 500))
    names = np.repeat(list(GRADES.grades), count)
    return SlideArrays(
        {'signal': ArrayStream(samples[..., None], 1000.0)}, names, np.full(len(names), 0.15), np.ones(len(names))
    )


@pytest.mark.parametrize('regressor', ['ann1', 'ann5', 'svm5'])
def test_the_recipes_of_the_roughness_paper_are_tuned_and_evaluated_by_their_heads(regressor) -> None:
    space = RecipeSpace.load(f'ets-roughness-{regressor}', load_roughness_recipe(f'ets-roughness-{regressor}'))
    params = SearchParams(population=5, generations=2, halves=3, finalists=1)
    found = optimise(space, SearchSlides(hisses(), params.halves), params, RoughnessTask(GRADES))
    assert found.history[-1].best.fitness >= found.history[0].best.fitness
    assert len(found.best.scores) == 3
    assert found.best.fitness > 0.7
    # what only the checks need is held out, and yet stays in the recipe
    extracted = RoughnessTask(GRADES).features(found.best.recipe)
    assert 'peak_to_median_power' not in [name for name, _ in extracted.inputs[0].features]
    assert 'peak_to_median_power' in [name for name, _ in found.best.recipe.feature_set.inputs[0].features]


def test_neurons_and_machines_have_the_ranges_of_the_paper() -> None:
    axes = RecipeSpace.load('ets-roughness-ann5', load_roughness_recipe('ets-roughness-ann5')).axes
    assert axes['hidden'].values == tuple(range(5, 51))
    assert axes['peaks'].values == tuple(range(2, 16))
    axes = RecipeSpace.load('ets-roughness-svm5', load_roughness_recipe('ets-roughness-svm5')).axes
    assert (axes['kernel_scale'].values[0], axes['kernel_scale'].values[-1]) == (1e-5, 1e5)

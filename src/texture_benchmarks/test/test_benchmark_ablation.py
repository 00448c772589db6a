import os
from pathlib import Path

import pytest

from texture_benchmarks.ablation.variants import SHIPPED, SLOW_VARIANTS, VARIANTS, changed
from texture_benchmarks.catalogue import BENCHMARKS
from texture_benchmarks.result import BenchmarkOptions
from texture_estimation.recipe import load_recipe

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')


def features(recipe):
    return {item.topic: dict(item.features) for item in recipe.feature_set.inputs}


def test_a_feature_is_left_out_another_added_and_parameters_changed_where_it_is_said() -> None:
    recipe = load_recipe('default')
    smaller = changed(
        recipe, {'moments': None, 'power_autocorrelation': {'lags': 8}, 'log_bands': {}, 'mlp': {'hidden': 32}}
    )
    assert list(features(smaller)['signal']) == ['mean_log_bands', 'power_autocorrelation', 'log_bands']
    assert features(smaller)['signal']['power_autocorrelation'].lags == 8
    assert features(smaller)['signal']['mean_log_bands'] == features(recipe)['signal']['mean_log_bands']
    assert (recipe.learner.hidden, smaller.learner.hidden) == (256, 32)
    assert changed(recipe, {}) == recipe


def test_an_input_without_features_is_not_asked_for() -> None:
    recipe = load_recipe('vibration-and-taxels')
    assert changed(recipe, SLOW_VARIANTS['vibration alone']).feature_set.topics == ('signal',)
    assert changed(recipe, SLOW_VARIANTS['slow channels alone']).feature_set.topics == ('signal_static',)
    assert features(changed(load_recipe('default'), VARIANTS['without power_autocorrelation (`fast`)'])) == features(
        load_recipe('fast')
    )


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_what_is_smallest_is_hardly_worse_than_the_best(tmp_path: Path) -> None:
    result = BENCHMARKS['ablation'](BenchmarkOptions(tmp_path, DATA, quick=True))
    assert all(chart.is_file() for chart in result.charts)
    for own in result.numbers.values():
        right = {name: figures['held_out'] for name, figures in own['variants'].items()}
        assert right[own['best']] - right[own['smallest']] <= 0.01
        assert SHIPPED in own['later']

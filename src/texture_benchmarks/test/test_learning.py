import os
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.learning import run_incremental
from texture_benchmarks.study import BenchmarkOptions
from texture_core.errors import InvalidData
from texture_estimation.recipe import load_recipe
from texture_features.examples import LabelledFeatures

pytestmark = pytest.mark.ros

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')


def clouds(labels=('cork', 'felt', 'wood'), slides=6, windows=6):
    rng = np.random.default_rng(0)
    centres = 3.0 * rng.normal(size=(len(labels), 5))
    names = [(label, f'{label}/{slide + 1}') for label in labels for slide in range(slides) for _ in range(windows)]
    values = np.repeat(centres, slides * windows, axis=0) + rng.normal(size=(len(names), 5))
    return LabelledFeatures(
        values,
        np.array([label for label, _ in names]),
        np.array([group for _, group in names]),
        tuple('abcde'),
        'kind',
        0.5,
        0.25,
    )


def test_a_course_of_examples_ends_as_good_as_training_again(tmp_path: Path) -> None:
    incremental_run = run_incremental(
        load_recipe('default'), clouds(), ['wood'], last_training=4, stages=(1, 4), path=tmp_path / 'm'
    )
    assert incremental_run.incremental[4].windows > incremental_run.retrained[4].windows - 0.15
    assert incremental_run.old[4].windows > incremental_run.before.windows - 0.15
    assert incremental_run.new[1].slides > 0.4
    assert len(incremental_run.add_s) == 4
    assert sorted(path.name for path in (tmp_path / 'm.added').iterdir())[-1] == '00004.json'


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_recorded_materials_are_added_slide_by_slide(tmp_path: Path) -> None:
    result, _ = run_benchmark('learning', BenchmarkOptions(tmp_path, DATA, quick=True))
    after_two = result.numbers['slides']['2']
    assert after_two['incremental']['slides'] > 0.7
    assert after_two['incremental']['windows'] > after_two['retrained']['windows'] - 0.1
    assert all(chart.is_file() for chart in result.charts)


def test_without_recordings_there_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(InvalidData, match='no recorded data'):
        run_benchmark('learning', BenchmarkOptions(tmp_path))

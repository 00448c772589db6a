import os
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.next_motion import CHOICES, MOTIONS, Trials, explored, extracted, training
from texture_benchmarks.study import BenchmarkOptions
from texture_estimation.recipe import load_recipe
from texture_simulation.scene import load_scene

pytestmark = pytest.mark.ros

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')


@pytest.mark.benchmark
def test_every_way_to_choose_is_evaluated_after_every_slide(tmp_path: Path) -> None:
    result, written = run_benchmark('next_motion', BenchmarkOptions(tmp_path, quick=True))
    accuracy = result.numbers['accuracy']
    assert written.is_file()
    assert all(drawn.is_file() for drawn in result.charts)
    assert set(accuracy) == set(CHOICES)
    assert all(len(shares) == 8 and 0.0 <= min(shares) <= max(shares) <= 1.0 for shares in accuracy.values())
    assert accuracy['informed'][-1] >= 0.6


def test_trials_are_recognised_once_a_motion_reports_the_textures_apart() -> None:
    scene, features, motions = load_scene('oriented'), load_recipe('fast').feature_set, MOTIONS[:1]
    values = np.zeros((1, len(scene.surfaces), 4, 2))
    values[..., 0] = 100.0 * np.arange(len(scene.surfaces))[:, None]
    values += np.random.default_rng(0).standard_normal(values.shape)
    known = training(scene, motions, values)
    for way in CHOICES.values():
        choose = way(known, motions, np.random.default_rng(0))
        trials = explored(list(scene.surfaces), known, motions, values, choose=choose, n_slides=2)
        assert trials.right.shape == trials.probability.shape == (2 * len(scene.surfaces), 2)
        assert trials.right.all()
    one = extracted(scene, motions, 1, features, np.random.default_rng(0))
    assert one.shape[:3] == (1, len(scene.surfaces), 1)
    assert one == pytest.approx(extracted(scene, motions, 1, features, np.random.default_rng(0)))


def test_a_trial_ends_once_it_is_sure_or_out_of_slides() -> None:
    trials = Trials(
        np.array([[False, True], [True, True], [True, False]]), np.array([[0.5, 0.9], [0.9, 1.0], [0.4, 0.6]])
    )
    assert trials.until(0.9) == (pytest.approx(5 / 3), pytest.approx(2 / 3))


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_touches_of_recorded_slides_are_chosen_in_every_way(tmp_path: Path) -> None:
    result, _ = run_benchmark('next_motion_recorded', BenchmarkOptions(out=tmp_path, quick=True, data=DATA))
    [found] = result.numbers.values()
    assert set(found['accuracy']) == {'informed', 'fixed order, planned', 'random'}
    assert all(0.25 < shares[-1] <= 1.0 for shares in found['accuracy'].values())  # chance is a quarter

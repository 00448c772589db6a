# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Accuracy over sliding and computing time: which methods, how evidence and votes are counted, what is drawn."""

from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks import overview, peers
from texture_benchmarks.catalogue import BENCHMARKS
from texture_benchmarks.overview import ALL_CHANNELS, JOBS, VIBRATION, jobs_of, spread
from texture_benchmarks.peers import CLASSIFIERS, recipe_of, right_over_time
from texture_benchmarks.study import SPACING_S, BenchmarkOptions, with_spaced_windows
from texture_core.types import ExplorationState, Phase, TactileSignal
from texture_estimation.recipe import FAST_TOPIC, load_recipe
from texture_recordings.slides import LabelledSlide

pytestmark = pytest.mark.ros


@pytest.mark.parametrize('job', [job for job in JOBS if job.name not in CLASSIFIERS])
def test_recipes_are_compared_with_the_channels_that_they_read(job) -> None:
    topics = set(recipe_of(job.name).feature_set.topics)
    assert (topics == {FAST_TOPIC}) is (job.channels == VIBRATION)


def test_only_the_distance_of_training_windows_differs_from_the_released_recipe() -> None:
    released = load_recipe('ets-fine-svm')
    compared = with_spaced_windows(released)
    assert compared.training.hop_s == SPACING_S
    assert compared.feature_set == released.feature_set
    assert compared.learner == released.learner
    assert with_spaced_windows(load_recipe('jamali-naive-bayes-5')).training.hop_s == 2.0


def test_peers_are_left_out_where_their_packages_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    for there, names in ((False, set()), (True, set(CLASSIFIERS))):
        monkeypatch.setattr(peers, 'available', lambda *names, there=there: there)
        assert {job.name for job in jobs_of(quick=False)} & set(CLASSIFIERS) == names


def test_windows_that_vote_decide_by_the_sum_and_a_tie_goes_to_the_first() -> None:
    votes = np.array([[0.0, 1.0], [1.0, 0.0], [1.0, 0.0]])
    assert right_over_time(votes, 1) == [True, True, False]
    assert right_over_time(votes, 0) == [False, False, True]


def test_a_slow_channel_keeps_its_value_until_the_next_one_comes() -> None:
    fast = np.arange(1000, dtype=np.float32)[:, None]
    slow = np.arange(50, dtype=np.float32)[:, None]
    signals = {
        'signal': [TactileSignal(0, 'f', ('f',), (), 1000.0, 0, fast)],
        'signal_static': [TactileSignal(0, 's', ('s',), (), 50.0, 0, slow)],
    }
    state = ExplorationState(0, 'e', 'linear_slide', Phase.SLIDE, steady_s=1.0, surface='cork')
    slide = LabelledSlide(Path('bag'), 'cork/1', 'cork', 1, 1, None, signals=signals, states=[state])
    windows = overview.windows_of(slide, ('signal', 'signal_static'))
    assert windows.shape == (2, 2, 500)
    np.testing.assert_array_equal(windows[1, 0], np.arange(500, 1000))
    np.testing.assert_array_equal(windows[1, 1], np.repeat(np.arange(25, 50), 20))


def test_names_at_lines_keep_a_spacing_and_their_order() -> None:
    assert spread([0.0, 0.05, 1.0], 0.2) == pytest.approx([0.0, 0.2, 1.0])
    assert spread([1.0, 0.95], 0.2) == pytest.approx([1.15, 0.95])


@pytest.mark.benchmark
def test_later_slides_are_recognised_and_every_figure_is_there(tmp_path: Path, data: Path) -> None:
    result = BENCHMARKS['overview'](BenchmarkOptions(tmp_path, data, quick=True))
    assert all(chart.is_file() for chart in result.charts)
    cells = [result.numbers[VIBRATION]['default'], result.numbers[ALL_CHANNELS]['vibration-and-taxels']]
    for cell in cells:
        assert cell['accuracy_at_end'] > 0.8
        assert cell['s'][0] == 0.5
        assert len(cell['s']) == len(cell['share']) == len(cell['interval'])
        low, high = cell['interval_at_s']['3.0']
        assert low <= cell['accuracy_at_s']['3.0'] <= high
        assert 0 < cell['latency_us']['median'] <= cell['latency_us']['p99']
    assert result.numbers[VIBRATION]['jamali-naive-bayes-5']['ends_when_decided'] is None

import os
from pathlib import Path

import pytest

from texture_benchmarks.catalogue import BENCHMARKS
from texture_benchmarks.frontier import TrainingSize, costs
from texture_benchmarks.recipes import comparable
from texture_benchmarks.study import BenchmarkOptions
from texture_estimation.recipe import load_recipe

pytestmark = pytest.mark.ros

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')


@pytest.mark.parametrize(('length_s', 'hop_s'), [(0.05, 0.05), (0.5, 0.5), (2.0, 0.5)])
def test_windows_of_any_length_leave_no_gap_and_long_ones_overlap(length_s: float, hop_s: float) -> None:
    windows = comparable(load_recipe('default'), 1000.0, of_motion=False, length_s=length_s).feature_set.windows
    assert (windows.length_s, windows.hop_s) == (length_s, hop_s)


def test_a_training_takes_time_and_little_memory_where_only_means_are_kept() -> None:
    [found] = costs('texture_papers.jamali:NaiveBayes', [TrainingSize(200, 4)], limit_s=60.0, seed=0).values()
    assert 0 < found.seconds < 60
    assert 0 <= found.mebibytes < 100


def test_what_takes_too_long_is_not_tried_in_a_larger_size() -> None:
    sizes = [TrainingSize(windows, 4) for windows in (40, 80, 160)]
    assert list(costs('texture_papers.jamali:NaiveBayes', sizes, limit_s=0.0, seed=0)) == sizes[:1]
    assert list(costs('texture_papers.jamali:NaiveBayes', sizes, limit_s=60.0, seed=0)) == sizes


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_longer_windows_are_recognised_more_often(tmp_path: Path) -> None:
    result = BENCHMARKS['frontier'](BenchmarkOptions(tmp_path, DATA, quick=True))
    assert all(chart.is_file() for chart in result.charts)
    short, long = (result.numbers['by_window_length']['fast'][length] for length in ('0.1 s', '0.5 s'))
    assert short['window_accuracy'] < long['window_accuracy']
    assert result.numbers['trainings']['labels']['mlp'][0]['seconds'] > 0

from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.result import BenchmarkOptions
from texture_benchmarks.segmentation.trial import try_slide
from texture_simulation.scene import load_scene


def test_the_benchmark_finds_strong_slides_and_says_how_well(tmp_path: Path) -> None:
    result, _ = run_benchmark('segmentation', BenchmarkOptions(tmp_path, quick=True))
    strong = result.numbers['strong']
    assert strong['found'] > 0.9
    assert strong['start_ms']['median'] < result.numbers['target_ms']
    assert strong['end_ms']['95 %'] < result.numbers['target_ms']
    assert all(chart.is_file() for chart in result.charts)


@pytest.mark.parametrize('scene', ['ets_linear', 'jamali', 'kaboli', 'hu'])
def test_each_kind_of_sensor_reports_start_and_end(scene: str) -> None:
    table = load_scene(scene)
    surface = next(iter(table.surfaces)) if scene != 'kaboli' else 'rough_ball'
    trials = [try_slide(table, surface, 0.15, 1.0, np.random.default_rng(seed)) for seed in range(3)]
    assert np.median([abs(trial.start_error_s) for trial in trials]) < 0.04
    assert np.median([abs(trial.end_error_s) for trial in trials]) < 0.02

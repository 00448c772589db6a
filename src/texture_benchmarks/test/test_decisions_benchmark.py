import os
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.result import BenchmarkOptions

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_decisions_on_a_few_recorded_slides_are_reported_in_figures_and_charts(tmp_path: Path) -> None:
    result, path = run_benchmark('decisions', BenchmarkOptions(out=tmp_path, quick=True, data=DATA))
    assert path.is_file()
    assert {chart.name for chart in result.charts} == {
        'decisions_early.png', 'decisions_calibration.png', 'decisions_unknown.png',
    }  # fmt: skip
    for recipe in ('default', 'vibration-and-taxels'):
        numbers = result.numbers[recipe]
        assert 0.5 <= numbers['early']['mean_s'] <= 6.0
        assert numbers['accuracy_at_s']['5.0'] > 0.5  # chance is a quarter
        assert 0.0 <= numbers['calibration_error'] <= 0.5
        assert np.shape(numbers['unknown']['accepted_per_draw']) == (2,)

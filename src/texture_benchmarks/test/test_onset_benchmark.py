import os
from pathlib import Path

import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.result import BenchmarkOptions

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_the_first_window_of_a_few_recorded_slides_is_mostly_recognised(tmp_path: Path) -> None:
    result, path = run_benchmark('onset', BenchmarkOptions(out=tmp_path, quick=True, data=DATA))
    assert path.is_file()
    assert [chart.name for chart in result.charts] == ['onset.png']
    assert result.numbers['onset']['accuracy_at_s']['0.5'] > 0.5  # chance is a third

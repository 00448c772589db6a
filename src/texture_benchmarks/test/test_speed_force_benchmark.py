import os
from pathlib import Path

import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.result import BenchmarkOptions
from texture_core.errors import InvalidData

DATA = Path(os.environ.get('TEXTURE_DATA') or Path(__file__).resolve().parents[4] / 'shared' / 'data')


def test_data_that_is_missing_is_refused_with_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(InvalidData, match='no recorded data'):
        run_benchmark('speed_force', BenchmarkOptions(tmp_path, tmp_path))


@pytest.mark.benchmark
@pytest.mark.skipif(not DATA.is_dir(), reason=f'no recorded data in {DATA}; set TEXTURE_DATA to its folder')
def test_few_surfaces_are_recognised_at_speeds_and_forces_that_were_not_trained(tmp_path: Path) -> None:
    result, path = run_benchmark('speed_force', BenchmarkOptions(tmp_path, DATA, quick=True))
    textures, fabrics = result.numbers['ntp21'], result.numbers['fabricslide']
    known, measured = (
        textures['whole']['taxel average, waves per metre'],
        textures['whole']['the same, speed measured by the array'],
    )
    assert min(outcome['accuracy'] for outcome in known.values()) > 0.95
    assert min(outcome['accuracy'] for outcome in measured.values()) > 0.9
    assert textures['windows']['same distance']['accuracy'] > 0.85
    assert textures['windows']['all distances, speed measured']['accuracy'] > 0.7
    assert fabrics['shares of the load, turn taken out']['one speed out']['accuracy'] > 0.9
    assert path.is_file()
    assert all(chart.is_file() for chart in result.charts)

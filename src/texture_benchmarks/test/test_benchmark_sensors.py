import json
from pathlib import Path

import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.result import BenchmarkOptions

pytestmark = [pytest.mark.benchmark, pytest.mark.realtime]


def test_where_there_is_a_checksum_nothing_false_is_believed(tmp_path: Path) -> None:
    result, path = run_benchmark('sensors', BenchmarkOptions(tmp_path, quick=True))
    numbers = json.loads(path.read_text())['numbers']
    assert result.charts[0].is_file()
    for kinds in numbers.values():
        rows = [row for kind in ('drop', 'insert', 'flip') for row in kinds[kind].values()]
        assert all(0 < row['recovered'] <= 1 for row in rows)
        assert not kinds['checksum'] or not any(row['bogus'] for row in rows)
    assert any(row['bogus'] for row in numbers['tsf85']['flip'].values())


@pytest.mark.ros
def test_the_load_of_sensor_nodes_is_measured(tmp_path: Path) -> None:
    result, _ = run_benchmark('load', BenchmarkOptions(tmp_path, quick=True))
    daq = result.numbers['alone']['daq']
    assert daq['rate_hz'] == pytest.approx(2500, rel=0.1)
    assert daq['messages'] > 50
    assert 0 < daq['cpu_percent'] < 100
    assert set(result.numbers['together']) == {'tsf85', 'biotac', 'daq', 'pvdf', 'cpu_percent'}
    assert result.charts[0].is_file()
    replugged, flooded = (result.numbers[name]['anyskin'] for name in ('replugged', 'ten_times_too_fast'))
    assert replugged['times'] == 1
    assert 0 < replugged['back_s'][1] < 10.0
    assert replugged['out_of_order'] == flooded['out_of_order'] == 0
    assert replugged['index_error_s'] < 0.05
    assert flooded['samples_per_s'] > 1.05 * 250.0  # its nominal rate: the flood is seen

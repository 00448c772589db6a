# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import pytest

from texture_benchmarks.catalogue import BENCHMARKS, run_benchmark
from texture_benchmarks.study import BenchmarkOptions
from texture_core.errors import InvalidData, UnknownName

pytestmark = pytest.mark.realtime


def test_an_unknown_benchmark_and_missing_data_are_refused_with_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match="did you mean 'latency'"):
        run_benchmark('latancy', BenchmarkOptions(tmp_path))
    for data, missing in ((None, 'no folder of recorded data was given'), (tmp_path, "there is no 'biotac20' in")):
        with pytest.raises(InvalidData, match=missing):
            BENCHMARKS['generalisation'](BenchmarkOptions(tmp_path, data))


@pytest.mark.benchmark
@pytest.mark.ros
def test_every_window_is_answered_through_the_graph(tmp_path: Path) -> None:
    result, path = run_benchmark('latency', BenchmarkOptions(tmp_path, quick=True))
    assert path.is_file()
    assert all(chart.is_file() for chart in result.charts)
    for recipe in ('default', 'vibration-and-taxels'):
        dds = result.numbers[recipe]['dds']
        assert dds['estimates'] == dds['expected']
        assert 0 < dds['median_ms'] <= dds['p99_ms'] <= dds['longest_ms']
        assert result.numbers[recipe]['cpu_percent']['all'] > 0

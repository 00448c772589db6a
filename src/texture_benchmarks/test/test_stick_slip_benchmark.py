from pathlib import Path

import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.result import BenchmarkOptions


@pytest.mark.benchmark
def test_the_default_is_stable_with_margin_and_limits_lie_where_predicted(tmp_path: Path) -> None:
    result, written = run_benchmark('stick_slip', BenchmarkOptions(tmp_path, quick=True))
    numbers = result.numbers
    assert written.is_file()
    assert all(drawn.is_file() for drawn in result.charts)
    assert numbers['default']['step_us'] <= numbers['default']['provably_passive_up_to_us']
    assert numbers['default']['step_us'] <= numbers['default']['allowed_us']
    assert numbers['border_us']['largest_difference'] < 0.02
    assert numbers['scan_ms']['TSF-85, 2000 points/s'] < 10 * numbers['target_ms']  # a busy machine

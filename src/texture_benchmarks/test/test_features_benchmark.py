from pathlib import Path

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.result import BenchmarkOptions
from texture_features.catalogue import FEATURES


def test_every_feature_is_timed_alone_and_in_a_batch(tmp_path: Path) -> None:
    result, _ = run_benchmark('features', BenchmarkOptions(tmp_path, quick=True))
    assert set(result.numbers) == set(FEATURES)
    assert all(cost['batch_us'] > 0 and cost['alone_us'] > 0 for cost in result.numbers.values())
    assert all(chart.is_file() for chart in result.charts)

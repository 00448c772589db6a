from pathlib import Path

import pytest

from texture_benchmarks.catalogue import BENCHMARKS, run_benchmark
from texture_benchmarks.optimise.cases import CASES, DATA, LINEAR
from texture_benchmarks.result import BenchmarkOptions


def test_searches_have_the_size_of_the_papers() -> None:
    scans = {name: len(data.speeds_m_s) * len(data.forces_n) * data.count for name, data in DATA.items()}
    assert scans == {'linear': 450, 'fine': 200, 'roughness': 200}  # of each texture
    sizes = {(case.params.population, case.params.generations, case.params.halves) for case in CASES.values()}
    assert sizes == {(20, 30, 20)}


@pytest.mark.benchmark
def test_every_search_ends_with_a_recipe_evaluated_by_its_learner_and_the_charts_are_drawn(tmp_path: Path) -> None:
    result = BENCHMARKS['optimise_large'](BenchmarkOptions(tmp_path, quick=True))
    assert set(result.numbers['searches']) == set(CASES)
    for figures in result.numbers['searches'].values():
        assert figures['evaluations'] == 10
        assert 0.0 < figures['fitness_exact'] <= 1.0
        assert figures['halves_evaluated'] <= figures['halves_of_all']
    whole = result.numbers['searches']['linear, SVM, no individual given up']
    assert whole['halves_evaluated'] == whole['halves_of_all']
    assert all(chart.is_file() for chart in result.charts)


def test_the_short_bench_searches_the_linear_experiment_alone(tmp_path: Path) -> None:
    result, path = run_benchmark('optimise', BenchmarkOptions(tmp_path, quick=True))
    assert tuple(result.numbers['searches']) == LINEAR
    assert path.name == 'optimise.json'
    assert all(chart.is_file() for chart in result.charts)

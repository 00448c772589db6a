from pathlib import Path

import pytest

from texture_benchmarks.result import BenchmarkOptions
from texture_benchmarks.shared_models import trained_once
from texture_estimation.model import TextureModel
from texture_evaluation.train import train_from_bags


@pytest.fixture(scope='module')
def model(simulated: Path) -> TextureModel:
    return train_from_bags('jamali-amplitude', [simulated])


def test_a_second_benchmark_of_a_run_takes_the_model_of_the_first(tmp_path: Path, model: TextureModel) -> None:
    trainings: list[str] = []

    def train() -> TextureModel:
        trainings.append('trained')
        return model

    run = BenchmarkOptions(tmp_path, bags=tmp_path / 'imported')
    first, second = (trained_once(run, 'jamali-amplitude-1-30', train) for _ in range(2))
    assert trainings == ['trained']
    assert second.labels == first.labels
    assert second.card == first.card
    trained_once(run, 'jamali-amplitude-1-10', train)
    assert len(trainings) == 2


def test_a_benchmark_that_runs_by_itself_trains_its_own_model(tmp_path: Path, model: TextureModel) -> None:
    assert trained_once(BenchmarkOptions(tmp_path), 'any', lambda: model) is model
    assert not list(tmp_path.iterdir())

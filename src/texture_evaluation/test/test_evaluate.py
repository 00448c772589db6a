import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from texture_core.config import write_json
from texture_core.errors import InvalidData, InvalidParameter, ModelMismatch, UnknownName
from texture_core.types import TactileSignal
from texture_estimation.model import TextureModel, load_model
from texture_evaluation.evaluate import evaluate
from texture_evaluation.train import train_from_bags
from texture_recordings.bags import BagWriter, read_bag


@pytest.fixture(scope='module')
def model(simulated: Path) -> TextureModel:
    return train_from_bags('default', [simulated], '1-4')


def test_distinct_surfaces_are_recognised_and_the_figures_agree_with_each_other(
    model: TextureModel, simulated: Path
) -> None:
    figures = evaluate(model, [simulated], '5-6').as_json()
    assert list(figures) == [
        'window_accuracy', 'accuracy_at_s', 'early', 'calibration_error', 'candidates', 'falsely_rejected',
        'unknown_accepted', 'labels', 'confusion', 'latency_us', 'unclassified',
        'wrong_known', 'unknown',
    ]  # fmt: skip
    table = np.array(figures['confusion'])
    assert figures['window_accuracy'] == pytest.approx(np.trace(table) / table.sum())
    assert figures['window_accuracy'] > 0.9
    assert figures['accuracy_at_s'] == {'0.5': pytest.approx(1.0), '1.0': 1.0, '2.5': None, '5.0': None}
    assert figures['early']['accuracy'] == 1.0
    assert 0.5 <= figures['early']['mean_s'] <= 1.2
    assert figures['unknown_accepted'] is None
    assert figures['wrong_known'] == {'early': 0.0, 'final': 0.0}
    assert figures['unknown'] == {'early': 0.0, 'final': 0.0}
    assert 0 < figures['latency_us']['median'] <= figures['latency_us']['p99']


def test_the_figures_are_written_as_json(model: TextureModel, simulated: Path, tmp_path: Path) -> None:
    report = evaluate(model, [simulated / 'glass'], '5')
    write_json(report.as_json(), tmp_path / 'report.json')
    assert json.loads((tmp_path / 'report.json').read_text()) == report.as_json()
    with pytest.raises(InvalidParameter, match='cannot be written'):
        write_json(report.as_json(), tmp_path / 'nowhere' / 'report.json')


def test_surfaces_that_were_not_trained_count_as_unknown_alone(simulated: Path) -> None:
    model = train_from_bags('default', [simulated / 'glass', simulated / 'leather'], '1-4')
    report = evaluate(model, [simulated], '5-6')
    assert {result.surface for result in report.unknown} == {'ridge_2mm_deep'}
    assert report.confusion.shape == (2, 2)
    assert 0.0 <= report.as_json()['unknown_accepted'] <= 1.0


def test_a_model_is_saved_with_the_data_it_was_trained_on(simulated: Path, tmp_path: Path) -> None:
    train_from_bags('default', [simulated], '1-3', tmp_path / 'mine')
    assert load_model(tmp_path / 'mine').name == 'mine'
    card = json.loads((tmp_path / 'mine.json').read_text())
    assert card['data'] == {'bags': ['glass', 'leather', 'ridge_2mm_deep'], 'slides': '1-3'}
    assert evaluate(load_model(tmp_path / 'mine.skops'), [simulated], '4').as_json()['window_accuracy'] > 0.9


def test_fast_channels_leave_the_slow_input_out(simulated: Path) -> None:
    fast = train_from_bags('vibration-and-taxels', [simulated], '1-4', channels='fast')
    assert fast.recipe.feature_set.topics == ('signal',)
    assert fast.feature_set.endswith('signal=1000Hz*1')


def test_another_rate_is_refused_and_nothing_is_scored(model: TextureModel, simulated: Path, tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'slow') as bag:
        for topic, log_ns, value in read_bag(simulated / 'glass'):
            bag.write(topic, halved(value) if topic == 'signal' else value, log_ns)
    with pytest.raises(ModelMismatch, match="'signal' is 500 Hz, the model was trained at 1000 Hz"):
        evaluate(model, [tmp_path / 'slow'])


def test_of_two_fingers_in_a_bag_one_is_named(model: TextureModel, simulated: Path, tmp_path: Path) -> None:
    with BagWriter(tmp_path / 'two') as bag:
        for topic, log_ns, value in read_bag(simulated / 'glass'):
            bag.write(f'/left/{topic}', value, log_ns)
            bag.write(f'/right/{topic}', value, log_ns)
    with pytest.raises(InvalidData, match='namespaces /left, /right'):
        evaluate(model, [tmp_path / 'two'])
    assert len(evaluate(model, [tmp_path / 'two'], namespace='/left').known) == 6


def halved(signal: TactileSignal) -> TactileSignal:
    return replace(signal, sampling_rate_hz=500.0, first_sample=signal.first_sample // 2, samples=signal.samples[::2])


def test_a_wrong_recipe_model_or_choice_of_channels_is_refused(simulated: Path, tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match="did you mean 'default'"):
        train_from_bags('defalt', [simulated])
    with pytest.raises(InvalidParameter, match="'fast' or 'all'"):
        train_from_bags('default', [simulated], channels='slow')
    with pytest.raises(ModelMismatch, match='cannot be read'):
        load_model(tmp_path / 'none')

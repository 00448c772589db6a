"""What a user gets who gives `texture` the wrong thing: exit code 2 and one sentence that says what to do."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from texture_bringup.command import main
from texture_core.types import ExplorationState, TactileSignal
from texture_recordings.bags import BagWriter, read_bag
from texture_simulation.offline import SlidePlan, write_simulated

PLAN = SlidePlan(slides=3, speed_m_s=0.05, force_n=1.0, slide_s=1.0)


@pytest.fixture(scope='module')
def data(tmp_path_factory):
    """Return a folder with bags 'glass' and 'leather' of simulated slides, and models trained on them."""
    folder = tmp_path_factory.mktemp('data')
    write_simulated(folder, PLAN, np.random.default_rng(0), surfaces=('glass', 'leather'))
    bags = [str(folder / 'glass'), str(folder / 'leather')]
    assert main(['train', 'default', *bags, '-o', str(folder / 'fast')]) == 0
    assert main(['train', 'default', *bags, '-o', str(folder / 'all'), '--channels', 'all']) == 0
    return folder


def changed(source, target, change):
    """Write a bag with what `change(topic, value)` returns for each message; None leaves it out."""
    with BagWriter(target) as bag:
        for topic, log_ns, value in read_bag(source):
            new = change(topic, value)
            if new is not None:
                bag.write(topic, new, log_ns)


def refused(arguments, capsys) -> str:
    """Return the sentence with which a command is refused."""
    assert main([str(argument) for argument in arguments]) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1, said
    return said


def test_the_models_are_good_and_the_figures_are_written(data, capsys, tmp_path) -> None:
    figures = tmp_path / 'figures.json'
    bags = [str(data / 'glass'), str(data / 'leather')]
    assert main(['evaluate', str(data / 'fast'), *bags, '--json', str(figures)]) == 0
    assert 'single windows right: 100.0 %' in capsys.readouterr().out
    assert '"window_accuracy": 1.0' in figures.read_text()


def test_a_missing_bag_is_named(data, capsys) -> None:
    assert "no bag '/nowhere'" in refused(['evaluate', data / 'fast', '/nowhere'], capsys)


def test_a_truncated_bag_is_named(data, capsys, tmp_path) -> None:
    shutil.copytree(data / 'glass', tmp_path / 'cut')
    (file,) = (tmp_path / 'cut').glob('*.mcap')
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    assert f"'{tmp_path / 'cut'}'" in refused(['evaluate', data / 'fast', tmp_path / 'cut'], capsys)


def test_an_existing_bag_is_not_overwritten_by_an_import(data, capsys) -> None:
    assert 'biotac20' in refused(['import', 'biotac', data, data], capsys)


def test_a_missing_model_is_named(data, capsys) -> None:
    assert '/nowhere' in refused(['evaluate', '/nowhere', data / 'glass'], capsys)


def test_an_unknown_recipe_gets_the_nearest(data, capsys) -> None:
    assert "did you mean 'default'?" in refused(['train', 'defualt', data / 'glass', '-o', data / 'x'], capsys)


def test_one_surface_is_not_enough_to_learn(data, capsys) -> None:
    assert 'at least two surfaces' in refused(['train', 'default', data / 'glass', '-o', data / 'x'], capsys)


def test_unlabelled_slides_train_nothing(data, capsys, tmp_path) -> None:
    def without_label(_topic, value):
        return replace(value, surface='') if isinstance(value, ExplorationState) else value

    changed(data / 'glass', tmp_path / 'bag', without_label)
    assert 'labelled' in refused(['train', 'default', tmp_path / 'bag', '-o', tmp_path / 'x'], capsys)


def test_slides_that_are_not_there_are_refused(data, capsys) -> None:
    assert '1 to 3' in refused(['evaluate', data / 'fast', data / 'glass', '--slides', '7-9'], capsys)


def test_a_model_refuses_signals_of_another_rate(data, capsys, tmp_path) -> None:
    def every_second(topic, value):
        if topic != 'signal' or not isinstance(value, TactileSignal):
            return value
        return replace(value, samples=value.samples[::2], sampling_rate_hz=500.0, first_sample=value.first_sample // 2)

    changed(data / 'glass', tmp_path / 'bag', every_second)
    assert '500' in refused(['evaluate', data / 'fast', tmp_path / 'bag'], capsys)


def test_a_model_that_needs_the_slow_channels_refuses_a_bag_without_them(data, capsys, tmp_path) -> None:
    changed(data / 'glass', tmp_path / 'bag', lambda topic, value: None if topic == 'signal_static' else value)
    assert 'signal_static' in refused(['evaluate', data / 'all', tmp_path / 'bag'], capsys)
    assert 'signal_static' in refused(['evaluate', data / 'all', data / 'glass', '--channels', 'fast'], capsys)

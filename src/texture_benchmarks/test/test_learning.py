# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import numpy as np
import pytest

from texture_benchmarks.catalogue import run_benchmark
from texture_benchmarks.learning import (
    MOTIONS,
    RECORDED,
    SIMULATED,
    known_from,
    right_after_slides,
    run_incremental,
    simulated_slides,
)
from texture_benchmarks.scale import FeatureSpread
from texture_benchmarks.study import BenchmarkOptions
from texture_core.errors import InvalidData
from texture_estimation.recipe import load_recipe
from texture_features.feature_set import LabelledFeatures

pytestmark = pytest.mark.ros


def clouds(labels=('cork', 'felt', 'wood'), slides=6, windows=6):
    rng = np.random.default_rng(0)
    centres = 3.0 * rng.normal(size=(len(labels), 5))
    names = [(label, f'{label}/{slide + 1}') for label in labels for slide in range(slides) for _ in range(windows)]
    values = np.repeat(centres, slides * windows, axis=0) + rng.normal(size=(len(names), 5))
    return LabelledFeatures(
        values,
        np.array([label for label, _ in names]),
        np.array([group for _, group in names]),
        tuple('abcde'),
        'kind',
        0.5,
        0.25,
    )


def test_a_course_of_examples_ends_as_good_as_training_again(tmp_path: Path) -> None:
    scores, before, add_s = run_incremental(
        load_recipe('default'), clouds(), ['wood'], last_training=4, stages=(1, 4), path=tmp_path / 'm'
    )
    assert scores[4]['incremental']['windows'] > scores[4]['retrained']['windows'] - 0.15
    assert scores[4]['incremental, old textures']['windows'] > before['windows'] - 0.15
    assert scores[1]['incremental, new textures']['slides'] > 0.4
    assert len(add_s) == 4
    assert sorted(path.name for path in (tmp_path / 'm.added').iterdir())[-1] == '00004.json'


@pytest.mark.benchmark
def test_recorded_materials_are_added_slide_by_slide(tmp_path: Path, data: Path) -> None:
    result, _ = run_benchmark('learning', BenchmarkOptions(tmp_path, data, quick=True))
    after_two = result.numbers['slides']['2']
    assert after_two['incremental']['slides'] > 0.7
    assert after_two['incremental']['windows'] > after_two['retrained']['windows'] - 0.1
    chosen = result.numbers['chosen_motions']
    assert chosen[SIMULATED]['informed'][-1] >= 0.6
    assert all(0.25 < fractions[-1] <= 1.0 for fractions in chosen[RECORDED].values())  # chance is a quarter


def test_without_recordings_there_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(InvalidData, match='no folder of recorded data was given'):
        run_benchmark('learning', BenchmarkOptions(tmp_path))


def test_trials_are_recognised_once_a_motion_distinguishes_the_textures() -> None:
    textures = ('cork', 'felt', 'wood')
    motions = MOTIONS[:2]  # the second one carries no information
    values = np.random.default_rng(0).standard_normal((2, 3, 8, 2))
    values[0, :, :, 0] += 100.0 * np.arange(3)[:, None]
    known = known_from(motions, values, textures)
    found = right_after_slides(known, motions, values, np.random.default_rng(0), 2)
    assert found['informed'].tolist() == found['fixed order'].tolist() == [1.0, 1.0]
    assert found['random'][0] < 1.0


def test_simulated_slides_are_one_window_of_each_texture_with_each_motion() -> None:
    one = simulated_slides(MOTIONS[:1], 1, np.random.default_rng(0))
    assert one.shape[:3] == (1, 8, 1)
    assert one == pytest.approx(simulated_slides(MOTIONS[:1], 1, np.random.default_rng(0)))


DEVIATIONS = {'textures': 5.0, 'slides': 2.0, 'windows': 1.0}


def test_drawn_features_vary_as_much_among_textures_slides_and_windows_as_the_recorded_ones() -> None:
    rng = np.random.default_rng(0)
    textures = DEVIATIONS['textures'] * rng.standard_normal((60, 1, 1, 3))
    slides = textures + DEVIATIONS['slides'] * rng.standard_normal((60, 20, 1, 3))
    values = slides + DEVIATIONS['windows'] * rng.standard_normal((60, 20, 10, 3))
    labels = np.repeat([f'c{number:02d}' for number in range(60)], 200)
    groups = np.char.add(labels, np.tile(np.repeat([f'/{number}' for number in range(20)], 10), 60))
    names = ('signal/mean', 'signal/rms', 'signal/peak')
    spread = FeatureSpread(LabelledFeatures(values.reshape(-1, 3), labels, groups, names, 'a1', 0.5, 0.1))
    centres = spread.textures(2000, rng)
    drawn = spread.slides(np.zeros((1, 3)), 2000, 10, rng).values.reshape(2000, 10, 3)
    assert centres.std(axis=0) == pytest.approx([DEVIATIONS['textures']] * 3, rel=0.2)  # of 60 textures: 9 % each
    assert drawn.mean(axis=1).std(axis=0) == pytest.approx([DEVIATIONS['slides']] * 3, rel=0.1)
    # The mean of ten windows takes a tenth of their variance: once when it is measured, once when it is drawn.
    about_their_mean = (drawn - drawn.mean(axis=1, keepdims=True)).std()
    assert about_their_mean == pytest.approx(0.9 * DEVIATIONS['windows'], rel=0.02)


@pytest.mark.benchmark
def test_a_small_training_on_drawn_features_recognises_some_and_reports_its_cost(tmp_path: Path, data: Path) -> None:
    result, _ = run_benchmark('scale', BenchmarkOptions(tmp_path, data, quick=True))
    [few] = result.numbers['textures, default']
    assert few['training_windows'] == 6 * 5 * 5
    assert few['slide_accuracy'] > 0.4  # chance is a sixth
    assert few['train_s'] > 0
    assert few['memory_of_the_process_mib'] > few['memory_beyond_examples_mib'] >= 0

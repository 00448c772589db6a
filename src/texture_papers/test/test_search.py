# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidData
from texture_core.types import Window
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness import Grades, load_roughness_recipe
from texture_features.windows import CutWindow
from texture_papers.rispal_experiment import checkless
from texture_papers.roberge import UNDECIDED, SvmPairs, decided_by_slide
from texture_papers.search import (
    RANGES,
    Described,
    SearchParams,
    decisions_of_pair,
    grading,
    random_halves,
    recognition,
    search,
    tuned_pairs,
    variables_of,
    varied,
)
from texture_papers.slides import ArrayStream, SlideArrays

SMALL = SearchParams(population=6, generations=3, halves=4)


def tones(labels: int = 3, count: int = 8, noise: float = 1.0) -> SlideArrays:
    """Return scans of 0.5 s at 1 kHz: each surface another tone, which shifts with the speed, and noise."""
    rng = np.random.default_rng(1)
    speed = np.tile([0.1, 0.15, 0.2, 0.15], labels * count // 4)
    pitch = np.repeat(40.0 + 4.0 * np.arange(labels), count) * speed / 0.15
    phase = 2 * np.pi * (pitch[:, None] * np.arange(500) / 1000.0 + rng.random((len(speed), 1)))
    samples = np.sin(phase) + noise * rng.normal(size=phase.shape)
    names = np.repeat([f'surface_{number}' for number in range(labels)], count)
    return SlideArrays({'signal': ArrayStream(samples[..., None], 1000.0)}, names, speed, np.ones_like(speed))


def test_the_variables_and_their_ranges_are_those_of_the_papers() -> None:
    of_peaks = {'peaks', 'gap_hz', 'order', 'signal_energy', 'arc_length'}
    assert set(variables_of('ets-linear-svm')) == of_peaks | {'speed', 'force', 'box', 'kernel_scale'}
    assert set(variables_of('ets-circular-ann')) == set(variables_of('ets-fine-ann')) == of_peaks | {'hidden'}
    assert set(variables_of('ets-roughness-svm5')) == of_peaks | {'box', 'kernel_scale'}
    assert variables_of('kaboli-svm') == variables_of('ets-linear-svm-pairs') == ()
    ends = {name: (values[0], values[-1]) for name, values in RANGES.items()}
    assert ends['peaks'] == (2, 15)
    assert ends['gap_hz'] == ends['hidden'] == (5, 50)
    assert ends['box'] == (0.01, 10.0)
    assert ends['kernel_scale'] == (1e-5, 1e5)


@pytest.mark.parametrize('name', ['ets-linear-svm', 'ets-linear-ann-vote', 'ets-fine-svm'])
def test_an_individual_is_a_recipe_with_its_features_and_its_learner(name: str) -> None:
    chosen = {name: RANGES[name][-1] for name in variables_of(name)}
    content = varied(load_recipe(name), chosen).as_mapping()
    section, [learner] = content['inputs']['signal'], content['learner'].values()
    features = {key.rpartition(':')[2]: value for one in section['features'] for key, value in one.items()}
    assert features['SpectralPeaks'] == {'peaks': 15, 'gap_hz': 50.0, 'order': 'intensity', 'points': 2048}
    assert ('force' in features) == name.startswith('ets-linear')
    assert section.get('stretch_to_m_s', 0.0) == (0.15 if name.startswith('ets-linear') else 0.0)
    assert learner.get('kernel_scale', 1e5) == 1e5
    assert learner.get('hidden', 50) == 50
    least = varied(load_recipe(name), {name: RANGES[name][0] for name in variables_of(name)}).as_mapping()
    assert len(least['inputs']['signal']['features']) == 1  # the peaks alone


def test_halves_have_half_of_the_scans_of_each_surface() -> None:
    labels = np.repeat(['cork', 'felt'], [7, 10])
    halves = random_halves(labels, 20, 0)
    assert (halves[:, :7].sum(axis=1) == 3).all()
    assert (halves[:, 7:].sum(axis=1) == 5).all()
    assert len(np.unique(halves, axis=0)) > 10


def test_the_search_finds_the_best_of_a_known_landscape(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Described, '__call__', lambda *_: np.zeros((1, 1)))
    tried: list[int] = []

    def known(recipe, values, scans, training):
        tried.append(1)
        peaks = recipe.feature_set.inputs[0].features[0][1]
        peaks = getattr(peaks, 'feature', peaks).peaks
        score = 0.9 - 0.01 * abs(peaks - 10) - 0.02 * abs(np.log10(recipe.learner.box_constraint))
        return score + 0.002 * training[0], score

    found = search(load_recipe('ets-linear-svm'), tones(), SearchParams(), known)
    assert abs(found.individual['peaks'] - 10) <= 1
    assert abs(np.log10(found.individual['box'])) <= 0.2
    assert found.tried <= 600  # 20 individuals, 30 generations
    assert len(tried) == 20 * found.tried
    again = search(load_recipe('ets-linear-svm'), tones(), SearchParams(4, 1, 2), known, start=found.best)
    assert again.individual == found.individual  # a search that begins with what another found


def test_the_same_seed_finds_the_same_and_its_scores_are_those_of_training() -> None:
    scans, base = tones(labels=2), load_recipe('ets-linear-svm')
    first, second = (search(base, scans, SMALL) for _ in range(2))
    assert first == second
    recipe = varied(base, first.individual)
    values, codes = scans.values(recipe), np.unique(scans.labels, return_inverse=True)[1]
    fractions = []
    for half in random_halves(scans.labels, SMALL.halves, SMALL.seed):
        fitted = recipe.learner.fit(values[half], codes[half], np.arange(half.sum()))
        right = recipe.learner.predictor(fitted.parameters)(values).argmax(axis=1) == codes
        fractions.append((right[half].mean(), right[~half].mean()))
    assert (first.learning, first.test) == pytest.approx(tuple(np.mean(fractions, axis=0)), abs=1e-4)


@pytest.mark.parametrize(('box', 'scale'), [(1.0, 3.0), (10.0, 0.5), (0.01, 100.0)])
def test_the_machine_of_a_search_decides_as_the_learner_does(box: float, scale: float) -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=(120, 6)) * np.geomspace(1e-3, 1e3, 6)
    codes, rows = (values[:, 0] > 0) * 1, rng.random(120) < 0.5
    learner = SvmPairs(box_constraint=box, kernel_scale=scale)
    exact = learner.predictor(learner.fit(values[rows], codes[rows], codes[rows]).parameters).decisions(values)
    np.testing.assert_allclose(decisions_of_pair(learner, values, codes, rows), exact, atol=5e-3)  # libsvm's tolerance


def test_each_pair_of_textures_gets_separate_variables_and_a_separate_machine(tmp_path: Path) -> None:
    scans, base = tones(noise=0.5), load_recipe('ets-linear-svm')
    names = np.unique(scans.labels).tolist()
    found = {pair: search(base, scans.of(np.isin(scans.labels, pair)), SMALL) for pair in combinations(names, 2)}
    tuned = tuned_pairs(base, SMALL, found, len(scans.labels))
    assert [pair.labels for pair in tuned.recipe.learner.pairs] == list(combinations(names, 2))
    half = random_halves(scans.labels, 1, 5)[0]
    bound = replace(tuned.recipe, learner=tuned.recipe.learner.of_examples(named(tuned.recipe), names))
    assert recognition(bound, scans.values(bound), scans, half)[0] > 0.7
    path = tuned.write(tmp_path / 'best.yaml')
    assert path.read_text().startswith('# Found by a search of 6 individuals, 3 generations, 4 halves, seed 0, on 24')
    assert load_recipe(str(path)).learner == tuned.recipe.learner


def named(recipe):
    return recipe.feature_set.names(((1000.0, ('a',)),) * len(recipe.feature_set.window_names))


def test_features_are_those_of_the_feature_extractor_and_parts_share_a_scan() -> None:
    scans, rng = tones(), np.random.default_rng(0)
    described = Described(load_recipe('ets-linear-ann-vote'), scans)
    for _ in range(4):
        chosen = {name: RANGES[name][rng.integers(len(RANGES[name]))] for name in variables_of('ets-linear-ann-vote')}
        recipe = varied(load_recipe('ets-linear-ann-vote'), chosen)
        stream = scans.streams['signal'].samples.reshape(-1, 100, 1)  # five parts of each scan
        speed = np.repeat(scans.speed_m_s, 5)
        events = [
            CutWindow(0, 'e', 0.1, 0.1, {'signal': Window(samples, 1000.0, ('a',), 0, of_it, 1.0)}, of_it, 1.0)
            for samples, of_it in zip(stream, speed, strict=True)
        ]
        expected = [vector.values for vector in recipe.feature_set.extract_many(events)]
        np.testing.assert_allclose(scans.values(recipe), expected, rtol=1e-9)
        np.testing.assert_array_equal(described(recipe), scans.values(recipe))
    with pytest.raises(InvalidData, match=r'no window of 0\.8 s'):
        scans.values(load_recipe('ets-fine-svm'))


def test_parts_of_a_scan_vote_and_too_few_equal_votes_are_undecided() -> None:
    rule = load_recipe('ets-linear-svm-vote').evidence
    votes = np.array([[0, 0, 0, 1, 2], [0, 0, 1, 1, 2], [2, 2, 2, 2, 0]])
    decided = decided_by_slide(np.eye(3)[votes].reshape(-1, 3), 3, rule, 1.0)
    assert decided.tolist() == [0, UNDECIDED, 2]


@pytest.mark.parametrize('regressor', ['ann1', 'ann5', 'svm5'])
def test_regressors_are_searched_by_how_near_their_grades_come(regressor: str) -> None:
    grades = Grades({f'surface_{number}': float(number) for number in range(1, 6)})
    levels = np.repeat(1.5 ** np.arange(5), 8)  # the level of a hiss rises with the grade
    samples = levels[:, None, None] * np.random.default_rng(0).normal(size=(len(levels), 500, 1))
    names, same = np.repeat(list(grades.grades), 8), np.ones(len(levels))
    hisses = SlideArrays({'signal': ArrayStream(samples, 1000.0)}, names, 0.15 * same, same)
    recipe = checkless(load_roughness_recipe(f'ets-roughness-{regressor}'))
    found = search(recipe, hisses, SearchParams(12, 4, 3), grading(grades))
    assert (found.learning + found.test) / 2 > 0.7

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import importlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from texture_core.errors import InvalidParameter
from texture_estimation.learners.sklearn_learner import SklearnPredictor
from texture_estimation.recipe import load_recipe
from texture_evaluation.charts import REDUCED
from texture_papers import report
from texture_papers.catalogue import EXPERIMENTS, PROTOCOLS, run_experiment
from texture_papers.jamali import MeanAmplitude
from texture_papers.protocol import (
    VERDICTS,
    Experiment,
    Finding,
    Interval,
    MethodResult,
    PaperProtocol,
    difference,
    digest_of,
    digest_of_row,
    divided,
    drawn,
    folds,
    halves,
    mean,
    mean_over_seeds,
    outcomes,
    recipe_of,
    reduced,
    wilson,
    with_seeds,
)
from texture_papers.report import at_least, higher, lower_in, most_errors, seldom
from texture_papers.roberge import UNDECIDED
from texture_papers.slides import gather
from texture_simulation.scene import load_scene

CHARTS = Path(__file__).parents[3] / 'docs' / 'charts'
# What has not been run since something of it changed is not stored: it is not published.
STORED = {
    path.stem: json.loads(path.read_text())['numbers'] for path in CHARTS.glob('*.json') if path.stem in EXPERIMENTS
}
LARGE, LARGE_GRADES = 0.15, 0.05  # of the slides, and in grades of roughness
CODES = np.repeat([0, 1, 2], 20)
CONDITIONS = np.where(np.arange(60) % 2 == 0, 'slow', 'fast')
SURFACES = ('cork', 'felt', 'linen')


def outcome(decided: list[int] | np.ndarray) -> MethodResult:
    none_training = np.zeros((1, 60), dtype=bool)
    return MethodResult(SURFACES, CODES, CONDITIONS, np.array(decided)[None], none_training, 0.0)


@pytest.mark.benchmark
@pytest.mark.parametrize('protocol', PROTOCOLS.values(), ids=PROTOCOLS)
def test_each_experiment_runs_and_shows_the_papers_figures_next_to_its_figures(
    protocol: PaperProtocol, tmp_path: Path
) -> None:
    result, path = run_experiment(protocol.name, Experiment(tmp_path, quick=True))
    assert path.is_file()
    assert 'simulated' in result.data
    assert all(matplotlib.image.imread(chart).std() > 0 for chart in result.charts)
    text = '\n'.join(result.lines())
    for task in protocol.tasks:
        for method in task.methods:
            figures = result.numbers['tasks'][task.name][method.name]
            value, low, high = figures['test']
            assert 0 <= low <= value <= high <= 1
            assert method.name in text
            if method.paper.test is not None:
                assert f'{100 * method.paper.test:.1f}' in text
    assert {finding['verdict'] for finding in result.numbers['findings']} <= {'holds', 'does not hold', 'not decided'}
    few_show_the_direction_of_what_is_large(protocol.name, result.numbers['findings'])


def few_show_the_direction_of_what_is_large(name: str, findings: list[dict[str, Any]]) -> int:
    """Assert that what is large in the stored experiment has its sign in these findings; return how many are large."""
    stored = {one['claim']: one.get('over_seeds', one['interval']) for one in STORED[name]['findings']}
    large, limit = 0, LARGE_GRADES if name == 'roughness' else LARGE
    for finding in findings:
        value, low, high = stored[finding['claim']]
        if min(abs(low), abs(high)) > limit and low * high > 0:
            assert finding['interval'][0] * value > 0, finding['claim']
            large += 1
    return large


def test_a_quick_run_is_marked_in_its_json_and_its_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    result, path = run_experiment('hu', Experiment(tmp_path, quick=True))
    written = json.loads(path.read_text())
    assert written['reduced'] == REDUCED
    assert written['split'].startswith(f'{REDUCED}; part of: ')
    assert written['split'].endswith('; here 33 of 50 slides train')
    reds = [(matplotlib.image.imread(chart)[..., :3] @ [1.0, -0.5, -0.5] > 0.9).sum() for chart in result.charts]
    assert min(reds) > 100
    assert 'reduced' not in json.loads(result.write(tmp_path / 'whole').read_text())


@pytest.mark.benchmark
@pytest.mark.parametrize('name', sorted(EXPERIMENTS.keys() - PROTOCOLS.keys() - {'kaboli-online'}))
def test_a_quick_run_of_an_experiment_without_a_protocol_shows_the_direction_too(name: str, tmp_path: Path) -> None:
    result, _ = run_experiment(name, Experiment(tmp_path, quick=True))
    assert few_show_the_direction_of_what_is_large(name, result.numbers['findings'])


@pytest.mark.parametrize('name', ['jamali', 'kaboli', 'hu', 'hu-components', 'kaboli-online'])
def test_an_experiment_whose_paper_searches_for_nothing_refuses_to_tune(name: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidParameter, match=f"'{name}' has nothing to tune"):
        run_experiment(name, Experiment(tmp_path, quick=True, tune=True))
    with pytest.raises(InvalidParameter, match='0 seeds were requested'):
        run_experiment(name, Experiment(tmp_path, quick=True), seeds=0)
    assert not list(tmp_path.iterdir())


@pytest.mark.benchmark
def test_a_search_sees_the_training_slides_alone_and_its_recipe_is_tried_on_the_rest(tmp_path, monkeypatch) -> None:
    seen: dict = {}
    monkeypatch.setattr(report, 'outcomes', lambda *args, **kwargs: seen.update(outcomes(*args, **kwargs)) or seen)
    result, path = run_experiment('ets-linear', Experiment(tmp_path, seed=1, quick=True, tune=True), seeds=2)
    assert path.name == 'ets-linear-tuned.json'
    assert result.numbers['seeds'] == [1, 2]
    assert 'over 2 seeds' in '\n'.join(result.lines())
    figures = result.numbers['tuning']['linear slides, ets-linear-svm']
    assert (figures['scans'], len(figures['found'])) == (4 * 18 // 2, 6)
    assert seen['linear slides', 'ets-linear-svm'].tested.sum() == figures['scans']
    found = load_recipe(str(tmp_path / 'ets-linear-svm-tuned-linear-slides-1.yaml'))
    assert all(0.01 <= pair.learner.box_constraint <= 10.0 for pair in found.learner.pairs)
    searches = (tmp_path / 'searches.jsonl').read_text()
    assert len(searches.splitlines()) == 2 * 4 * 6  # SVM and ANN, whole scans and their parts, with each seed
    run_experiment('ets-linear', Experiment(tmp_path, seed=1, quick=True, tune=True))
    assert (tmp_path / 'searches.jsonl').read_text() == searches  # what is done is not searched again


def test_two_directions_are_joined_into_one_vector_with_separate_components() -> None:
    protocol = PROTOCOLS['hu']
    task = reduced(protocol.tasks[0], 4)
    slides = gather(load_scene(protocol.scene), (), task.visits, 0, slow=False)
    both, x_only, y_only = (recipe_of(method) for method in task.methods[:3])
    values, owner = slides.extract(both.feature_set, task.methods[0].views)
    assert values.shape == (20, 2 * 12_288)  # one vector a place
    assert len(np.unique(owner)) == 20
    halves_of = [slides.extract(recipe.feature_set, task.methods[place].views)[0] for place, recipe in
                 ((1, x_only), (2, y_only))]  # fmt: skip
    np.testing.assert_array_equal(values, np.concatenate(halves_of, axis=1))
    kept = [recipe.learner.fit(columns, slides.codes, owner).parameters['components'].shape[1]
            for recipe, columns in ((both, values), (x_only, halves_of[0]), (y_only, halves_of[1]))]  # fmt: skip
    assert kept[0] == kept[1] + kept[2]  # the paper: 39 and 39 make 78


def test_an_entire_contact_is_press_slide_and_lift_in_the_time_of_a_slide() -> None:
    entire = PROTOCOLS['jamali'].tasks[1].visits[0]
    slides = gather(load_scene('jamali'), ('carpet_1',), (replace(entire, count=3),), 0, slow=False)
    samples = slides.views[0].streams['signal'].samples
    assert samples.shape == (3, 2 * 2500, 8)
    vibration = np.abs(np.diff(samples, axis=1)).mean(axis=(0, 2))
    press, sliding, lifted = (vibration[part].mean() for part in (slice(0, 250), slice(1250, 4000), slice(-200, None)))
    assert lifted < 0.5 * sliding
    assert press > lifted


def test_divisions_keep_to_the_papers_split() -> None:
    assert divided(halves(20), CODES, CONDITIONS, 0).sum(axis=1).tolist() == [30] * 20
    parts = divided(folds(10, 2), CODES, CONDITIONS, 0)
    assert parts.shape == (20, 60)
    assert (~parts[:10]).sum(axis=0).tolist() == [1] * 60  # each slide is held out once a round
    assert divided(drawn(2 / 3, 5), CODES, CONDITIONS, 0).sum(axis=1).tolist() == [40] * 5
    assert (divided('slow', CODES, CONDITIONS, 0)[0] == (CONDITIONS == 'slow')).all()


def test_figures_of_a_known_outcome() -> None:
    decided = CODES.copy()
    decided[:4] = [1, 1, 2, UNDECIDED]
    one = outcome(decided)
    assert one.test.value == pytest.approx(56 / 60)
    assert one.unclassified == pytest.approx(1 / 60)
    assert one.confusion[0].tolist() == pytest.approx([0.8, 0.1, 0.05, 0.05])
    assert one.pairs()[0] == ('cork', 'felt')
    assert one.taken_for('cork', 'felt').sum() == 2


def test_a_claim_holds_only_if_the_interval_supports_it() -> None:
    good, bad = outcome(CODES), outcome(np.where(np.arange(60) % 3 == 0, (CODES + 1) % 3, CODES))
    assert higher('', good, bad).holds is True
    assert higher('', bad, good).holds is False
    assert at_least('', bad, 0.9).holds is False
    assert at_least('', bad, 0.6).holds is None  # a figure within the interval is neither reached nor missed
    assert at_least('', good, 0.9).holds is True
    slow_lost = outcome(np.where((CONDITIONS == 'slow') & (CODES == 0), 1, CODES))
    assert lower_in('', slow_lost, 'slow').holds is True
    assert most_errors('', slow_lost, [('cork', 'felt')]).holds is True
    assert most_errors('', slow_lost, [('cork', 'linen')]).holds is False
    assert seldom('', good, ('cork', 'felt'), 0.2).holds is True
    one_lost = outcome(np.where(np.arange(60) == 0, 1, CODES))
    assert higher('', good, one_lost).holds is None


def test_intervals_are_those_of_the_textbook() -> None:
    eight = wilson(np.r_[np.ones(8), np.zeros(2)])  # 8 of 10: 0.490 to 0.943
    assert (eight.low, eight.high) == (pytest.approx(0.490, abs=1e-3), pytest.approx(0.943, abs=1e-3))
    values = np.array([1.0, 2.0, 3.0, 4.0])
    assert mean(values).high - 2.5 == pytest.approx(1.96 * values.std(ddof=1) / 2, rel=1e-3)
    assert difference(values, values).value == 0


def test_what_has_no_separate_label_is_the_recipe_as_released() -> None:
    methods = [method for protocol in PROTOCOLS.values() for task in protocol.tasks for method in task.methods]
    assert not [method.name for method in methods if method.learner and not method.label]


def numbers(seed: int, test: float, gain: float, **finding: Any) -> dict:
    return {
        'seed': seed,
        'tasks': {'task': {'one': {'test': [test, 0.0, 1.0], 'learning': None, 'unclassified': 0.1}}},
        'findings': [{'claim': 'it gains', 'here': '', 'interval': [gain, gain, gain], 'verdict': 'holds', **finding}],
    }


def test_the_interval_of_five_seeds_is_that_of_student() -> None:
    interval = mean_over_seeds([0.70, 0.72, 0.74, 0.76, 0.78])
    assert interval.value == pytest.approx(0.74)
    assert interval.high - interval.value == pytest.approx(2.776 * 0.0316228 / np.sqrt(5), rel=1e-3)  # t of 4 degrees


def test_each_figure_has_its_mean_over_seeds_and_a_finding_is_decided_by_it() -> None:
    merged = with_seeds(numbers(0, 0.8, 0.1), [numbers(1, 0.9, 0.3), numbers(2, 0.7, -0.4)])
    assert merged['seeds'] == [0, 1, 2]
    assert merged['tasks']['task']['one']['by_seed'] == [0.8, 0.9, 0.7]
    assert merged['tasks']['task']['one']['over_seeds'][0] == pytest.approx(0.8)
    [finding] = merged['findings']
    assert finding['over_seeds'][0] == pytest.approx(0.0)
    assert finding['verdict'] == 'not decided'


def test_seeds_are_no_draws_of_textures_so_that_few_textures_decide() -> None:
    by_texture = {'cork': 0.5, 'felt': -0.1, 'linen': 0.1}  # the same in all seeds: seeds alone would be certain
    runs = [numbers(seed, 0.8, 0.1667, by_texture=by_texture) for seed in range(5)]
    [finding] = with_seeds(runs[0], runs[1:])['findings']
    assert finding['over_seeds'] == pytest.approx([0.1667, 0.1667 - 0.759, 0.1667 + 0.759], abs=2e-3)  # t of 2 degrees
    assert finding['verdict'] == 'not decided'


def test_recipe_learner_scene_motion_split_and_the_code_of_a_feature_each_change_the_digest_of_a_row(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    protocol = PROTOCOLS['jamali']
    task, entire = protocol.tasks
    [visits] = task.visits
    method = next(one for one in task.methods if one.name == 'jamali-amplitude')
    other = next(one for one in task.methods if one.name == 'jamali-naive-bayes-3')
    faster = replace(task, visits=(replace(visits, sliding=replace(visits.sliding, speed_m_s=0.06)),))
    rows = [
        digest_of_row(protocol, task, method),
        digest_of_row(protocol, task, other),
        digest_of_row(replace(protocol, scene='twelve_textures'), task, method),
        digest_of_row(protocol, faster, method),
        digest_of_row(protocol, replace(task, visits=entire.visits), method),
        digest_of_row(replace(protocol, divide=folds(5, 1)), task, method),
    ]
    assert digest_of_row(protocol, task, method) == rows[0]
    feature = MeanAmplitude.__call__
    monkeypatch.setattr(MeanAmplitude, '__call__', lambda self, windows: 1.01 * feature(self, windows))
    rows.append(digest_of_row(protocol, task, method))
    monkeypatch.undo()
    monkeypatch.setattr(
        SklearnPredictor, '__call__', lambda self, X: np.eye(self.n_labels)[np.zeros(len(X), dtype=int)]
    )
    rows.append(digest_of_row(protocol, task, method))
    assert len(set(rows)) == len(rows)


def test_a_definition_that_changes_has_another_digest() -> None:
    assert len({digest_of(name) for name in ('any-place', 'default', 'kaboli-pa', 'kaboli-em', 'roughness')}) == 5


@pytest.mark.parametrize('name', STORED)
def test_a_verdict_follows_from_the_interval_over_seeds_or_over_textures(name: str) -> None:
    numbers = STORED[name]
    assert len(numbers['seeds']) >= 5
    for finding in numbers['findings']:
        assert len(finding['by_seed']) >= 5, finding['claim']
        if 'by_texture' not in finding:
            assert finding['over_seeds'] == pytest.approx(mean_over_seeds(finding['by_seed']).as_json(), abs=2e-4)
        assert finding['verdict'] == VERDICTS[Interval(*finding['over_seeds']).positive()]


def guessed(protocol: PaperProtocol) -> dict[tuple[str, str], MethodResult]:
    """Return results of each method in each task by which every slide gets any surface as its label."""
    rng = np.random.default_rng(0)
    results = {}
    for task in protocol.tasks:
        surfaces = task.surfaces or tuple(load_scene(protocol.scene).surfaces)
        kinds = [(code, visit.condition) for code in range(len(surfaces)) for visit in task.visits for _ in range(2)]
        codes, conditions = (np.array(column) for column in zip(*kinds, strict=True))
        for method in task.methods:
            decided = rng.integers(len(surfaces), size=(1, len(codes)))
            held_out = np.zeros(decided.shape, dtype=bool)
            results[task.name, method.name] = MethodResult(surfaces, codes, conditions, decided, held_out, 0.0)
    return results


ANCHORED = {name: one for name, one in PROTOCOLS.items() if one.anchor}


@pytest.mark.parametrize('protocol', ANCHORED.values(), ids=ANCHORED)
def test_the_figure_that_set_a_scene_is_no_finding(protocol: PaperProtocol, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[tuple[MethodResult, float]] = []

    def at_least(claim: str, outcome: MethodResult, limit: float) -> Finding:
        calls.append((outcome, limit))
        return report.at_least(claim, outcome, limit)

    module = importlib.import_module(protocol.findings.__module__)
    monkeypatch.setattr(module, 'at_least', at_least, raising=False)
    results, anchor = guessed(protocol), protocol.anchor
    assert protocol.findings(results)
    anchored = results.get((anchor.task, anchor.method))
    assert not [limit for outcome, limit in calls if outcome is anchored and limit == anchor.test]

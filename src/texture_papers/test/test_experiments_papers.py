import json
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from texture_core.errors import InvalidParameter, UnknownName
from texture_estimation.recipe import load_recipe
from texture_estimation.search import UNDECIDED
from texture_papers import report
from texture_papers.catalogue import EXPERIMENTS, PROTOCOLS, run_experiment
from texture_papers.protocol import (
    Experiment,
    MethodResult,
    PaperProtocol,
    apart,
    drawn,
    evaluate_method,
    folds,
    gather,
    halves,
    mean,
    mean_share,
    outcomes,
    recipe_of,
    reduced,
    share,
    training_in,
)
from texture_papers.report import at_least, higher, lower_in, most_errors, seldom
from texture_simulation.scene import load_scene

STORED = json.loads((Path(__file__).parent / 'stored_findings.json').read_text())
LARGE = 0.15  # of the slides, or in grades
CODES = np.repeat([0, 1, 2], 20)
CONDITIONS = np.where(np.arange(60) % 2 == 0, 'slow', 'fast')
SURFACES = ('cork', 'felt', 'linen')


def outcome(decided: list[int] | np.ndarray) -> MethodResult:
    none_training = np.zeros((1, 60), dtype=bool)
    return MethodResult(SURFACES, CODES, CONDITIONS, np.array(decided)[None], none_training, 0.0)


@pytest.mark.benchmark
@pytest.mark.parametrize('protocol', PROTOCOLS, ids=lambda protocol: protocol.name)
def test_each_experiment_runs_and_shows_the_papers_figures_beside_its_own(
    protocol: PaperProtocol, tmp_path: Path
) -> None:
    result, path = run_experiment(protocol.name, Experiment(tmp_path, quick=True))
    assert path.is_file()
    assert 'simulated' in result.data
    assert all(matplotlib.image.imread(chart).std() > 0 for chart in result.charts)
    text = '\n'.join(result.lines)
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
    large = 0
    for finding in findings:
        value, low, high, _ = STORED[name][finding['claim']]
        if min(abs(low), abs(high)) > LARGE and low * high > 0:
            assert finding['interval'][0] * value > 0, finding['claim']
            large += 1
    return large


@pytest.mark.benchmark
@pytest.mark.parametrize('name', sorted(EXPERIMENTS.keys() - {protocol.name for protocol in PROTOCOLS}))
def test_a_quick_run_of_an_experiment_without_a_protocol_shows_the_direction_too(name: str, tmp_path: Path) -> None:
    result, _ = run_experiment(name, Experiment(tmp_path, quick=True, papers_only=True))
    assert few_show_the_direction_of_what_is_large(name, result.numbers['findings'])


def test_an_unknown_experiment_is_refused_with_the_nearest_name(tmp_path: Path) -> None:
    with pytest.raises(UnknownName, match="did you mean 'jamali'"):
        run_experiment('jamalli', Experiment(tmp_path))


@pytest.mark.parametrize('name', ['jamali', 'kaboli', 'hu', 'hu-components'])
def test_an_experiment_whose_paper_searches_for_nothing_refuses_to_tune(name: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidParameter, match=f"'{name}' has nothing to tune"):
        run_experiment(name, Experiment(tmp_path, quick=True, tune=True))
    assert not list(tmp_path.iterdir())


@pytest.mark.benchmark
def test_a_search_sees_the_training_slides_alone_and_its_recipe_is_tried_on_the_rest(tmp_path, monkeypatch) -> None:
    seen: dict = {}
    monkeypatch.setattr(report, 'outcomes', lambda *args, **kwargs: seen.update(outcomes(*args, **kwargs)) or seen)
    result, path = run_experiment('ets-fine', Experiment(tmp_path, seed=1, quick=True, tune=True))
    assert path.name == 'ets-fine-tuned.json'
    figures = result.numbers['tuning']['ets-fine-svm, ten textures']
    assert figures['scans'] == 10 * 16 // 2
    assert seen['ten textures', 'ets-fine-svm'].tested.sum() == figures['scans']
    assert seen['ten textures', 'default'].tested.sum() > figures['scans']  # nothing was searched for ours
    found = load_recipe(str(tmp_path / 'ets-fine-svm-tuned-ten-textures.yaml'))
    assert 0.01 <= found.learner.box_constraint <= 10.0


def test_two_directions_are_joined_into_one_vector_with_components_of_their_own() -> None:
    protocol = next(protocol for protocol in PROTOCOLS if protocol.name == 'hu')
    task = reduced(protocol.tasks[0], 4)
    slides = gather(load_scene(protocol.scene), task, 0, slow=False)
    both, x_only, y_only = (recipe_of(method) for method in task.methods[:3])
    values, owner = slides.extract(both.feature_set, task.methods[0].views)
    assert values.shape == (20, 2 * 12_288)  # one vector a place
    assert len(np.unique(owner)) == 20
    halves_of = [slides.extract(recipe.feature_set, task.methods[place].views)[0] for place, recipe in
                 ((1, x_only), (2, y_only))]  # fmt: skip
    np.testing.assert_array_equal(values, np.concatenate(halves_of, axis=1))
    kept = [recipe.learner.fit(own, slides.codes, owner).parameters['components'].shape[1]
            for recipe, own in ((both, values), (x_only, halves_of[0]), (y_only, halves_of[1]))]  # fmt: skip
    assert kept[0] == kept[1] + kept[2]  # the paper: 39 and 39 make 78


def test_every_paper_figure_is_a_share_and_every_table_has_a_row_for_each_surface() -> None:
    for protocol in PROTOCOLS:
        for task in protocol.tasks:
            surfaces = task.surfaces or tuple(load_scene(protocol.scene).surfaces)
            for method in task.methods:
                reported = [method.paper.learning, method.paper.test, method.paper.unclassified]
                assert all(0 <= value <= 1 for value in reported if value is not None)
                if method.confusion is not None:
                    assert len(method.confusion) == len(surfaces)
                    assert {len(row) - len(surfaces) for row in method.confusion} <= {0, 1}


def test_divisions_keep_to_the_papers_split() -> None:
    rng = np.random.default_rng(0)
    assert halves(20)(CODES, CONDITIONS, rng, False).sum(axis=1).tolist() == [30] * 20
    parts = folds(10, 2)(CODES, CONDITIONS, rng, False)
    assert parts.shape == (20, 60)
    assert (~parts[:10]).sum(axis=0).tolist() == [1] * 60  # each slide is held out once a round
    assert drawn(2 / 3, 5)(CODES, CONDITIONS, rng, False).sum(axis=1).tolist() == [40] * 5
    assert (training_in('slow')(CODES, CONDITIONS, rng, False)[0] == (CONDITIONS == 'slow')).all()


def test_a_slide_is_the_same_whatever_else_a_task_holds() -> None:
    protocol = next(protocol for protocol in PROTOCOLS if protocol.name == 'kaboli')
    scene = load_scene(protocol.scene)
    small, _, large = (gather(scene, reduced(task, 2), 0, slow=False) for task in protocol.tasks)
    for slides in (small, large):
        assert len(slides.views) == 2
    own = [slides.views[0].streams['signal'].samples[slides.codes == slides.surfaces.index('apple')]
           for slides in (small, large)]  # fmt: skip
    assert sorted(own[0].std(axis=1).ravel()) == pytest.approx(sorted(own[1].std(axis=1).ravel()))


def test_figures_of_a_known_outcome() -> None:
    decided = CODES.copy()
    decided[:4] = [1, 1, 2, UNDECIDED]
    one = outcome(decided)
    assert one.test.value == pytest.approx(56 / 60)
    assert one.unclassified == pytest.approx(1 / 60)
    assert one.confusion[0].tolist() == pytest.approx([0.8, 0.1, 0.05, 0.05])
    assert one.pairs()[0] == ('cork', 'felt')
    assert one.taken_for('cork', 'felt').sum() == 2


def test_a_claim_holds_only_if_the_interval_says_so() -> None:
    good, bad = outcome(CODES), outcome(np.where(np.arange(60) % 3 == 0, (CODES + 1) % 3, CODES))
    assert higher('', good, bad).holds is True
    assert higher('', bad, good).holds is False
    assert at_least('', bad, 0.9).holds is False
    assert at_least('', good, 0.98).holds is True
    slow_lost = outcome(np.where((CONDITIONS == 'slow') & (CODES == 0), 1, CODES))
    assert lower_in('', slow_lost, 'slow').holds is True
    assert most_errors('', slow_lost, [('cork', 'felt')]).holds is True
    assert most_errors('', slow_lost, [('cork', 'linen')]).holds is False
    assert seldom('', good, ('cork', 'felt'), 0.2).holds is True
    one_lost = outcome(np.where(np.arange(60) == 0, 1, CODES))
    assert higher('', good, one_lost).holds is None


@pytest.mark.parametrize('right', [0.0, 1.0])
def test_a_share_lies_within_its_interval_whatever_rounding_does(right: float) -> None:
    for n in range(1, 500):
        interval = share(np.full(n, right))
        assert interval.low <= interval.value <= interval.high


def test_the_interval_of_a_mean_share_ends_at_0_and_100_percent() -> None:
    assert mean(np.array([0.02, 0.0, 0.22])).low < 0.0
    assert mean_share(np.array([0.02, 0.0, 0.22])).low == 0.0
    assert mean_share(np.array([0.98, 1.0, 0.78])).high == 1.0
    assert mean_share(np.array([0.4, 0.5, 0.6])) == mean(np.array([0.4, 0.5, 0.6]))


def test_intervals_are_those_of_the_textbook() -> None:
    wilson = share(np.r_[np.ones(8), np.zeros(2)])  # 8 of 10: 0.490 to 0.943
    assert (wilson.low, wilson.high) == (pytest.approx(0.490, abs=1e-3), pytest.approx(0.943, abs=1e-3))
    values = np.array([1.0, 2.0, 3.0, 4.0])
    assert mean(values).high - 2.5 == pytest.approx(1.96 * values.std(ddof=1) / 2, rel=1e-3)
    assert apart(values, values).value == 0


def test_a_method_that_cannot_fail_recognises_all_its_training_set() -> None:
    protocol = next(protocol for protocol in PROTOCOLS if protocol.name == 'jamali')
    task = reduced(protocol.tasks[0], 6)
    slides = gather(load_scene(protocol.scene), task, 0, slow=False)
    found = evaluate_method(recipe_of(task.methods[2]), slides, np.ones((1, len(slides.codes)), dtype=bool))
    assert found.learning is not None
    assert found.learning > 0.8
    assert (found.decided != UNDECIDED).all()


@pytest.mark.parametrize('protocol', PROTOCOLS, ids=lambda protocol: protocol.name)
def test_what_has_no_label_of_its_own_is_the_released_recipe_word_for_word(protocol: PaperProtocol) -> None:
    named = [method for task in protocol.tasks for method in task.methods if not method.label]
    for method in named:
        released = load_recipe(method.recipe)
        run = recipe_of(method)
        assert run.feature_set.as_mapping() == released.feature_set.as_mapping()
        assert (run.evidence, run.training) == (released.evidence, released.training)
        assert run.learner == released.learner or method.recipe == 'default'  # whose calibration alone is shorter

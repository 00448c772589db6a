"""Experiments over several seeds: means, intervals and verdicts."""

from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidParameter
from texture_papers import protocol
from texture_papers.protocol import (
    Experiment,
    ExperimentResult,
    Interval,
    _decisive,
    digest_of,
    mean_over_seeds,
    over_seeds,
    verdict,
    with_seeds,
)

RECIPE = 'fast'


def numbers(seed: int, test: float, gain: float) -> dict:
    return {
        'seed': seed,
        'recipes': {RECIPE: digest_of(RECIPE)},
        'tasks': {'task': {'one': {'test': [test, 0.0, 1.0]}}},
        'findings': [{'claim': 'it gains', 'interval': [gain, gain, gain], 'verdict': 'holds', 'reaches': False}],
    }


def result(seed: int, test: float, gain: float) -> ExperimentResult:
    return ExperimentResult('mine', '', '', '', numbers(seed, test, gain))


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


@pytest.mark.parametrize(
    ('interval', 'reaches', 'holds'),
    [
        ((0.1, 0.05, 0.2), False, True),
        ((-0.1, -0.2, -0.05), False, False),
        ((0.0, -0.1, 0.1), False, None),
        ((-0.05, -0.2, 0.01), True, True),
        ((-0.1, -0.2, -0.05), True, False),
    ],
)
def test_a_claim_holds_if_its_interval_lies_above_zero_or_reaches_it(interval, reaches, holds) -> None:
    assert verdict(Interval(*interval), reaches=reaches) is holds


def test_a_seed_that_was_run_with_the_same_recipes_is_not_run_again(tmp_path: Path) -> None:
    seen: list[tuple[int, int, bool]] = []

    def run(experiment: Experiment) -> ExperimentResult:
        seen.append((experiment.seed, experiment.splits, experiment.papers_only))
        return result(experiment.seed, 0.5 + 0.01 * experiment.seed, 0.1)

    first = over_seeds(run, 'mine', Experiment(tmp_path, seed=3), 3)
    assert seen == [(3, 0, False), (4, 2, True), (5, 2, True)]
    assert over_seeds(run, 'mine', Experiment(tmp_path, seed=3), 3).numbers == first.numbers
    assert len(seen) == 3
    assert 'over 3 seeds' in '\n'.join(first.lines)


def test_a_seed_that_was_run_with_other_recipes_is_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    def run(experiment: Experiment) -> ExperimentResult:
        seen.append(experiment.seed)
        return result(experiment.seed, 0.5, 0.1)

    over_seeds(run, 'mine', Experiment(tmp_path), 2)
    monkeypatch.setattr(protocol, 'digest_of', lambda name: 'changed')
    over_seeds(run, 'mine', Experiment(tmp_path), 2)
    assert seen == [0, 1, 0, 1]


def test_a_definition_that_changes_has_another_digest_and_its_description_has_none() -> None:
    assert len({digest_of(name) for name in ('fast', 'default', 'kaboli-pa', 'kaboli-pa-ovr', 'roughness')}) == 5
    assert digest_of('fast') == digest_of('fast')


def test_a_parameter_that_changes_nothing_leaves_the_digest_as_it_was() -> None:
    assert _decisive({'evidence': {'soft_vote': {'late_weight': 1.0}}}) == {'evidence': {'soft_vote': {}}}
    assert _decisive({'evidence': {'soft_vote': {'late_weight': 0.25}}}) != {'evidence': {'soft_vote': {}}}


def test_one_seed_has_no_interval(tmp_path: Path) -> None:
    with pytest.raises(InvalidParameter, match='1 seeds were asked for; two or more are needed'):
        over_seeds(lambda experiment: result(0, 0.5, 0.1), 'mine', Experiment(tmp_path), 1)

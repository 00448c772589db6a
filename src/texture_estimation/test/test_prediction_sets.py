import numpy as np
import pytest

from texture_estimation.decisions import PredictionSets, fit_prediction_sets
from texture_estimation.numerics import log_softmax

EFFECTIVE_WINDOWS = np.array([1.0, 2.0, 4.0])


def slides(rng, count, labels=6):
    truths = rng.integers(labels, size=count)
    scores = rng.normal(size=(count, 3, labels)) + 2.0 * np.eye(labels)[truths][:, None]
    return list(log_softmax(scores * np.sqrt(EFFECTIVE_WINDOWS)[:, None])), truths.tolist(), [EFFECTIVE_WINDOWS] * count


@pytest.mark.parametrize('coverage', [0.8, 0.95])
def test_the_true_texture_is_in_the_set_as_often_as_asked(coverage):
    rng = np.random.default_rng(0)
    prediction_sets = fit_prediction_sets(*slides(rng, 2000), coverage)
    posteriors, truths, _ = slides(rng, 2000)
    found = [
        truth in prediction_sets.members(np.exp(posterior[place]), EFFECTIVE_WINDOWS[place])
        for posterior, truth in zip(posteriors, truths, strict=True)
        for place in range(3)
    ]
    assert np.mean(found) == pytest.approx(coverage, abs=0.02)


@pytest.mark.parametrize(('count', 'coverage', 'needed'), [(9, 0.95, 19), (18, 0.95, 19), (3, 0.8, 4)])
def test_with_too_few_slides_for_the_coverage_there_is_no_set_but_a_reason(count, coverage, needed):
    prediction_sets = fit_prediction_sets(*slides(np.random.default_rng(0), count), coverage)
    assert prediction_sets.members(np.array([0.7, 0.0, 0.3]), 1.0) == []
    assert f'a coverage of {100 * coverage:g} % needs {needed} slides' in prediction_sets.reason


@pytest.mark.parametrize(('count', 'coverage'), [(19, 0.95), (4, 0.8), (9, 0.9)])
def test_with_just_enough_slides_there_are_sets(count, coverage):
    prediction_sets = fit_prediction_sets(*slides(np.random.default_rng(0), count), coverage)
    assert prediction_sets.reason == ''
    assert prediction_sets.members(np.array([0.7, 0.0, 0.3]), 1.0)[0] == 0


def test_the_most_probable_texture_is_always_in_the_set():
    assert PredictionSets(0.9, (1.0,), (0.99,)).members(np.array([0.2, 0.5, 0.3]), 3.0) == [1]

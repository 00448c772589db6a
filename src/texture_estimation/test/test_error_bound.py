import dataclasses

import numpy as np
import pytest
from scipy.stats import binom

from texture_core.types import FeatureVector
from texture_estimation.decisions import ErrorBound
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train

RECIPE = load_recipe('default')
WORD = 'too few slides for early stopping'
ANY_ERROR_RATE = ErrorBound(0, 1.0)  # allows any, so nothing has to be shown


def estimates(model, examples):
    """Return the true surface and the estimates of each slide, window by window and at its end."""
    for slide in np.unique(examples.groups).tolist():
        rows = np.flatnonzero(examples.groups == slide)
        windows = [
            FeatureVector(k * 10**8, slide, 0.5, 0.1, model.names, examples.values[row], feature_set=model.feature_set)
            for k, row in enumerate(rows)
        ]
        evidence = EvidenceAccumulator(model)
        end = FeatureVector(10**9, slide, 0.0, 0.1, last=True)
        yield str(examples.labels[rows[0]]), [evidence.update(vector) for vector in (*windows, end)]


@pytest.mark.parametrize('slides', [1, 12, 149, 600])
def test_a_classifier_that_errs_as_often_as_the_bound_passes_so_many_slides_once_in_twenty(slides):
    error_rate = 1.0 - ErrorBound(slides, 0.02).highest_confidence
    assert binom.pmf(0, slides, error_rate) == pytest.approx(0.05)


@pytest.mark.parametrize(('error_rate', 'needed'), [(0.01, 299), (0.02, 149), (0.05, 59), (0.2, 14), (1.0, 0)])
def test_early_stopping_needs_the_slides_that_show_its_error_rate(error_rate, needed):
    assert ErrorBound(needed, error_rate).shown
    assert ErrorBound(needed, error_rate).reason == ''
    assert not needed or not ErrorBound(needed - 1, error_rate).shown


def test_the_reason_names_the_slides_that_are_needed_and_those_that_were_there():
    assert ErrorBound(12, 0.02).reason == (
        'too few slides for early stopping: at most 2 % wrong decisions need 149 slides or more to be held out of the '
        'training; with 12 the confidence is 0.78 at most'
    )
    assert ErrorBound(0, 0.02).reason.endswith('149 slides or more to be held out of the training')
    assert ErrorBound(600, 0.0).reason == 'no early stopping: at most 0 % wrong decisions cannot be shown'


def test_a_limited_confidence_keeps_the_order_of_the_labels_and_the_sum_of_the_probabilities():
    sure = np.array([0.0001, 0.9989, 0.001])
    limited = ErrorBound(12, 0.02).limited(sure)
    assert limited.max() == pytest.approx(0.05 ** (1 / 12))
    assert limited.sum() == pytest.approx(1.0)
    assert np.argsort(limited).tolist() == np.argsort(sure).tolist()


@pytest.mark.parametrize('bound', [ErrorBound(12, 0.02), ErrorBound(0, 0.02), ANY_ERROR_RATE])
def test_a_confidence_below_what_was_shown_stays(bound):
    unsure = np.array([0.2, 0.5, 0.3])
    assert bound.limited(unsure) is unsure


def test_with_a_single_slide_nothing_but_equal_probabilities_is_shown():
    assert ErrorBound(1, 0.02).limited(np.array([0.9, 0.1])).tolist() == [0.5, 0.5]


def test_no_wrong_label_of_a_model_of_three_slides_a_surface_is_certain_or_confident(make_examples):
    """Its held-out slides are all right, so that the stopping rule alone ends slides at the first windows."""
    model = train(RECIPE, make_examples(slides=3, spread=1.5))
    trusting = dataclasses.replace(model, error_bound=ANY_ERROR_RATE)
    new = make_examples(slides=20, seed=1, spread=1.5)
    wrong = {
        own: [e for surface, course in estimates(own, new) for e in course if e.decided and e.label != surface]
        for own in (model, trusting)
    }
    assert max(estimate.confidence for estimate in wrong[trusting]) > 0.95
    assert wrong[model] == []
    confidences = [estimate.confidence for _, course in estimates(model, new) for estimate in course]
    assert max(confidences) == pytest.approx(0.05 ** (1 / 12))


def test_only_the_final_estimate_says_why_no_slide_of_few_was_certain(make_examples):
    few = train(RECIPE, make_examples(labels=('cork', 'felt')))
    enough = dataclasses.replace(few, error_bound=ErrorBound(149, RECIPE.training.max_error_rate))
    for model, said in ((few, True), (enough, False)):
        courses = [course for _, course in estimates(model, make_examples(seed=1, slides=2, labels=('cork', 'felt')))]
        assert [WORD in course[-1].message for course in courses] == [said] * 4
        assert not any(WORD in estimate.message for course in courses for estimate in course[:-1])
        assert any(estimate.decided for course in courses for estimate in course) is not said

import numpy as np
import pytest

from texture_estimation.incremental.ridge_classifier import MAX_EXAMPLES, RidgeClassifier, spread
from texture_estimation.log_probabilities import log_softmax


def cloud(centre, count=60, seed=0):
    return np.asarray(centre) + np.random.default_rng(seed).normal(size=(count, 4))


def is_tied(rows):
    return np.zeros((len(rows), 2))


@pytest.fixture
def ridge_classifier():
    values = np.concatenate([cloud([0, 0, 0, 0], seed=1), cloud([6, 0, 0, 0], seed=2)])
    return RidgeClassifier(values, np.repeat([0, 1], 60), np.repeat(np.arange(12), 10), trained=is_tied)


def right(ridge_classifier, centre, code):
    return float((ridge_classifier.predictor(cloud(centre, seed=9)).argmax(axis=1) == code).mean())


def test_a_new_texture_is_known_at_once_and_no_other_forgotten(ridge_classifier):
    ridge_classifier.set_examples(2, cloud([0, 6, 0, 0], count=10, seed=3))
    assert right(ridge_classifier, [0, 6, 0, 0], 2) > 0.9
    assert right(ridge_classifier, [0, 0, 0, 0], 0) > 0.9
    assert right(ridge_classifier, [6, 0, 0, 0], 1) > 0.9


def test_the_order_of_examples_does_not_matter_and_undoing_leaves_no_trace(ridge_classifier):
    first, second = cloud([0, 6, 0, 0], 20, 3), cloud([0, 6, 1, 0], 20, 4)
    asked, before = cloud([3, 3, 0, 0]), ridge_classifier.predictor(cloud([3, 3, 0, 0]))
    ridge_classifier.set_examples(2, first)
    ridge_classifier.set_examples(2, np.concatenate([first, second]))
    one = ridge_classifier.predictor(asked)
    ridge_classifier.set_examples(2, np.concatenate([second, first]))
    np.testing.assert_allclose(ridge_classifier.predictor(asked), one, atol=1e-6)
    ridge_classifier.set_examples(2, first[:0])
    np.testing.assert_allclose(ridge_classifier.predictor(asked), before, atol=1e-6)


def test_probabilities_are_neither_sure_of_everything_nor_of_nothing(ridge_classifier):
    scores = ridge_classifier.predictor(np.concatenate([cloud([2.5, 0, 0, 0], 200, 5), cloud([3.5, 0, 0, 0], 200, 6)]))
    odds = np.exp(scores - scores.max(axis=1, keepdims=True))
    confidence = (odds.max(axis=1) / odds.sum(axis=1)).mean()
    assert 0.55 < confidence < 0.99


@pytest.mark.parametrize('count', [1, 2])
def test_very_few_examples_suffice_for_training(count):
    values = np.concatenate([cloud([0, 0, 0, 0], count), cloud([9, 0, 0, 0], count)])
    ridge_classifier = RidgeClassifier(values, np.repeat([0, 1], count), np.repeat([0, 1], count), trained=is_tied)
    ridge_classifier.set_examples(2, cloud([0, 9, 0, 0], 1))
    assert np.isfinite(ridge_classifier.predictor(values)).all()
    assert right(ridge_classifier, [9, 0, 0, 0], 1) > 0.6


def test_what_was_trained_has_half_the_say_among_its_labels_until_one_of_them_is_trained(ridge_classifier):
    asked = cloud([3, 0, 0, 0], 200, 8)
    values = np.concatenate([cloud([0, 0, 0, 0], seed=1), cloud([6, 0, 0, 0], seed=2)])
    labels, slides = np.repeat([0, 1], 60), np.repeat(np.arange(12), 10)
    sure = RidgeClassifier(values, labels, slides, trained=lambda rows: np.tile([0.0, 50.0], (len(rows), 1)))
    for one in (ridge_classifier, sure):
        one.set_examples(2, cloud([3, 6, 0, 0], 20, 3))
    alone, together = log_softmax(ridge_classifier.predictor(asked)), log_softmax(sure.predictor(asked))
    np.testing.assert_allclose(together[:, 2], alone[:, 2], atol=1e-9)
    np.testing.assert_allclose(together[:, 1] - together[:, 0], alone[:, 1] - alone[:, 0] + 25.0, atol=1e-9)
    for one in (ridge_classifier, sure):
        one.set_examples(0, one.examples_of(0))
    np.testing.assert_allclose(
        log_softmax(sure.predictor(asked))[:, 1] - log_softmax(sure.predictor(asked))[:, 0],
        2.0 * (alone[:, 1] - alone[:, 0]),
        atol=1e-6,
    )


def test_constant_and_doubled_features_do_no_harm():
    values = cloud([0, 0, 0, 0], 40)
    values[20:, 0] += 8.0
    values[:, 2], values[:, 3] = 7.0, values[:, 0]
    ridge_classifier = RidgeClassifier(values, np.repeat([0, 1], 20), np.arange(40) // 5, trained=is_tied)
    assert (ridge_classifier.predictor(values).argmax(axis=1) == np.repeat([0, 1], 20)).all()


def test_examples_are_thinned_evenly():
    assert spread(3).tolist() == [0, 1, 2]
    assert len(spread(10 * MAX_EXAMPLES)) == MAX_EXAMPLES
    assert spread(1001, 3).tolist() == [0, 500, 1000]
    assert spread(0).tolist() == []

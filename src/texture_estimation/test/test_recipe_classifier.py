import numpy as np
import pytest
from sklearn.model_selection import StratifiedGroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import check_estimator

from texture_estimation.recipe_classifier import RecipeClassifier

# No check of scikit-learn is left out for this recipe; one that fails later is listed here with its reason.
EXPECTED_FAILURES: dict[str, str] = {}


def test_the_estimator_passes_the_checks_of_scikit_learn() -> None:
    estimator = RecipeClassifier('peaks-naive-bayes')
    try:
        check_estimator(estimator, expected_failed_checks=EXPECTED_FAILURES)
    except TypeError:  # before scikit-learn 1.6 nothing can be expected to fail
        check_estimator(estimator)


def test_the_estimator_takes_part_in_pipelines_and_cross_validation(examples) -> None:
    pipeline = make_pipeline(StandardScaler(), RecipeClassifier('peaks-naive-bayes'))
    scores = cross_val_score(pipeline, examples.X, examples.y, groups=examples.groups, cv=StratifiedGroupKFold(4))
    assert scores.mean() > 0.85


def test_probabilities_add_up_to_one_and_their_order_is_that_of_the_classes(examples) -> None:
    estimator = RecipeClassifier('default').fit(examples.X, examples.y, groups=examples.groups)
    probabilities = estimator.predict_proba(examples.X)
    np.testing.assert_allclose(probabilities.sum(axis=1), 1.0)
    assert estimator.classes_.tolist() == sorted(set(examples.y))
    assert estimator.predict(examples.X).tolist() == estimator.classes_[probabilities.argmax(axis=1)].tolist()
    assert 'held-out slides' in estimator.fitted_.note


def test_groups_of_another_length_are_refused(examples) -> None:
    with pytest.raises(ValueError, match='inconsistent numbers of samples'):
        RecipeClassifier().fit(examples.X, examples.y, groups=examples.groups[:-1])

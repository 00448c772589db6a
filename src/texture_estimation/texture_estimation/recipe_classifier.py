# SPDX-License-Identifier: Apache-2.0
"""A recipe's learner as an estimator of scikit-learn."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_array, check_consistent_length, check_is_fitted, check_X_y

from texture_core.types import AnyArray, Array
from texture_estimation.numerics import softmax
from texture_estimation.recipe import load_recipe


class RecipeClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn carries no types
    """Classify windows by the learner of a recipe, for scikit-learn's pipelines, searches and plots.

    Parameters
    ----------
    recipe
        Name of a shipped recipe, or path of any. Its learner is used; features come as `X`.

    Attributes
    ----------
    classes_ : (n_labels,)
        Labels in the order of the probabilities.
    n_features_in_
        Number of features.

    Examples
    --------
    >>> import numpy as np
    >>> X = np.array([[0.0], [0.1], [0.2], [1.0], [1.1], [1.2]])
    >>> y = np.array(['cork', 'cork', 'cork', 'felt', 'felt', 'felt'])
    >>> RecipeClassifier('kaboli-svm').fit(X, y).predict([[0.05], [1.05]]).tolist()
    ['cork', 'felt']
    """

    def __init__(self, recipe: str = 'default') -> None:
        self.recipe = recipe

    def fit(self, X: Any, y: Any, groups: Any = None) -> RecipeClassifier:
        """Learn from examples.

        Parameters
        ----------
        X : (n, n_features)
            Features of windows; finite.
        y : (n,)
            Label of each window.
        groups : (n,)
            Slide of each window; probabilities are calibrated on held-out slides. None: each window is its own slide.

        Returns
        -------
        RecipeClassifier
            Itself, as scikit-learn wants it.

        Raises
        ------
        ValueError
            If the shapes contradict each other, a value is not finite, or there are fewer than two labels.
        """
        values, labels = check_X_y(X, y, dtype=np.float64)
        check_classification_targets(labels)
        self.classes_, codes = np.unique(labels, return_inverse=True)
        if len(self.classes_) < 2:
            raise ValueError(f'there is 1 class, {self.classes_[0]!r}; at least two classes are needed')
        slides = np.arange(len(labels)) if groups is None else np.unique(groups, return_inverse=True)[1].reshape(-1)
        check_consistent_length(values, slides)
        learner = load_recipe(self.recipe).learner
        self.fitted_ = learner.fit(values, codes.reshape(-1), slides)
        self.n_features_in_ = values.shape[1]
        self.predictor_ = learner.predictor(self.fitted_.parameters)
        return self

    def predict_proba(self, X: Any) -> Array:
        """Return the probability of each label, (n, n_labels), of features (n, n_features).

        Returns
        -------
        (n, n_labels)
            Columns in the order of `classes_`.

        Raises
        ------
        ValueError
            If there are other features than in the training.
        """
        check_is_fitted(self)
        values = check_array(X, dtype=np.float64)
        if values.shape[1] != self.n_features_in_:
            raise ValueError(
                f'X has {values.shape[1]} features, but {type(self).__name__} is expecting '
                f'{self.n_features_in_} features as input'
            )
        return softmax(np.asarray(self.predictor_(values)))

    def predict(self, X: Any) -> AnyArray:
        """Return the most probable label of each row, (n,).

        Returns
        -------
        (n,)
            Elements of `classes_`.
        """
        best: NDArray[np.intp] = self.predict_proba(X).argmax(axis=1)
        labels: AnyArray = self.classes_[best]
        return labels

# SPDX-License-Identifier: Apache-2.0
"""Any classifier of scikit-learn as a learner."""

from __future__ import annotations

import importlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.config import safe_repr, unknown_name
from texture_core.errors import InvalidParameter, ModelMismatch
from texture_core.types import Array
from texture_estimation.learners.learner import Codes, Fitted, assign_folds, standardisation
from texture_estimation.numerics import fit_temperature, log_softmax

# --------------------
# Predict with a fitted estimator of scikit-learn.

FLOOR = 1e-3  # trees give a probability of 0 to what none of their leaves holds


@dataclass(frozen=True, eq=False)
class SklearnPredictor:
    """A fitted classifier behind the interface of all predictors.

    Parameters
    ----------
    estimator
        Fitted with label numbers.
    mean, scale : (n_features,)
        Mean and scale of the features in the training.
    n_labels
        Number of labels, of which the estimator may lack some.
    temperature
        Divisor of the logarithms.
    floor
        Probability that all labels share at least; 0 takes the estimator's own log-probabilities.

    Examples
    --------
    >>> from texture_estimation.learners.sklearn_learner import SklearnLearner
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> learner = SklearnLearner('sklearn.linear_model:LogisticRegression')
    >>> predictor = learner.predictor(learner.fit(values, codes, groups).parameters)
    >>> isinstance(predictor, SklearnPredictor), bool((predictor(values).argmax(axis=1) == codes).all())
    (True, True)
    """

    estimator: Any
    mean: Array
    scale: Array
    n_labels: int
    temperature: float = 1.0
    floor: float = FLOOR

    def __post_init__(self) -> None:
        for tree in _trees(self.estimator, 0):
            _check_tree(tree, len(self.mean))

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities, (..., n_labels) of (..., n_features)."""
        rows = ((X - self.mean) / self.scale).reshape(-1, len(self.mean))
        scores = np.full((len(rows), self.n_labels), np.log(FLOOR / self.n_labels))
        scores[:, self.estimator.classes_] = self._scores(rows)
        result: Array = log_softmax(scores / self.temperature).reshape(*X.shape[:-1], self.n_labels)
        return result

    def _scores(self, rows: Array) -> Array:
        if not self.floor:
            return np.asarray(self.estimator.predict_log_proba(rows), dtype=np.float64)
        if hasattr(self.estimator, 'predict_proba'):
            probabilities = np.asarray(self.estimator.predict_proba(rows), dtype=np.float64)
            scores: Array = np.log((1.0 - self.floor) * probabilities + self.floor / self.n_labels)
            return scores
        decisions = np.asarray(self.estimator.decision_function(rows), dtype=np.float64)
        return np.stack((-decisions, decisions), axis=-1) if decisions.ndim == 1 else decisions


def _trees(value: Any, depth: int) -> Iterator[Any]:
    """Yield the trees in an estimator."""
    if depth > 6:
        return
    if type(value).__name__ == 'Tree':
        yield value
    elif isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        for item in np.ravel(np.array(value, dtype=object)) if isinstance(value, np.ndarray) else value:
            yield from _trees(item, depth + 1)
    elif hasattr(value, '__dict__'):
        for item in vars(value).values():
            yield from _trees(item, depth + 1)


def _check_tree(tree: Any, n_features: int) -> None:
    """Raise ModelMismatch at a tree that points outside its arrays: scikit-learn does not check, and would crash."""
    left, right, feature = tree.children_left, tree.children_right, tree.feature
    index = np.arange(len(left))
    leaf = left == -1
    inside = (left > index) & (right > index) & (left < len(left)) & (right < len(left))
    fits = (feature >= 0) & (feature < n_features)
    if not len(left) or not np.all(np.where(leaf, right == -1, inside & fits)):
        raise ModelMismatch('a tree in it points outside its nodes or features')


# --------------------
# Any classifier of scikit-learn as a learner of a recipe.

FOLDS = 5
DEFAULT = 'sklearn.ensemble:ExtraTreesClassifier'
EXAMPLE = f"'{DEFAULT}'"
PUBLIC_CLASS = re.compile(r'sklearn(\.[a-z][a-z0-9]*(_[a-z0-9]+)*)+:[A-Z]\w*')
PLAIN = (bool, int, float, str, type(None))


@dataclass(frozen=True)
class SklearnLearner:
    """A classifier of scikit-learn on standardised features, its probabilities calibrated on held-out slides.

    The logarithms of its probabilities, or its decision values where it has none, are divided by a temperature that
    makes the labels of held-out slides most probable.

    Source: Guo et al. 2017 for the temperature.

    Parameters
    ----------
    estimator
        Module and class, such as 'sklearn.ensemble:ExtraTreesClassifier'.
    parameters
        Names and values of its parameters; those that are not named keep scikit-learn's defaults, but `random_state`
        is 0.

    Raises
    ------
    InvalidParameter
        If there is no such classifier or parameter.

    Examples
    --------
    In a recipe::

        learner: {sklearn: {estimator: 'sklearn.ensemble:ExtraTreesClassifier', n_estimators: 200}}

    >>> SklearnLearner.from_recipe({'estimator': DEFAULT}, 'learner').as_recipe()['estimator'] == DEFAULT
    True
    """

    estimator: str = DEFAULT
    parameters: tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        self.new_estimator()

    @classmethod
    def from_recipe(cls, values: Mapping[str, Any], where: str) -> SklearnLearner:
        """Build from the section of a recipe: the key `estimator`, and the estimator's own parameters.

        Parameters
        ----------
        values
            The section.
        where
            Where it stands, for the sentence of an error.

        Raises
        ------
        InvalidParameter
            If there is no such classifier or parameter, or a value is no plain one.
        """
        if not isinstance(values, Mapping) or not isinstance(values.get('estimator', DEFAULT), str):
            raise InvalidParameter(f'{where}: came {safe_repr(values)}; name an estimator, such as {EXAMPLE}')
        parameters = {str(name): value for name, value in values.items() if name != 'estimator'}
        try:
            return cls(
                values.get('estimator', DEFAULT),
                tuple((name, _plain(name, value)) for name, value in parameters.items()),
            )
        except InvalidParameter as error:
            raise InvalidParameter(f'{where}: {error}') from error

    def as_recipe(self) -> dict[str, Any]:
        """Return the section of a recipe."""
        parameters = {name: list(value) if isinstance(value, tuple) else value for name, value in self.parameters}
        return {'estimator': self.estimator, **parameters}

    def new_estimator(self) -> Any:
        """Return the estimator, unfitted.

        Raises
        ------
        InvalidParameter
            If there is no such classifier or parameter.
        """
        cls = _classifier(self.estimator)
        try:
            estimator = cls()
        except TypeError as error:
            raise InvalidParameter(
                f"'{self.estimator}' needs other estimators as parameters ({error}); name one that stands alone"
            ) from error
        known = estimator.get_params()
        for name, _ in self.parameters:
            if name not in known:
                raise InvalidParameter(str(unknown_name(name, known, f"parameter of '{self.estimator}'")))
        seed = {'random_state': 0} if 'random_state' in known else {}
        return estimator.set_params(**seed, **dict(self.parameters))

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,).

        Raises
        ------
        InvalidParameter
            If the estimator does not accept its parameters or the values, or holds what no model file may hold.
        """
        from texture_estimation.model_files import check_storable  # noqa: PLC0415  # which imports nothing of learners

        n_labels = int(y.max()) + 1
        parameters = self._fit(X, y, n_labels)
        check_storable(parameters, self.estimator)
        split = assign_folds(y, groups, FOLDS)
        if split is None:
            return Fitted(parameters, None, 'not calibrated, as a label has a single window')
        held_out = np.empty((len(y), n_labels))
        for part in np.unique(split[0]):
            held = split[0] == part
            held_out[held] = self.predictor(self._fit(X[~held], y[~held], n_labels))(X[held])
        temperature = fit_temperature(held_out, y)
        return Fitted(
            {**parameters, 'temperature': temperature},
            log_softmax(held_out / temperature),
            f'temperature from {split[1]}',
        )

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> SklearnPredictor:
        """Return the predictor made from the stored parameters."""
        return SklearnPredictor(**parameters)

    def _fit(self, X: Array, y: Codes, n_labels: int) -> dict[str, Any]:
        mean, scale = standardisation(X)
        try:
            estimator = self.new_estimator().fit((X - mean) / scale, y)
        except (ValueError, TypeError) as error:
            raise InvalidParameter(f"'{self.estimator}' cannot be trained: {error}") from error
        return {'estimator': estimator, 'mean': mean, 'scale': scale, 'n_labels': n_labels, 'temperature': 1.0}


def _classifier(name: str) -> Any:
    """Return a public class of scikit-learn that classifies."""
    from sklearn.base import BaseEstimator, is_classifier  # noqa: PLC0415  # takes a second to import

    if not PUBLIC_CLASS.fullmatch(name):
        raise InvalidParameter(
            f'estimator is {safe_repr(name)}; a public class of scikit-learn such as {EXAMPLE} is needed'
        )
    module, cls_name = name.split(':')
    try:
        cls = getattr(importlib.import_module(module), cls_name)
    except (ImportError, AttributeError) as error:
        raise InvalidParameter(
            f"there is no '{cls_name}' in '{module}'; name a classifier such as {EXAMPLE}"
        ) from error
    if not (isinstance(cls, type) and issubclass(cls, BaseEstimator) and _classifies(cls, is_classifier)):
        raise InvalidParameter(f"'{name}' is no classifier; name one such as {EXAMPLE}")
    return cls


def _classifies(cls: Any, is_classifier: Any) -> bool:
    try:
        return bool(is_classifier(cls()))
    except TypeError:  # it needs other estimators; what asks for it says so
        return hasattr(cls, 'predict')


def _plain(name: str, value: Any) -> Any:
    if isinstance(value, list | tuple) and all(isinstance(item, PLAIN) for item in value):
        return tuple(value)
    if isinstance(value, PLAIN):
        return value
    raise InvalidParameter(
        f'{name} is {safe_repr(value)}; a number, a text, true, false, null or a list of them is needed'
    )

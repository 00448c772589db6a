"""Any classifier of scikit-learn as a learner of a recipe."""

from __future__ import annotations

import importlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidParameter
from texture_core.plain_data import safe_repr
from texture_estimation.learners.folds import assign_folds
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.learners.sklearn_predictor import SklearnPredictor
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.log_probabilities import log_loss, log_softmax

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
        temperature = _fit_temperature(held_out, y)
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


def _fit_temperature(scores: Array, y: Codes) -> float:
    """Return the divisor of scores (n, n_labels) that makes the labels (n,) most probable."""
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  # takes 0.3 s, and only training needs it

    best = minimize_scalar(
        lambda log_t: log_loss(log_softmax(scores / np.exp(log_t)), y), bounds=(-2.0, 4.0), method='bounded'
    )
    return float(np.exp(best.x))

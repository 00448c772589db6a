# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Any classifier of scikit-learn as a learner."""

from __future__ import annotations

import importlib
import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from texture_core.config import MB, Archive, FileRefused, library, safe_repr, unknown_name
from texture_core.errors import InvalidParameter, ModelMismatch
from texture_core.types import Array
from texture_estimation.learners.learner import (
    UNCALIBRATED,
    Codes,
    Fitted,
    assign_folds,
    fit_temperature,
    log_softmax,
    standardisation,
)

# --------------------
# Estimators of scikit-learn as bytes in a model file, by skops: read without running code.

SKOPS = ('skops.io', 'learners of scikit-learn', 'models')
MAX_PACKED_BYTES = 300 * MB  # to which the bytes may unpack
# What an estimator holds next to estimators, arrays and plain values. Trees are checked before they are used.
PARTS = (
    'sklearn.calibration._CalibratedClassifier',
    'sklearn.neural_network._stochastic_optimizers.AdamOptimizer',
    'sklearn.neural_network._stochastic_optimizers.SGDOptimizer',
    'sklearn.tree._tree.Tree',
)


def packed(estimator: Any, name: str) -> NDArray[np.uint8]:
    """Return an estimator as bytes, (n,), for a model file."""
    content = library(*SKOPS).dumps(estimator)
    try:
        _checked_types(content)
    except (FileRefused, ModelMismatch) as error:
        raise InvalidParameter(
            f"'{name}' cannot be stored as a model: {error}; use another estimator or other parameters "
            '(neighbours with algorithm: brute, fewer trees)'
        ) from error
    return np.frombuffer(content, np.uint8)


def unpacked(content: NDArray[np.uint8]) -> Any:
    """Return what `packed` was given; nothing is built of types that no estimator holds, and no code is run."""
    return library(*SKOPS).loads(content.tobytes(), trusted=_checked_types(content.tobytes()))


def _checked_types(content: bytes) -> list[str]:
    """Return the types that skops is to trust; raise FileRefused or ModelMismatch at others, and at too many bytes."""
    with Archive(io.BytesIO(content), MAX_PACKED_BYTES):
        types: list[str] = library(*SKOPS).get_untrusted_types(data=content)
    if unexpected := [name for name in types if name not in PARTS and not _is_estimator(name)]:
        raise ModelMismatch(f'it holds {", ".join(unexpected)}, which no model of this suite holds')
    return types


def _is_estimator(name: str) -> bool:
    """Return whether a name is that of an estimator of scikit-learn; private ones are parts of public ones."""
    module, _, cls_name = name.rpartition('.')
    if not module.startswith('sklearn.'):
        return False
    from sklearn.base import BaseEstimator  # noqa: PLC0415  # takes a second

    cls = getattr(importlib.import_module(module), cls_name, None)
    return isinstance(cls, type) and issubclass(cls, BaseEstimator)


# --------------------
# Predict with a fitted estimator of scikit-learn.

FLOOR = 1e-3  # trees give a probability of 0 to what none of their leaves holds


@dataclass(frozen=True, eq=False)
class SklearnPredictor:
    """A fitted classifier behind the interface of all predictors."""

    estimator: Any
    mean: Array
    scale: Array
    n_labels: int
    temperature: float = 1.0

    def __post_init__(self) -> None:
        for tree in _trees(self.estimator, 0):
            _check_tree(tree, len(self.mean))

    def __call__(self, X: Array) -> Array:
        """Return log-probabilities, (..., n_labels) of (..., n_features)."""
        rows = ((X - self.mean) / self.scale).reshape(-1, len(self.mean))
        scores = np.full((len(rows), self.n_labels), np.log(FLOOR / self.n_labels))
        if hasattr(self.estimator, 'predict_proba'):
            probabilities = np.asarray(self.estimator.predict_proba(rows), dtype=np.float64)
            found = np.log((1.0 - FLOOR) * probabilities + FLOOR / self.n_labels)
        else:
            decisions = np.asarray(self.estimator.decision_function(rows), dtype=np.float64)
            found = np.stack((-decisions, decisions), axis=-1) if decisions.ndim == 1 else decisions
        scores[:, self.estimator.classes_] = found
        return log_softmax(scores / self.temperature).reshape(*X.shape[:-1], self.n_labels)


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

    extras: ClassVar[tuple[str, ...]] = ('parts',)

    estimator: str = DEFAULT
    parameters: tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        self.new_estimator()

    @classmethod
    def from_recipe(cls, values: Mapping[str, Any], where: str) -> SklearnLearner:
        """Build from the section of a recipe: the key `estimator`, and the parameters of the estimator.

        Parameters
        ----------
        values
            The section.
        where
            Where it is listed, for the error message.

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
        from sklearn.base import BaseEstimator, is_classifier  # noqa: PLC0415  # takes a second to import

        cls = _public_class(self.estimator)
        try:
            estimator = cls()
        except TypeError as error:
            raise InvalidParameter(
                f"'{self.estimator}' needs other estimators as parameters ({error}); name one that works alone"
            ) from error
        if not (isinstance(estimator, BaseEstimator) and is_classifier(estimator)):
            raise InvalidParameter(f"'{self.estimator}' is not a classifier; name one such as {EXAMPLE}")
        known = estimator.get_params()
        for name, _ in self.parameters:
            if name not in known:
                raise InvalidParameter(str(unknown_name(name, known, f"parameter of '{self.estimator}'")))
        seed = {'random_state': 0} if 'random_state' in known else {}
        return estimator.set_params(**{**seed, **dict(self.parameters)})

    def fit(self, X: Array, y: Codes, groups: Codes, parts: Codes | None = None) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,).

        Raises
        ------
        InvalidParameter
            If the estimator does not accept its parameters or the values, or holds what no model file may hold.
        """
        n_labels = int(y.max()) + 1
        fitted = self._fit(X, y, n_labels)
        parameters = {'packed': packed(fitted.estimator, self.estimator), 'mean': fitted.mean, 'scale': fitted.scale}
        split = assign_folds(y, groups, FOLDS, parts)
        if split is None:
            return Fitted({**parameters, 'n_labels': n_labels, 'temperature': 1.0}, None, UNCALIBRATED)
        held_out = np.empty((len(X), n_labels))
        for part in np.unique(split[0]):
            held = split[0] == part
            held_out[held] = self._fit(X[~held], y[~held], n_labels)(X[held])
        temperature = fit_temperature(held_out, y)
        return Fitted(
            {**parameters, 'n_labels': n_labels, 'temperature': temperature},
            log_softmax(held_out / temperature),
            f'temperature from {split[1]}',
            temperature=temperature,
        )

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> SklearnPredictor:
        """Return the predictor made from the stored parameters."""
        values = dict(parameters)
        return SklearnPredictor(unpacked(values.pop('packed')), **values)

    def _fit(self, X: Array, y: Codes, n_labels: int) -> SklearnPredictor:
        mean, scale = standardisation(X)
        try:
            estimator = self.new_estimator().fit((X - mean) / scale, y)
        except (ValueError, TypeError) as error:
            raise InvalidParameter(f"'{self.estimator}' cannot be trained: {error}") from error
        return SklearnPredictor(estimator, mean, scale, n_labels)


def _public_class(name: str) -> Any:
    if not PUBLIC_CLASS.fullmatch(name):
        raise InvalidParameter(
            f'estimator is {safe_repr(name)}; a public class of scikit-learn such as {EXAMPLE} is needed; '
            "a custom one is a Learner on PYTHONPATH, 'learner: {module:Class: {}}' (docs/extending.md)"
        )
    module, cls_name = name.split(':')
    try:
        return getattr(importlib.import_module(module), cls_name)
    except (ImportError, AttributeError) as error:
        raise InvalidParameter(
            f"there is no '{cls_name}' in '{module}'; name a classifier such as {EXAMPLE}"
        ) from error


def _plain(name: str, value: Any) -> Any:
    if isinstance(value, list | tuple) and all(isinstance(item, PLAIN) for item in value):
        return tuple(value)
    if isinstance(value, PLAIN):
        return value
    raise InvalidParameter(
        f'{name} is {safe_repr(value)}; a number, a text, true, false, null or a list of them is needed'
    )

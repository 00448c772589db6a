# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The interface of learners, and their common folds, standardisation and log-probabilities."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from texture_core.errors import InvalidData, counted
from texture_core.types import Array
from texture_features.feature_set import LabelledFeatures

# --------------------
# What a learner is: parameters that fit examples, and the predictor that it exports.

Codes = NDArray[np.intp]


# From features (..., n_features) to log-probabilities up to a constant of the window, (..., n_labels), as plain arrays.
# One with a hidden layer also has a method `activations`, which gives its outputs (..., n_hidden).
Predictor = Callable[[Array], Array]


def hidden_layer(predictor: Predictor) -> Callable[[Array], Array] | None:
    """Return what computes the outputs of the hidden layer of a predictor; None if it has none."""
    return getattr(predictor, 'activations', None)


def trust(predictor: Predictor, X: Array) -> Array | float:
    """Return how much each window counts in its slide, (...) of (..., n_features), above 0; 1 for all if not declared.

    A predictor that was trained under some conditions has a method of this name.
    """
    of: Callable[[Array], Array] | None = getattr(predictor, 'trust', None)
    return of(X) if of else 1.0


@dataclass(frozen=True, eq=False)
class Fitted:
    """Fitted parameters of a learner.

    Parameters
    ----------
    parameters
        What the model file stores: scikit-learn objects, arrays, numbers and texts.
    held_out : (n, n_labels) or None
        Log-probabilities of each example by a learner that has not seen its slide; None if there are too few examples.
    note
        How the probabilities were calibrated, in words for the model's card.
    folds
        Of each part of the slides their numbers, and the parameters fitted without them, calibrated like the final
        ones; () if the learner does not declare it.
    trusted : (n,) or None
        How much each example counts in its slide, by the learner that has not seen it; all the same if None.
    temperature
        By which scores were divided to be calibrated.

    Examples
    --------
    >>> fitted = Fitted({'mean': 0.0}, held_out=None, note='not calibrated')
    >>> fitted.folds
    ()
    """

    parameters: Mapping[str, Any]
    held_out: Array | None
    note: str
    folds: Sequence[tuple[Codes, Mapping[str, Any]]] = ()
    trusted: Array | None = None
    temperature: float = 1.0


class Learner(Protocol):
    """Frozen parameters of a learner.

    `fit` may take more keyword arguments than here; a learner names them in a class variable `extras`.
    """

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Predictor:
        """Return the predictor made from the stored parameters."""


def of_examples(learner: Learner, names: Sequence[str], labels: Sequence[str]) -> Learner:
    """Return the learner as it is, or for examples with these features and textures if its parameters name them.

    A learner whose parameters do has a method of this name, as `TunedPairs` has.
    """
    bind: Callable[[Sequence[str], Sequence[str]], Learner] | None = getattr(learner, 'of_examples', None)
    return bind(names, labels) if bind else learner


UNBOUND = -1


def column_of(names: Sequence[str], feature: str) -> int:
    """Return the number of the first value of a feature in any input; UNBOUND if there is none."""
    return next((number for number, name in enumerate(names) if name.rsplit('/', 1)[-1] == feature), UNBOUND)


def extras_of(learner: Learner | type[Learner]) -> tuple[str, ...]:
    """Return the names of the keyword arguments that `fit` of a learner takes in addition to the examples.

    A learner declares them in its class variable `extras`: 'augmented' for copies of the slides to draw from,
    'parts' for the sessions, places or fingers whose slides are held out together. Most learners take none.
    """
    return getattr(learner, 'extras', ())


# --------------------
# Divide examples for cross-validation so that no slide is in training and test.


def assign_folds(y: Codes, groups: Codes, count: int, parts: Codes | None = None) -> tuple[Codes, str] | None:
    """Return the part (0 to count - 1) in which each example is held out, and how they were divided.

    The slides of each label, in the order in which they come, are cut into `count` stretches: sensors and surfaces
    drift, and a neighbour in time would flatter. A label with a single slide is divided by its windows instead, which
    does flatter. None if a label has a single window.

    Parameters
    ----------
    y, groups : (n,)
        Number of the label and of the slide of each example.
    count
        Number of parts, at least 2.
    parts : (n_groups,) or None
        Part of the slide of each number, where it is known which ones belong together; then nothing else counts.

    Returns
    -------
    ((n,), str), or None
        Part of each example, and the division in words.
    """
    if parts is not None:
        return parts[groups], f'sessions held out in turn, {len(np.unique(parts))} parts'
    folds_of = np.empty(len(y), dtype=np.intp)
    note = f'held-out slides, {count} parts'
    for code in np.unique(y):
        rows = np.flatnonzero(y == code)
        order = {group: place for place, group in enumerate(dict.fromkeys(groups[rows].tolist()))}
        slides = np.array([order[group] for group in groups[rows].tolist()])
        if len(order) < 2:
            note = 'held-out windows, as a label has a single slide: too confident'
            slides = np.arange(len(rows))
        if len(rows) < 2:
            return None
        folds_of[rows] = slides * count // (slides.max() + 1)
    return folds_of, note


UNCALIBRATED = 'not calibrated, as a label has a single window'  # so nothing can be held out


def fit_in_folds(
    fit: Callable[[NDArray[np.bool_]], dict[str, Any]],
    predictor: Callable[[Mapping[str, Any]], Predictor],
    X: Array,
    y: Codes,
    groups: Codes,
    *,
    folds: int,
    parts: Codes | None,
    tempered: Sequence[str],
    most: float = 4.0,
) -> Fitted:
    """Fit to all examples and without each part of them, all with the temperature that suits what was held out."""
    split, nothing = assign_folds(y, groups, folds, parts), np.zeros(len(y), dtype=bool)
    if split is None:
        return Fitted(fit(nothing), None, UNCALIBRATED)
    folds_of, note = split
    scores, trusted = np.empty((len(y), int(y.max()) + 1)), None
    fits = []
    for part in np.unique(folds_of):
        held = folds_of == part
        fits.append((np.unique(groups[held]), fit(held)))
        fitted = predictor(fits[-1][1])
        scores[held] = fitted(X[held])
        if hasattr(fitted, 'trust'):
            trusted = np.ones(len(y)) if trusted is None else trusted
            trusted[held] = trust(fitted, X[held])
    temperature = fit_temperature(scores, y, trusted, most)

    def calibrated(parameters: Mapping[str, Any]) -> dict[str, Any]:
        return {**parameters, **{name: parameters[name] / temperature for name in tempered if name in parameters}}

    for rows in chunks(*scores.shape):
        scores[rows] = log_softmax(scores[rows] / temperature)
    fits = [(held_out, calibrated(parameters)) for held_out, parameters in fits]
    return Fitted(calibrated(fit(nothing)), scores, note, fits, trusted, temperature)


# --------------------
# Bring features to zero mean and unit variance, as plain arrays.

# A deviation below this fraction of the largest value is rounding: the feature is constant.
ROUNDING = 1e-13


def standardisation(values: Array) -> tuple[Array, Array]:
    """Return mean and scale of each feature, (n_features,), of examples (n, n_features).

    The scale is the standard deviation; 1 for a constant feature, which then is 0 for every example.
    """
    mean = values.mean(axis=0)
    deviation = values.std(axis=0)
    constant = deviation <= ROUNDING * np.abs(values).max(axis=0)
    return mean, np.where(constant, 1.0, deviation)


# --------------------
# Features that describe how a window was recorded, and not the surface.

FORCE = 'force'  # ends the name of the feature
NOT_COMPARED = (FORCE,)


def check_finite(examples: LabelledFeatures) -> None:
    """Raise InvalidData if a feature of the examples is not finite, with what the slides lack, if that is why."""
    finite = np.isfinite(examples.values)
    bad, windows = ~finite.all(axis=0), ~finite.all(axis=1)
    if not bad.any():
        return
    name = examples.names[int(bad.argmax())]
    needed, quantity = (FORCE, 'force_n') if name.endswith((f'/{FORCE}', '/friction')) else ('speed', 'speed_m_s')
    slides = np.unique(examples.groups[windows]).tolist()
    if all(np.isnan(getattr(examples.conditions.get(slide), quantity, 0.0)) for slide in slides):
        raise InvalidData(
            f"{len(slides)} of {len(np.unique(examples.groups))} slides came without {needed}, which feature '{name}' "
            f'needs; record or import them with it (`conditions: {needed}` in a mapping), or take another recipe'
        )
    raise InvalidData(
        f'{windows.sum()} of {len(examples.labels)} windows have no finite value of '
        f"{counted(int(bad.sum()), 'feature')}, the first '{name}'; leave these features out of the recipe, or these "
        'windows out of the examples'
    )


# --------------------
# Means of the rows that belong together, such as the windows of a slide or the slides of a texture.


def group_means(values: Array, groups: NDArray[np.intp]) -> Array:
    """Return the mean of the rows of each group, (n_groups, n_features)."""
    counts = np.bincount(groups)
    means = np.zeros((len(counts), values.shape[1]))
    np.add.at(means, groups, values)
    means /= counts[:, None]
    return means


def shrunk_covariance(covariance: Array, shrinkage: float) -> Array:
    """Return a covariance drawn to its diagonal, (n_features, n_features).

    Source: Friedman 1989, "Regularized discriminant analysis".
    """
    shrunk: Array = (1.0 - shrinkage) * covariance
    np.fill_diagonal(shrunk, np.diag(covariance))
    return shrunk


# --------------------
# Logarithms of probabilities, the textures along the last axis.

CHUNK = 1 << 21  # numbers, 16 MiB


def chunks(n_rows: int, n_columns: int) -> Iterator[slice]:
    """Yield slices of rows that hold at most CHUNK numbers together, so that intermediate results stay small."""
    size = max(1, CHUNK // max(1, n_columns))
    for start in range(0, n_rows, size):
        yield slice(start, min(start + size, n_rows))


def log_softmax(scores: Array) -> Array:
    """Return scores less the logarithm of the sum of their exponentials, (..., n_labels)."""
    shifted = scores - np.maximum.reduce(scores, axis=-1, keepdims=True)
    return shifted - np.log(np.add.reduce(np.exp(shifted), axis=-1, keepdims=True))


def is_tied(log_probabilities: Array) -> NDArray[np.bool_]:
    """Return whether several textures share the highest log-probability to the last bit, (...): nothing is decided."""
    best = np.maximum.reduce(log_probabilities, axis=-1, keepdims=True)
    return np.count_nonzero(log_probabilities == best, axis=-1) > 1


def log_loss(log_probabilities: Array, codes: NDArray[np.intp]) -> float:
    """Return the mean negative log-probability of the true textures; (n, n_labels) and (n,) of their numbers."""
    return float(-np.take_along_axis(log_probabilities, codes[:, None], axis=-1).mean())


def fit_temperature(scores: Array, codes: NDArray[np.intp], trusted: Array | None = None, most: float = 4.0) -> float:
    """Return the temperature that makes the true textures most probable by log_softmax(scores / temperature).

    Source: Guo et al. 2017, "On calibration of modern neural networks".
    """
    from scipy.optimize import minimize_scalar  # noqa: PLC0415  # takes 0.3 s, and only training needs it

    parts = list(chunks(*scores.shape))
    weights = [rows.stop - rows.start for rows in parts]

    def loss(logarithm: float) -> float:
        losses = []
        for rows in parts:
            log_probabilities = log_softmax(scores[rows] / np.exp(logarithm))
            counted = log_probabilities if trusted is None else trusted[rows, None] * log_probabilities
            losses.append(log_loss(counted, codes[rows]))
        return float(np.average(losses, weights=weights))

    return float(np.exp(minimize_scalar(loss, bounds=(-2.0, most), method='bounded').x))

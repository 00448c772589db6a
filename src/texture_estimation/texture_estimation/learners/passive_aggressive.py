"""Passive-aggressive online learning, of one plane against all others or of all planes together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.catalogue import find
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.log_probabilities import log_softmax


@dataclass(frozen=True)
class PassiveAggressive:
    """A plane for each label, moved by each example that is not at a distance from where it would be mistaken.

    The examples are taken in rounds: the first of each label, then the second of each, and so on. Their order matters.

    Source: Crammer et al. 2006, PA-I: section 4 (one label against the others), section 8 (all labels together);
    Kaboli et al. 2015, section V.B.

    Examples
    --------
    >>> import numpy as np
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> fitted = PassiveAggressive().fit(values, codes, groups)
    >>> predictor = PassiveAggressive.predictor(fitted.parameters)
    >>> isinstance(predictor, LinearPredictor), bool((predictor(values).argmax(axis=1) == codes).all())
    (True, True)
    """

    c: float = param(1.0, 'Aggressiveness: largest update of a hyperplane by one example.', low=1e-9, high=1e9)
    multiclass: str = param(
        'one_vs_rest',
        "Sets how planes of several labels learn: 'one_vs_rest' moves the plane of each label by itself, "
        "'crammer_singer' moves those of the true label and of its strongest rival alone.",
        choices=('one_vs_rest', 'crammer_singer'),
    )
    rounds: int = param(0, 'Sets the number of examples of each label to train on; 0 takes all.', low=0)

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features) and label numbers `y` 0… (n,) in the order given."""
        order = _in_rounds(y, self.rounds)
        # Only what was seen may be known: the scale, too, is that of the training examples.
        mean, scale = standardisation(X[order])
        classifier = find(UPDATES, self.multiclass, 'multi-class form of passive-aggressive learning')
        online = classifier(np.zeros((int(y.max()) + 1, X.shape[1] + 1)), self.c)
        for row in order:
            online.update((X[row] - mean) / scale, int(y[row]))
        return Fitted(
            {'mean': mean, 'scale': scale, 'planes': online.planes}, None, 'not calibrated: distances from the planes'
        )

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> LinearPredictor:
        """Return the predictor made from the stored parameters."""
        return LinearPredictor(**parameters)


@dataclass
class OnlineLinearClassifier:
    """Planes that learn example by example.

    Parameters
    ----------
    planes : (n_labels, n_features + 1)
        Weights, and the bias last.
    c
        How far one example may move a plane.

    Examples
    --------
    >>> online = OnlineLinearClassifier(np.zeros((2, 2)))
    >>> online.update(np.array([1.0]), code=0)
    >>> online.planes.tolist()  # both planes are now at a distance of 1 from it
    [[0.5, 0.5], [-0.5, -0.5]]
    """

    planes: Array
    c: float = 1.0

    def update(self, standard: Array, code: int) -> None:
        """Learn from one example, (n_features,), of label number `code`.

        Parameters
        ----------
        standard : (n_features,)
            Standardised features.
        code
            Number of the true label.
        """
        extended = np.append(standard, 1.0)
        side = np.full(len(self.planes), -1.0)
        side[code] = 1.0
        loss = np.maximum(0.0, 1.0 - side * (self.planes @ extended))
        step = np.minimum(self.c, loss / (extended @ extended))
        self.planes += (step * side)[:, None] * extended


@dataclass
class CrammerSingerClassifier:
    """Planes that learn together: the true label is to score higher by 1 than every other.

    Parameters
    ----------
    planes : (n_labels, n_features + 1)
        Weights, and the bias last.
    c
        How far one example may move a plane.

    Examples
    --------
    >>> online = CrammerSingerClassifier(np.zeros((2, 2)))
    >>> online.update(np.array([1.0]), code=0)
    >>> (online.planes @ [1.0, 1.0]).tolist()  # the true label scores higher by 1
    [0.5, -0.5]
    """

    planes: Array
    c: float = 1.0

    def update(self, standard: Array, code: int) -> None:
        """Learn from one example, (n_features,), of label number `code`.

        Of all planes for which the true label scores higher by 1 than the rival that scored highest, the nearest are
        taken: tau = min(c, loss / (2 |x|²)) is added to the one and subtracted from the other, times x.

        Source: Crammer et al. 2006, section 8.

        Parameters
        ----------
        standard : (n_features,)
            Standardised features.
        code
            Number of the true label.
        """
        if len(self.planes) < 2:
            return
        extended = np.append(standard, 1.0)
        scores = self.planes @ extended
        rivals = scores.copy()
        rivals[code] = -np.inf
        rival = int(rivals.argmax())
        loss = max(0.0, 1.0 - float(scores[code] - scores[rival]))
        step = min(self.c, loss / (2.0 * float(extended @ extended))) * extended
        self.planes[code] += step
        self.planes[rival] -= step


UPDATES: Mapping[str, type[OnlineLinearClassifier] | type[CrammerSingerClassifier]] = {
    'one_vs_rest': OnlineLinearClassifier,
    'crammer_singer': CrammerSingerClassifier,
}


@dataclass(frozen=True, eq=False)
class LinearPredictor:
    """Signed distances from planes.

    Parameters
    ----------
    mean, scale : (n_features,)
        Of the standardisation.
    planes : (n_labels, n_features + 1)
        Weights, and the bias last.
    """

    mean: Array
    scale: Array
    planes: Array

    def __post_init__(self) -> None:
        weights = self.planes[:, :-1] / self.scale
        object.__setattr__(self, '_weights', weights.T.copy())
        object.__setattr__(self, '_bias', self.planes[:, -1].copy())

    def __call__(self, X: Array) -> Array:
        """Return log softmax of the distances, (..., n_labels) of (..., n_features)."""
        scores: Array = (X - self.mean) @ self._weights + self._bias  # type: ignore[attr-defined]
        return log_softmax(scores)


def _in_rounds(y: Codes, rounds: int) -> Codes:
    """Return the rows in rounds: the first example of each label, then the second of each, and so on."""
    number = np.empty(len(y), dtype=np.intp)
    for code in np.unique(y):
        rows = np.flatnonzero(y == code)
        number[rows] = np.arange(len(rows))
    order = np.argsort(number, kind='stable')
    return order[number[order] < rounds] if rounds else order

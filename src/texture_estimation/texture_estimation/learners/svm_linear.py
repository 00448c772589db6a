"""Linear support vector machine, one against one, its penalty chosen by repeated cross-validation."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_estimation.learners.learner import Codes, Fitted
from texture_estimation.learners.pair_votes import PairVotes
from texture_estimation.learners.standardisation import standardisation
from texture_estimation.log_probabilities import log_softmax

ITERATIONS = 100_000  # of libsvm: a pair that cannot be separated need not be fitted to the last digit


@dataclass(frozen=True)
class SvmLinear:
    """Linear machines for all pairs; most pairs won, ties broken by the clearer decisions.

    The penalty C with the best mean accuracy over `repeats` random splits into `folds` parts is taken, the smallest
    of those that tie. No slide is on both sides of a split.

    Source: Kaboli et al. 2015, section V.A: 5 folds, 10 repeats, 20 values.

    Examples
    --------
    >>> import numpy as np
    >>> codes, groups = np.repeat([0, 1], 20), np.repeat(np.arange(8), 5)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 3))
    >>> fitted = SvmLinear(repeats=1).fit(values, codes, groups)
    >>> predictor = SvmLinear.predictor(fitted.parameters)
    >>> isinstance(predictor, LinearPairsPredictor), bool((predictor(values).argmax(axis=1) == codes).all())
    (True, True)
    """

    folds: int = param(5, 'Sets the number of cross-validation folds; more folds take longer to train.', low=2, high=50)
    repeats: int = param(
        10,
        'Sets the number of repetitions of the cross-validation with other random folds; more take longer to train.',
        low=1,
        high=1000,
    )
    candidates: int = param(
        20, 'Number of values of C that are tried, evenly spaced on a logarithmic scale.', low=1, high=200
    )
    least_c: float = param(1e-3, 'Smallest value of C that is tried.', low=1e-9, high=1e9)
    most_c: float = param(1e3, 'Largest value of C that is tried.', low=1e-9, high=1e9)
    examples: int = param(200, 'Largest number of examples with which C is chosen; more are subsampled evenly.', low=10)
    seed: int = param(0, 'Sets the seed of the random folds; equal seeds give equal models.', low=0)

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        mean, scale = standardisation(X)
        standard = (X - mean) / scale
        c = self._choose(standard, y, groups)
        weights, intercepts = _planes(_svc(standard, y, c))
        parameters = {'mean': mean, 'scale': scale, 'weights': weights, 'intercepts': intercepts}
        note = f'not calibrated: pairs won; C = {c:.3g} by {self.repeats} times {self.folds}-fold cross-validation'
        return Fitted(parameters, None, note)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> LinearPairsPredictor:
        """Return the predictor made from the stored parameters."""
        return LinearPairsPredictor(**parameters)

    def _choose(self, standard: Array, y: Codes, groups: Codes) -> float:
        """Return the penalty that does best on what is held out; the middle one if nothing can be."""
        tried = np.geomspace(self.least_c, self.most_c, self.candidates)
        rows = _evenly(y, self.examples)
        rng = np.random.default_rng(self.seed)
        assignments = [_divide(y[rows], groups[rows], self.folds, rng) for _ in range(self.repeats)]
        splits = [split for folds_of in assignments for split in _splits(rows, folds_of, y)]
        if not splits:
            return float(tried[len(tried) // 2])
        right = [
            sum(int((_svc(standard[a], y[a], c).predict(standard[b]) == y[b]).sum()) for a, b in splits) for c in tried
        ]
        return float(tried[int(np.argmax(right))])


@dataclass(frozen=True, eq=False)
class LinearPairsPredictor:
    """Linear decisions between all pairs.

    Parameters
    ----------
    mean, scale : (n_features,)
        Of the standardisation.
    weights : (n_pairs, n_features)
    intercepts : (n_pairs,)
    """

    mean: Array
    scale: Array
    weights: Array
    intercepts: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, '_weights', (self.weights / self.scale).T.copy())
        n_pairs = len(self.intercepts)
        object.__setattr__(self, '_votes', PairVotes.of_pairs(n_pairs))

    def __call__(self, X: Array) -> Array:
        """Return log softmax of the pairs won, (..., n_labels) of (..., n_features)."""
        return log_softmax(self._votes.won_clearly(self.decisions(X)))  # type: ignore[attr-defined]

    def decisions(self, X: Array) -> Array:
        """Return the decision value of each pair, (..., n_pairs); positive for its first label.

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (..., n_pairs)
            Pairs in the order (0, 1), (0, 2), …, (1, 2), ….
        """
        decisions: Array = (X - self.mean) @ self._weights + self.intercepts  # type: ignore[attr-defined]
        return decisions


def _svc(standard: Array, y: Codes, c: float) -> Any:
    from sklearn.exceptions import ConvergenceWarning  # noqa: PLC0415  # scikit-learn takes a second to import
    from sklearn.svm import SVC  # noqa: PLC0415

    with warnings.catch_warnings():
        warnings.simplefilter('ignore', ConvergenceWarning)  # the limit of iterations is meant
        return SVC(C=c, kernel='linear', max_iter=ITERATIONS).fit(standard, y)


def _planes(svc: Any) -> tuple[Array, Array]:
    """Return weights and intercept of each pair; scikit-learn turns the sign round for two labels."""
    sign = -1.0 if len(svc.n_support_) == 2 else 1.0
    return sign * np.asarray(svc.coef_), sign * np.asarray(svc.intercept_)


def _evenly(y: Codes, count: int) -> NDArray[np.intp]:
    """Return at most `count` rows, as many of each label, spread over all of its examples; two of each at least."""
    labels = np.unique(y)
    each = max(2, count // len(labels))
    chosen = []
    for label in labels:
        rows = np.flatnonzero(y == label)
        chosen.append(rows[np.unique(np.linspace(0, len(rows) - 1, min(each, len(rows))).astype(np.intp))])
    return np.sort(np.concatenate(chosen))


def _splits(rows: Codes, folds_of: Codes, y: Codes) -> Iterator[tuple[Codes, Codes]]:
    """Yield the rows for training and those held out of each fold that leaves two labels for the training."""
    for part in np.unique(folds_of):
        training, held = rows[folds_of != part], rows[folds_of == part]
        if len(np.unique(y[training])) > 1:
            yield training, held


def _divide(y: Codes, groups: Codes, folds: int, rng: np.random.Generator) -> Codes:
    """Return the part of each example at random: the slides of each label are assigned in turn."""
    folds_of = np.zeros(len(y), dtype=np.intp)
    for code in np.unique(y):
        rows = np.flatnonzero(y == code)
        slides = np.unique(groups[rows], return_inverse=True)[1].reshape(-1)
        if slides.max() == 0:  # a single slide: its windows are assigned
            slides = np.arange(len(rows))
        folds_of[rows] = rng.permutation(slides.max() + 1)[slides] % folds
    return folds_of

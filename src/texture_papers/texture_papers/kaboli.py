# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Objects in a hand by texture (Kaboli et al. 2015): Hjorth parameters, correlations; three learners.

What the paper says and what is done here, element by element:

motion
    Paper: Index and middle finger slide for 2 s while the others hold, to train; thumb and index finger, to test
        (III.B). Speed and force are not told.
    Here: Preset `kaboli`: 2.1 s at 0.008 m/s and 1 N with the finger sets `kaboli-train`, `kaboli-test`; the
        experiment 2 s at 0.02 m/s.
signals
    Paper: PAC at 2 kHz, 19 electrodes at 50 Hz (III.C).
    Here: PAC at 2.2 kHz, 19 electrodes at 100 Hz, as the board sends them.
descriptors
    Paper: Activity, mobility, complexity of PAC and, in the mean, of the electrodes (eq. 1 to 3, 6).
    Here: The same: `hjorth`, `MeanHjorth`.
correlations
    Paper: Pearson and Spearman of PAC with each electrode, in the mean (eq. 4 to 6). How the rates are matched is
        not told.
    Here: `Correlation`, PAC averaged to the rate of the electrodes.
fingers
    Paper: Two, 16 numbers (III.E).
    Here: `…-two-fingers`; the other recipes are of one finger.
SVM
    Paper: Linear, C by 5-fold cross-validation, 10 times, 20 values (V.A).
    Here: The same; the range of C is ours, 0.001 to 1000.
online learning
    Paper: PA-I of Crammer et al., C = 1, 20 objects (IV, V.B). Form for many classes and number of passes are not
        told.
    Here: `PassiveAggressive`, all planes together, one pass; `passes` gives more. `texture add` updates the planes
        live.
clusters
    Paper: EM on "the entire unsupervised data set", classes by majority (V.C). Shape of the clusters is not told.
    Here: `EmMixture`, features independent within a cluster; in the experiment of all slides, by the recipe of the
        training slides.
objects
    Paper: Ten balls and ten of various shapes; "regardless of object shape" (VI).
    Here: Scene `kaboli`: flat, one skin; scene `kaboli_shapes`: curved, fingers that differ. Sizes are guesses.
random movements
    Paper: Future work (VI).
    Here: Motion `in_hand_random`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from texture_core.config import param
from texture_core.types import Array
from texture_estimation.learners.learner import Codes, Fitted, Predictor, log_softmax, standardisation
from texture_estimation.learners.sklearn_learner import packed, unpacked
from texture_features.features.temporal import Hjorth
from texture_features.windows import WindowBatch, centred, power
from texture_papers.roberge import PairsPredictor


@dataclass(frozen=True)
class MeanHjorth:
    """Means over the channels of activity (or its logarithm), mobility and complexity: what `hjorth` gives for each.

    Source: Kaboli et al. 2015, eq. 6 (with `log_activity` off, and of a BioTac's slow channels the electrodes alone).
    """

    per_channel: ClassVar[bool] = False

    log_activity: bool = param(True, 'Averages the logarithm of the activity instead of the activity itself.')
    floor: float = param(
        1e-20, 'Power added before the logarithm, so that silence gives a finite value, unit².', low=1e-300, high=1e300
    )

    omit: str = param(
        '', "Which channels are left out of the means, by their names, such as 'tdc tac pdc'; empty: none."
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Activity, mobility, complexity."""
        return self._per_channel.names

    @property
    def _per_channel(self) -> Hjorth:
        return Hjorth(self.log_activity, self.floor)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the means."""
        values = self._per_channel(windows)
        if self.omit:
            values = values[..., windows.without(self.omit), :]
        return np.add.reduce(values, axis=-2, keepdims=True) / values.shape[-2]


TINY = 1e-150


@dataclass(frozen=True)
class Correlation:
    """Mean linear (Pearson) and monotonic (Spearman) correlation of the channels of one input with those of another.

    Both are brought to the grid of the input with fewer samples: a sample there is compared with the mean of the other
    input's samples until the next. Each pair of channels counts the same. Equal samples share the mean of their ranks.
    A channel that is constant, or a single sample long, correlates with nothing: 0. Of one input alone it is the mean
    correlation of its channels with each other, 0 for a single channel.

    Source: Kaboli et al. 2015, eq. 4 and 5; eq. 6 has the means over the electrodes alone.
    """

    per_channel: ClassVar[bool] = False
    names: ClassVar[tuple[str, ...]] = ('pearson', 'spearman')
    joins: ClassVar[bool] = True

    omit: str = param(
        '', "Which channels are left out of the means, by their names, such as 'tdc tac pdc'; empty: none."
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the two correlations, (..., 1, 2)."""
        inputs = (windows, *windows.joined)
        count = min(item.samples.shape[-2] for item in inputs)
        rows = [cell_means(self._rows(item), count) for item in inputs]
        values = [_mean_correlation(of_inputs) for of_inputs in (rows, [ranks(of_input) for of_input in rows])]
        return np.stack(values, axis=-1)[..., None, :]

    def _rows(self, windows: WindowBatch) -> Array:
        rows = windows.centred_rows
        return rows[..., windows.without(self.omit), :] if self.omit else rows


def cell_means(rows: Array, count: int) -> Array:
    """Return the means of `count` equal cells of rows, (..., count); at most as many as there are samples."""
    length = rows.shape[-1]
    if length == count:
        return rows
    starts = -(-np.arange(count) * length // count)
    return np.add.reduceat(rows, starts, axis=-1) / np.diff(np.append(starts, length))


def ranks(rows: Array) -> Array:
    """Return the rank of each sample within its row, from 0; equal ones share their mean rank."""
    from scipy.stats import rankdata  # noqa: PLC0415  # takes a second, and few recipes need it

    return rankdata(rows, axis=-1) - 1.0


def _mean_correlation(inputs: Sequence[Array]) -> Array:
    """Return the mean correlation, (...), of all pairs of rows of different inputs, or of different rows of one."""
    units = np.concatenate([_unit(rows) for rows in inputs], axis=-2)
    origin = np.repeat(np.arange(len(inputs)), [rows.shape[-2] for rows in inputs])
    alone = len(inputs) == 1
    first, second = np.triu_indices(len(origin), k=1)
    chosen = alone | (origin[first] != origin[second])
    if not chosen.any():
        return np.zeros(units.shape[:-2])
    products = (units @ units.swapaxes(-1, -2))[..., first[chosen], second[chosen]]
    return np.add.reduce(np.ascontiguousarray(products), axis=-1) / products.shape[-1]


def _unit(rows: Array) -> Array:
    """Return zero-mean rows of length 1; 0 for a constant row."""
    difference = centred(rows)
    spread = np.sqrt(power(difference))
    # What rounding leaves of a constant row is no variation.
    largest = np.abs(rows).max(axis=-1)
    varies = spread > 1e-12 * largest
    scale = np.where(varies, 1.0 / (spread + TINY), 0.0) / np.sqrt(rows.shape[-1])
    return difference * scale[..., None]


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
    >>> bool((predictor(values).argmax(axis=1) == codes).all())
    True
    """

    folds: int = param(5, 'Number of cross-validation folds; more folds take longer to train.', low=2, high=50)
    repeats: int = param(
        10,
        'Number of repetitions of the cross-validation with other random folds; more take longer to train.',
        low=1,
        high=1000,
    )
    candidates: int = param(
        20, 'Number of values of C that are tried, evenly spaced on a logarithmic scale.', low=1, high=200
    )
    least_c: float = param(1e-3, 'Smallest value of C that is tried.', low=1e-9, high=1e9)
    most_c: float = param(1e3, 'Largest value of C that is tried.', low=1e-9, high=1e9)
    examples: int = param(200, 'Largest number of examples with which C is chosen; more are subsampled evenly.', low=10)
    seed: int = param(0, 'Seed of the random folds; equal seeds give equal models.', low=0)

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
    def predictor(parameters: Mapping[str, Any]) -> PairsPredictor:
        """Return the predictor made from the stored parameters."""
        mean, intercepts = parameters['mean'], parameters['intercepts']
        weights = (parameters['weights'] / parameters['scale']).T.copy()
        return PairsPredictor(lambda X: (X - mean) @ weights + intercepts, 'nearest')

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


@dataclass(frozen=True)
class PassiveAggressive:
    """A plane for each label, moved by each example that is not at a distance from where it would be mistaken.

    The examples are taken in rounds: the first of each label, then the second of each, and so on. Their order matters.
    One pass is online learning: each example is seen once.

    Source: Crammer et al. 2006, PA-I: section 4 (one label against the others), section 8 (all labels together);
    Kaboli et al. 2015, section V.B.
    """

    c: float = param(1.0, 'Aggressiveness: largest update of a hyperplane by one example.', low=1e-9, high=1e9)
    multiclass: str = param(
        'one_vs_rest',
        "How planes of several labels learn: 'one_vs_rest' moves the plane of each label by itself, "
        "'crammer_singer' moves those of the true label and of its strongest rival alone.",
        choices=('one_vs_rest', 'crammer_singer'),
    )
    rounds: int = param(0, 'Number of examples of each label to train on; 0 takes all.', low=0)
    passes: int = param(
        1,
        'How often all examples are gone through; more passes fit them more closely. The paper names no number.',
        low=1,
        high=10_000,
    )

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features) and label numbers `y` 0… (n,) in the order given."""
        order = _in_rounds(y, self.rounds)
        # Only what was seen may be known: the scale, too, is that of the training examples.
        mean, scale = standardisation(X[order])
        planes = np.zeros((int(y.max()) + 1, X.shape[1] + 1))
        for row in np.tile(order, self.passes):
            self._update(planes, (X[row] - mean) / scale, int(y[row]))
        parameters = {'mean': mean, 'scale': scale, 'planes': planes}
        return Fitted(parameters, None, 'not calibrated: distances from the planes')

    def partial_fit(self, parameters: Mapping[str, Any], X: Array, code: int) -> Mapping[str, Any]:
        """Return the parameters after one more slide of a label, whose windows each move the planes once."""
        known = np.asarray(parameters['planes'])
        planes = np.vstack((known, np.zeros((max(0, code + 1 - len(known)), known.shape[1]))))
        for standard in (X - parameters['mean']) / parameters['scale']:
            self._update(planes, standard, code)
        return {**parameters, 'planes': planes}

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Predictor:
        """Return the predictor made from the stored parameters."""
        mean, planes = parameters['mean'], parameters['planes']
        weights, bias = (planes[:, :-1] / parameters['scale']).T.copy(), planes[:, -1].copy()
        return lambda X: log_softmax((X - mean) @ weights + bias)

    def _update(self, planes: Array, standard: Array, code: int) -> None:
        UPDATES[self.multiclass](planes, standard, code, self.c)


def move_each_plane(planes: Array, standard: Array, code: int, c: float) -> None:
    """Move the plane of each label by itself as far as one example demands.

    Parameters
    ----------
    planes : (n_labels, n_features + 1)
        Weights, and the bias last; changed in place.
    standard : (n_features,)
        Standardised features of the example.
    code
        Number of its label.
    c
        How far one example may move a plane.

    Source: Crammer et al. 2006, section 4.

    Examples
    --------
    >>> planes = np.zeros((2, 2))
    >>> move_each_plane(planes, np.array([1.0]), code=0, c=1.0)
    >>> planes.tolist()  # both planes are now at a distance of 1 from it
    [[0.5, 0.5], [-0.5, -0.5]]
    """
    extended = np.append(standard, 1.0)
    side = np.full(len(planes), -1.0)
    side[code] = 1.0
    loss = np.maximum(0.0, 1.0 - side * (planes @ extended))
    step = np.minimum(c, loss / (extended @ extended))
    planes += (step * side)[:, None] * extended


def move_true_and_rival(planes: Array, standard: Array, code: int, c: float) -> None:
    """Move the planes of the true label and of its strongest rival until the true one scores higher by 1.

    Of all planes for which that holds the nearest are taken: tau = min(c, loss / (2 |x|²)) is added to the one and
    subtracted from the other, times x. The parameters are those of `move_each_plane`.

    Source: Crammer et al. 2006, section 8.

    Examples
    --------
    >>> planes = np.zeros((2, 2))
    >>> move_true_and_rival(planes, np.array([1.0]), code=0, c=1.0)
    >>> (planes @ [1.0, 1.0]).tolist()  # the true label scores higher by 1
    [0.5, -0.5]
    """
    if len(planes) < 2:
        return
    extended = np.append(standard, 1.0)
    scores = planes @ extended
    rivals = scores.copy()
    rivals[code] = -np.inf
    rival = int(rivals.argmax())
    loss = max(0.0, 1.0 - float(scores[code] - scores[rival]))
    step = min(c, loss / (2.0 * float(extended @ extended))) * extended
    planes[code] += step
    planes[rival] -= step


UPDATES: Mapping[str, Callable[[Array, Array, int, float], None]] = {
    'one_vs_rest': move_each_plane,
    'crammer_singer': move_true_and_rival,
}


def _in_rounds(y: Codes, rounds: int) -> Codes:
    """Return the rows in rounds: the first example of each label, then the second of each, and so on."""
    number = np.empty(len(y), dtype=np.intp)
    for code in np.unique(y):
        rows = np.flatnonzero(y == code)
        number[rows] = np.arange(len(rows))
    order = np.argsort(number, kind='stable')
    return order[number[order] < rounds] if rounds else order


# A label to which no cluster belongs keeps so much, so that its logarithm is finite.
LEAST = 1e-6


@dataclass(frozen=True)
class EmMixture:
    """A mixture of normal distributions fitted by expectation and maximisation; classes to clusters by majority.

    A label that no cluster is named after is never recognised.

    Source: Kaboli et al. 2015, section V.C.
    """

    clusters_per_label: int = param(
        1, 'Number of clusters per label; more clusters fit more diverse slides of one label.', low=1, high=50
    )
    covariance: str = param(
        'full',
        "Covariance of a cluster: 'full', or 'diag' if features are taken as independent.",
        choices=('full', 'diag'),
    )
    regularisation: float = param(
        1e-3,
        'Variance added to the standardised features, which keeps clusters from collapsing; a larger one smooths more.',
        low=1e-9,
    )
    starts: int = param(
        3, 'Number of random initialisations; the result with the highest likelihood is kept.', low=1, high=1000
    )
    seed: int = param(0, 'Seed of the random initialisations; equal seeds give equal models.', low=0)

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        from sklearn.mixture import GaussianMixture  # noqa: PLC0415  # scikit-learn takes a second to import

        mean, scale = standardisation(X)
        standard = (X - mean) / scale
        n_labels = int(y.max()) + 1
        distinct = len(np.unique(standard, axis=0))
        mixture = GaussianMixture(
            min(self.clusters_per_label * n_labels, distinct),
            covariance_type=self.covariance,
            reg_covar=self.regularisation,
            n_init=self.starts,
            random_state=self.seed,
        ).fit(standard)
        found = mixture.predict(standard)
        n_clusters = len(mixture.weights_)
        counts = np.zeros((n_clusters, n_labels))
        np.add.at(counts, (found, y), 1.0)
        parameters = {
            'packed': packed(mixture, 'GaussianMixture'),
            'mean': mean,
            'scale': scale,
            'names': np.eye(n_labels)[counts.argmax(axis=1)],
        }
        return Fitted(parameters, None, 'not calibrated: probabilities of clusters found without labels')

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Predictor:
        """Return the predictor made from the stored parameters."""
        mixture, mean, scale, names = (
            unpacked(parameters['packed']),
            *(parameters[name] for name in ('mean', 'scale', 'names')),
        )

        def predict(X: Array) -> Array:
            shares = mixture.predict_proba(np.atleast_2d((X - mean) / scale))
            return log_softmax(np.log(shares @ names + LEAST)).reshape(*X.shape[:-1], -1)

        return predict

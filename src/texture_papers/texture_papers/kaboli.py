# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Objects in a hand by texture (Kaboli et al. 2015): Hjorth parameters, correlations; three learners.

What the paper describes and what is done here, element by element:

motion
    :Paper: Index and middle finger slide for 2 s while the others hold, to train; thumb and index finger, to test
        (III.B). Speed and force are not given.
    :Here: Preset `kaboli`: 2.1 s at 0.008 m/s and 1 N with the finger sets `kaboli-train`, `kaboli-test`; the
        experiment 2 s at 0.02 m/s.
signals
    :Paper: PAC at 2 kHz, 19 electrodes at 50 Hz (III.C).
    :Here: PAC at 2.2 kHz, 19 electrodes at 100 Hz, as the board sends them.
descriptors
    :Paper: Activity, mobility, complexity of PAC and, in the mean, of the electrodes (eq. 1 to 3, 6).
    :Here: The same: `hjorth`, `MeanHjorth`.
correlations
    :Paper: Pearson and Spearman of PAC with each electrode, in the mean (eq. 4 to 6). How the rates are matched is
        not told.
    :Here: `Correlation`, PAC averaged to the rate of the electrodes.
fingers
    :Paper: Two, 16 numbers (III.E).
    :Here: `…-two-fingers`; the other recipes are of one finger.
SVM
    :Paper: Linear, C by 5-fold cross-validation, 10 times, 20 values (V.A).
    :Here: The same; the range of C is ours, 0.001 to 1000.
online learning
    :Paper: PA-I of Crammer et al., C = 1, 20 objects (IV, V.B). Form for many classes and number of passes are not
        told.
    :Here: `PassiveAggressive`, all planes together, one pass; `passes` gives more. `texture add` updates the planes
        live.
clusters
    :Paper: EM on "the entire unsupervised data set", classes by majority (V.C). Shape of the clusters is not given.
    :Here: `EmMixture`, features independent within a cluster; in the experiment of all slides, whose labels name the
        clusters; by the recipe of the training slides.
objects
    :Paper: Ten balls and ten of various shapes; "regardless of object shape" (VI).
    :Here: Scene `kaboli`: flat, one skin; scene `kaboli_shapes`: curved, fingers that differ. Sizes are guesses.
random movements
    :Paper: Future work (VI).
    :Here: None.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from texture_core.config import param
from texture_core.types import Array
from texture_estimation.learners.learner import Codes, Fitted, Predictor, log_softmax, standardisation
from texture_estimation.learners.sklearn_learner import packed, unpacked
from texture_features.features.temporal import Hjorth
from texture_features.windows import WindowBatch, centred, power
from texture_papers.roberge import PairsPredictor, pairs_of_machine


@dataclass(frozen=True)
class MeanHjorth:
    """Means over the channels of activity (or its logarithm), mobility and complexity: what `hjorth` gives for each.

    Source: Kaboli et al. 2015, eq. 6 (with `log_activity` off, and of a BioTac's slow channels the electrodes alone).
    """

    per_channel: ClassVar[bool] = False

    log_activity: bool = param(True, 'Averages the logarithm of the activity instead of the activity itself.')
    omit: str = param(
        '', "Which channels are left out of the means, by their names, such as 'tdc tac pdc'; empty: none."
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Activity, mobility, complexity."""
        return self._per_channel.names

    @property
    def _per_channel(self) -> Hjorth:
        return Hjorth(self.log_activity)

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
    """Linear SVMs for all pairs; most pairs won, ties broken by the clearer decisions.

    A pipeline of scikit-learn with the penalty C that is best by repeated stratified cross-validation, the smallest of
    those that tie. A label with fewer slides than there are folds is not held out: then C is the middle one.

    Source: Kaboli et al. 2015, section V.A: 5 folds, 10 repeats, 20 values.
    """

    folds: int = param(5, 'Number of cross-validation folds; more folds take longer to train.', low=2, high=50)
    repeats: int = param(
        10,
        'Number of repetitions of the cross-validation with other random folds.',
        low=1,
        high=1000,
    )
    candidates: int = param(
        20, 'Number of values of C that are tried, evenly spaced on a logarithmic scale.', low=1, high=200
    )
    least_c: float = param(1e-3, 'Smallest value of C that is tried.', low=1e-9, high=1e9)
    most_c: float = param(1e3, 'Largest value of C that is tried.', low=1e-9, high=1e9)
    ties: ClassVar[str] = 'nearest'

    def machine(self, X: Array, y: Codes, groups: Codes) -> Any:
        """Return the fitted pipeline."""
        from sklearn.exceptions import ConvergenceWarning  # noqa: PLC0415  # scikit-learn takes a second to import
        from sklearn.model_selection import GridSearchCV, StratifiedGroupKFold  # noqa: PLC0415
        from sklearn.pipeline import make_pipeline  # noqa: PLC0415
        from sklearn.preprocessing import StandardScaler  # noqa: PLC0415
        from sklearn.svm import SVC  # noqa: PLC0415

        svc = SVC(kernel='linear', max_iter=ITERATIONS, decision_function_shape='ovo')
        machines = make_pipeline(StandardScaler(), svc)
        tried = np.geomspace(self.least_c, self.most_c, self.candidates)
        slides = min(len(np.unique(groups[y == code])) for code in np.unique(y))
        with warnings.catch_warnings():
            warnings.simplefilter('ignore', ConvergenceWarning)  # the limit of iterations is meant
            if slides < self.folds:
                return machines.set_params(svc__C=tried[len(tried) // 2]).fit(X, y)
            divided = [StratifiedGroupKFold(self.folds, shuffle=True, random_state=n) for n in range(self.repeats)]
            splits = [split for one in divided for split in one.split(X, y, groups)]
            return GridSearchCV(machines, {'svc__C': tried}, cv=splits).fit(X, y).best_estimator_

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        machine = self.machine(X, y, groups)
        note = f'not calibrated: pairs won; C = {machine.get_params()["svc__C"]:.3g}'
        return Fitted({'packed': packed(machine, 'SVC'), 'ties': self.ties}, None, note)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> PairsPredictor:
        """Return the predictor made from the stored parameters."""
        return pairs_of_machine(parameters)


@dataclass(frozen=True)
class PassiveAggressive:
    """A plane for each label, moved by each example that is not at a distance from where it would be mistaken.

    The examples are taken in rounds: the first of each label, then the second of each, and so on. Their order matters.
    One pass is online learning: each example is seen once.

    Source: Crammer et al. 2006, PA-I, section 8 (all labels together); Kaboli et al. 2015, section V.B.
    """

    c: float = param(1.0, 'Aggressiveness: largest update of a hyperplane by one example.', low=1e-9, high=1e9)
    rounds: int = param(0, 'Number of examples of each label to train on; 0 takes all.', low=0)
    passes: int = param(
        1,
        'Number of passes over all examples; the paper names no number.',
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
            move_true_and_rival(planes, (X[row] - mean) / scale, int(y[row]), self.c)
        parameters = {'mean': mean, 'scale': scale, 'planes': planes}
        return Fitted(parameters, None, 'not calibrated: distances from the planes')

    def partial_fit(self, parameters: Mapping[str, Any], X: Array, code: int) -> Mapping[str, Any]:
        """Return the parameters after one more slide of a label, whose windows each move the planes once."""
        known = np.asarray(parameters['planes'])
        planes = np.vstack((known, np.zeros((max(0, code + 1 - len(known)), known.shape[1]))))
        for standard in (X - parameters['mean']) / parameters['scale']:
            move_true_and_rival(planes, standard, code, self.c)
        return {**parameters, 'planes': planes}

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Predictor:
        """Return the predictor made from the stored parameters."""
        mean, planes = parameters['mean'], parameters['planes']
        weights, bias = (planes[:, :-1] / parameters['scale']).T.copy(), planes[:, -1].copy()
        return lambda X: log_softmax((X - mean) @ weights + bias)


def move_true_and_rival(planes: Array, standard: Array, code: int, c: float) -> None:
    """Move the planes of the true label and of its strongest rival until the true one scores higher by 1.

    Of all planes for which that holds the nearest are taken: `tau = min(c, loss / (2 |x|²))` is added to the one and
    subtracted from the other, times x. `planes` are (n_labels, n_features + 1), the bias last, and change in place.

    Source: Crammer et al. 2006, section 8.
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

    A pipeline of scikit-learn; the features of a cluster are independent, as in Weka. A label that no cluster is named
    after is never recognised.

    Source: Kaboli et al. 2015, section V.C.
    """

    clusters_per_label: int = param(
        1, 'Number of clusters per label; more clusters fit more diverse slides of one label.', low=1, high=50
    )
    regularisation: float = param(
        1e-3,
        'Variance added to the standardised features, which keeps clusters from collapsing; a larger one smooths more.',
        low=1e-9,
    )
    starts: int = param(
        5, 'Number of random initialisations; the result with the highest likelihood is kept.', low=1, high=1000
    )
    seed: int = param(0, 'Seed of the random initialisations; equal seeds give equal models.', low=0)

    def fit(self, X: Array, y: Codes, groups: Codes) -> Fitted:
        """Learn from features `X` (n, n_features), label numbers `y` 0… (n,) and slides `groups` (n,)."""
        from sklearn.mixture import GaussianMixture  # noqa: PLC0415  # scikit-learn takes a second to import
        from sklearn.pipeline import make_pipeline  # noqa: PLC0415
        from sklearn.preprocessing import StandardScaler  # noqa: PLC0415

        n_labels = int(y.max()) + 1
        count = min(self.clusters_per_label * n_labels, len(np.unique(X, axis=0)))
        settings = {'covariance_type': 'diag', 'reg_covar': self.regularisation, 'n_init': self.starts}
        clusters = make_pipeline(StandardScaler(), GaussianMixture(count, random_state=self.seed, **settings)).fit(X)
        named = np.zeros((count, n_labels))
        np.add.at(named, (clusters.predict(X), y), 1.0)
        names = np.eye(n_labels)[named.argmax(axis=1)]
        note = 'not calibrated: probabilities of clusters found without labels'
        return Fitted({'packed': packed(clusters, 'GaussianMixture'), 'names': names}, None, note)

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> Predictor:
        """Return the predictor made from the stored parameters."""
        clusters, names = unpacked(parameters['packed']), parameters['names']

        def predict(X: Array) -> Array:
            proba = clusters.predict_proba(X.reshape(-1, X.shape[-1]))
            return log_softmax(np.log(proba @ names + LEAST)).reshape(*X.shape[:-1], -1)

        return predict

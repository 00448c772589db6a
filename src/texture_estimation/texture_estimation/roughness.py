# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Roughness: grades and ratings, regressors, recipe, training, evidence, model."""

from __future__ import annotations

import csv
import dataclasses
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from texture_core.config import MB, find_file, from_mapping, param, read_text, unknown_name
from texture_core.errors import InvalidData, ModelMismatch
from texture_core.types import NANOSECONDS, Array, FeatureVector, RoughnessEstimate
from texture_estimation.evidence import no_window
from texture_estimation.learners.learner import Codes, check_finite, standardisation
from texture_estimation.model import StoredModel, common_parts, model_stem, part_of, read_tree, usable
from texture_estimation.recipe import TrainingParams, check_keys
from texture_features.feature_set import FeatureSet, LabelledFeatures, choose, fingerprint_difference, read_recipe
from texture_features.windows import WindowParams

# --------------------
# Whether a window can be graded at all, and if not, why.

# Features that show whether a window can be used; a regressor does not see them.
STICK_SLIP, LEVEL = 'peak_to_median_power', 'log_variance'


MIN_FORCE_N = 0.05  # smallest that counts as contact
STICK_SLIP_MARGIN = 1.0  # rise of STICK_SLIP over the training set that counts as stick-slip, as ln of power
QUIET_MARGIN = 0.7  # fall of LEVEL below the training set that counts as too quiet, as ln of power


def checked_columns(names: Sequence[str], feature: str) -> NDArray[np.intp]:
    """Return the columns that a feature fills, of values named 'input/feature/value/channel'."""
    return np.flatnonzero([name.split('/')[1:2] == [feature] for name in names])


def graded_columns(names: Sequence[str]) -> NDArray[np.intp]:
    """Return the columns that a regressor sees."""
    return np.flatnonzero([name.split('/')[1:2] not in ([STICK_SLIP], [LEVEL]) for name in names])


# --------------------
# Protocol of roughness regressors: parameters that fit graded windows and export a predictor.

REGRESSOR_GRADES: Array = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
SMOOTH, ROUGH = 1.0, 5.0


# From features (..., n_features) to grade and its standard deviation, (...) each, as plain arrays: NaN as the grade
# where the regressor has no answer, 0 as the deviation if it is unknown.
RegressorPredictor = Callable[[Array], tuple[Array, Array]]


class RoughnessRegressor(Protocol):
    """Frozen parameters of a regressor."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    def fit(self, X: Array, y: Array, groups: Codes) -> Mapping[str, Any]:
        """Learn from features `X`, grades `y` and texture numbers `groups`; return plain arrays."""

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> RegressorPredictor:
        """Return the predictor made from the stored parameters."""


# --------------------
# Gaussian-process regression of the grade, with one point a texture.

MIDDLE = 3.0  # of the scale: the grade of a texture of which nothing is known
# What is known beforehand of the logarithms of slope and noise, in grades a typical distance between textures and in
# grades that people disagree by: mean and standard deviation.
PRIOR_MEANS = np.log([0.5, 0.5])
PRIOR_SPREAD = np.array([1.0, 0.5])
JITTER = 1e-9


@dataclass(frozen=True)
class GaussianProcess:
    """A straight line of standardised features, plus noise for each texture.

    The windows of a texture share its grade and its noise: they are one point, their mean. So three thousand windows of
    fifteen textures are fifteen opinions, not three thousand, and the standard deviation shows it. The hyperparameters
    maximise the marginal likelihood times a wide prior. The line passes through the middle of the scale, 3, at the mean
    of the training textures, so these should span the scale.

    Source: Rasmussen & Williams 2006, sections 2.1 and 5.4.1.

    Examples
    --------
    >>> import numpy as np
    >>> grades, textures = np.repeat([1.0, 3.0, 5.0], 20), np.repeat(np.arange(3), 20)
    >>> values = grades[:, None] + 0.1 * np.random.default_rng(0).standard_normal((60, 1))
    >>> predictor = GaussianProcess.predictor(GaussianProcess().fit(values, grades, textures))
    >>> bool(np.nanmean(np.abs(predictor(values)[0] - grades)) < 0.5)
    True
    """

    def fit(self, X: Array, y: Array, groups: Codes) -> Mapping[str, Any]:
        """Learn from features `X` (n, n_features), grades `y` (n,) and numbers of the textures, `groups` (n,).

        Raises
        ------
        InvalidData
            If all windows are of one texture.
        """
        from scipy.optimize import minimize  # noqa: PLC0415

        codes = np.unique(groups)
        if len(codes) < 2:
            raise InvalidData('all graded windows are of one texture; two or more are needed')
        points = np.stack([X[groups == code].mean(axis=0) for code in codes])
        targets = np.array([y[groups == code].mean() for code in codes]) - MIDDLE
        mean, scale = standardisation(points)
        # One unit is the distance of two typical textures, whatever the number of features.
        scale = scale * np.sqrt(points.shape[1])
        places = (points - mean) / scale
        products = places @ places.T

        def covariance(logs: Array) -> Array:
            slope, noise = np.exp(logs)
            return slope**2 * products + (noise**2 + JITTER) * np.eye(len(products))

        def loss(logs: Array) -> float:
            surprise, of_targets = (logs - PRIOR_MEANS) / PRIOR_SPREAD, covariance(logs)
            _, log_size = np.linalg.slogdet(of_targets)
            likelihood = -0.5 * float(targets @ np.linalg.solve(of_targets, targets) + log_size)
            return 0.5 * float(surprise @ surprise) - likelihood

        logs = minimize(loss, PRIOR_MEANS, method='L-BFGS-B').x
        (slope, noise), weighed = np.exp(logs), np.linalg.solve(covariance(logs), places).T
        spread = slope**2 * (np.eye(places.shape[1]) - slope**2 * weighed @ places)
        return {'mean': mean, 'scale': scale, 'line': slope**2 * weighed @ targets, 'spread': spread, 'noise': noise}

    @staticmethod
    def predictor(parameters: Mapping[str, Any]) -> RegressorPredictor:
        """Return what gives the posterior at a window's features: grade, and deviation with noise between textures."""
        mean, scale, line, spread, noise = (parameters[name] for name in ('mean', 'scale', 'line', 'spread', 'noise'))

        def predict(X: Array) -> tuple[Array, Array]:
            place = (X - mean) / scale
            variance = np.add.reduce((place @ spread) * place, axis=-1) + noise**2
            return np.minimum(np.maximum(MIDDLE + place @ line, SMOOTH), ROUGH), np.sqrt(np.maximum(variance, 0.0))

        return predict


# --------------------
# The regressors that a roughness recipe can name.

REGRESSORS: Mapping[str, type[RoughnessRegressor]] = {
    'gaussian_process': GaussianProcess,  # Bayesian linear regression, Rasmussen & Williams 2006
}


# --------------------
# Grades that people gave to textures: a table in a CSV file.

MAX_BYTES = 1 * MB
TRAIN, TEST = 'train', 'test'


@dataclass(frozen=True)
class Grades:
    """The grade of each texture, and for which each is meant.

    A grade is subjective; the physical roughness of a surface is another quantity.
    """

    grades: Mapping[str, float]
    splits: Mapping[str, str] = field(default_factory=dict)

    def of(self, texture: str) -> float:
        """Return a texture's grade; UnknownName with the nearest if it has none."""
        if texture not in self.grades:
            raise unknown_name(texture, self.grades, 'grade for the texture')
        return self.grades[texture]

    def used_for(self, split: str) -> tuple[str, ...]:
        """Return the textures meant to 'train' or to 'test', in their order."""
        return tuple(texture for texture in self.grades if self.splits.get(texture) == split)


def read_grades(path: str | Path) -> Grades:
    """Read a CSV file with the columns `texture` and `grade`, and if wanted `split`; others are left alone."""
    place = find_file(str(path), 'texture_simulation', 'config/grades', 'table of grades', '.csv')
    grades: dict[str, float] = {}
    splits: dict[str, str] = {}
    for line, row in read_rows(place, ('texture', 'grade'), 'grade'):
        texture, where = row['texture'], f"'{place}', line {line}"
        if not texture or texture in grades:
            raise InvalidData(f"{where}: the texture is '{texture}'; name each once")
        grades[texture] = checked_grade(row['grade'], where)
        if split := row.get('split'):
            if split not in (TRAIN, TEST):
                raise InvalidData(f"{where}: the split is '{split}'; '{TRAIN}' or '{TEST}' is needed")
            splits[texture] = split
    return Grades(grades, splits)


def read_rows(path: Path, columns: Sequence[str], what: str) -> list[tuple[int, dict[str, str]]]:
    """Read a CSV file: number and entries of each line, by the names of the columns in small letters.

    Lines that begin with '#' are no lines. An entry that a short line lacks is None.
    """
    needed = f'{", ".join(columns[:-1])} and {columns[-1]} are needed, one {what} a line'
    try:
        file = io.StringIO(read_text(path, MAX_BYTES, 'utf-8-sig'), newline='')
        reader = csv.DictReader(line for line in file if not line.startswith('#'))
        names = ['grade' if name == 'rating' else name for name in map(_plain, reader.fieldnames or ())]
        reader.fieldnames = names
        rows = [(reader.line_num, row) for row in reader]
    except (OSError, ValueError, csv.Error) as error:
        reason = 'it is no text in UTF-8' if isinstance(error, UnicodeDecodeError) else error
        raise InvalidData(f"'{path}' cannot be read: {reason}; give a CSV file of {what}s") from error
    if missing := [name for name in columns if name not in names]:
        other = next((f"; it may separate by '{sign}': save it with commas" for sign in ';\t|' if sign in names[0]), '')
        raise InvalidData(
            f"'{path}' has the columns {', '.join(names) or 'none'} but no {', '.join(missing)}{other}; {needed}"
        )
    if not rows:
        raise InvalidData(f"'{path}' holds no {what}; {needed}")
    return rows


def _plain(name: str) -> str:
    return name.strip().lower()


def checked_grade(
    text: str | None, where: str, scale: tuple[float, float] = (SMOOTH, ROUGH), advice: str = ''
) -> float:
    """Return a number on a scale of grades; InvalidData with the place if it is none, or beyond an end."""
    low, high = scale
    try:
        grade = float(text or '')
    except ValueError:
        grade = math.nan
    if not low <= grade <= high:
        raise InvalidData(f"{where}: the grade is '{text}'; a number from {low:g} to {high:g} is needed{advice}")
    return grade


# --------------------
# A roughness recipe: windows, inputs and features, head, checks and evidence, in one YAML file.

KEYS = ('description', 'windows', 'inputs', 'regressor', 'training')


@dataclass(frozen=True)
class CalibrationParams(TrainingParams):
    """How the examples for training are cut, and on what the interval is calibrated."""

    folds: int = param(
        15, 'Number of folds of textures for the calibration; at most one per texture is possible.', low=2, high=1000
    )


@dataclass(frozen=True)
class RoughnessRecipe:
    """What turns a signal into a grade, before any training."""

    name: str
    feature_set: FeatureSet
    regressor_name: str
    regressor: RoughnessRegressor
    training: CalibrationParams = field(default_factory=CalibrationParams)
    description: str = ''

    @property
    def training_windows(self) -> WindowParams:
        """How to cut the windows that are used for training."""
        return dataclasses.replace(self.feature_set.windows, hop_s=self.training.hop_s)

    @classmethod
    def from_mapping(cls, content: Mapping[str, Any], name: str) -> RoughnessRecipe:
        """Build from what a recipe file holds."""
        where = f"roughness recipe '{name}'"
        check_keys(content, KEYS, where)
        return cls(
            name,
            FeatureSet.from_mapping(content, where),
            *choose(REGRESSORS, content.get('regressor', 'gaussian_process'), 'regressor', where),
            from_mapping(CalibrationParams, content.get('training') or {}, f'{where}, training'),
            str(content.get('description', '')),
        )

    def as_mapping(self) -> dict[str, Any]:
        """Return the recipe as a file writes it, every parameter spelt out."""
        return {
            'description': self.description,
            **self.feature_set.as_mapping(),
            'regressor': {self.regressor_name: dataclasses.asdict(self.regressor)},
            'training': dataclasses.asdict(self.training),
        }


def load_roughness_recipe(name_or_path: str) -> RoughnessRecipe:
    """Read a recipe that the package ships in config/roughness, or any by path; a model's card also holds one."""
    name, content = read_recipe(name_or_path, 'config/roughness', 'roughness recipe')
    return RoughnessRecipe.from_mapping(content, name)


# --------------------
# A trained roughness model.

NORMAL_90 = 1.6449  # standard deviations around the mean within which 90 % of normal values lie


@dataclass(frozen=True)
class Calibration:
    """What makes an honest standard deviation of the one that a regressor claims."""

    scale: float = 1.0
    base_std: float = 0.0
    within_std: float = 0.0

    def shared_variance(self, regressor_std: Array | float) -> Array:
        """Return the variance that more sliding over the texture does not lessen."""
        return self.scale**2 * (np.square(regressor_std) + self.base_std**2)

    def window_std(self, regressor_std: Array) -> Array:
        """Return the standard deviation of the grade of a single window."""
        return np.sqrt(self.shared_variance(regressor_std) + self.within_std**2)


@dataclass(frozen=True, eq=False, kw_only=True)
class RoughnessModel(StoredModel):
    """Fitted parameters, and what is needed to grade a feature vector and to refuse an incompatible one."""

    recipe: RoughnessRecipe
    calibration: Calibration
    limits: Mapping[str, float]
    grades: Mapping[str, float]

    @cached_property
    def predictor(self) -> RegressorPredictor:
        """The head as plain arrays; it sees the features that are no checks."""
        return self.recipe.regressor.predictor(self.parameters)

    @cached_property
    def _columns(self) -> Mapping[str, NDArray[np.intp]]:
        return {feature: checked_columns(self.names, feature) for feature in (STICK_SLIP, LEVEL)}

    @cached_property
    def _graded(self) -> NDArray[np.intp]:
        return graded_columns(self.names)

    def refusal(self, vector: FeatureVector) -> str:
        """Return why a window cannot be graded; '' if it can."""
        if vector.force_n < MIN_FORCE_N:  # an unknown force is NaN and is ignored
            return f'no contact: the force is {vector.force_n:.2f} N'
        finite = np.isfinite(vector.values)
        if not finite.all():
            bad = vector.names[int(finite.argmin())]
            return f"its feature '{bad}' is not finite; is the speed known?"
        highest = {name: float(vector.values[own].max()) for name, own in self._columns.items() if name in self.limits}
        if LEVEL in highest and highest[LEVEL] < self.limits[LEVEL]:
            return 'no contact: the signal is weaker than on the smoothest training surface'
        if STICK_SLIP in highest and highest[STICK_SLIP] > self.limits[STICK_SLIP]:
            return 'stick-slip dominates the signal'
        return ''

    def grade(self, X: Array) -> tuple[Array, Array]:
        """Return grade and standard deviation of the regressor, (...) each, of (..., n_features)."""
        return self.predictor(X.take(self._graded, axis=-1))

    @property
    def tree(self) -> dict[str, Any]:
        """What the two files hold: plain values, and arrays as leaves."""
        return {
            **super().tree,
            'target': 'roughness grade, 1 (smooth) to 5 (rough), as people give it: an opinion, not a depth',
            'grades': dict(self.grades),
            'calibration': asdict(self.calibration),
            'limits': dict(self.limits),
        }


def load_roughness_model(path: str | Path) -> RoughnessModel:
    """Read a model; `path` is that of either file, or of both without the ending. No code in the file is run."""
    target = model_stem(path)
    tree = read_tree(path, of='regressor')
    with usable(target):
        model = RoughnessModel(
            **common_parts(tree),
            recipe=RoughnessRecipe.from_mapping(tree['recipe'], str(tree['recipe_name'])),
            calibration=part_of(Calibration, tree.get('calibration'), 'calibration'),
            limits=part_of(Mapping[str, float], tree.get('limits'), 'limits'),
            grades=part_of(Mapping[str, float], tree.get('grades'), 'grades'),
        )
        grade, std = model.grade(np.zeros(len(model.names)))
    if np.shape(grade) or np.shape(std):
        raise ModelMismatch(f"model '{target}' answers with more than one grade; train it again")
    return model


# --------------------
# The grade of a surface and its uncertainty, updated window by window while the finger slides.

NO_MODEL = "no model is loaded; set the parameter 'model' of the roughness_estimator to the path of a trained one"
SILENT = 'no grade: the surface resembles no training surface'
# The scatter of the windows of a texture, known from the training, counts as this many windows.
PRIOR_WINDOWS = 4.0
# A grade is final once more sliding would narrow its 90 % interval by less, after this many graded windows.
MIN_NARROWING_GRADES, MIN_WINDOWS = 0.1, 3


class RoughnessAccumulator:
    """Join the grades of the windows of one slide; the same code on the robot and on recordings.

    A new exploration id, or a vector after the `last` one, starts again.
    """

    def __init__(self, model: RoughnessModel | None) -> None:
        self.model = model
        self.refused = 0  # vectors of another fingerprint
        self.unusable = 0  # windows without contact, with stick-slip or with values that are not finite
        self.silent = 0  # windows to which the regressor gave no grade
        self._over = True
        self._final = False
        self._exploration_id = ''

    def update(self, vector: FeatureVector) -> RoughnessEstimate | None:
        """Return the estimate after one more window, or the final one; None after that."""
        if self._over or vector.exploration_id != self._exploration_id:
            self._start(vector.exploration_id)
        self._over = vector.last
        if self._final:
            return None
        if self.model is not None and not vector.last:
            self._take(vector, self.model)
        estimate = self._estimate(vector)
        self._final = estimate.final
        return estimate

    def _start(self, exploration_id: str) -> None:
        self._exploration_id = exploration_id
        self._final = False
        self._windows = 0
        self._sum = self._sum_squares = self._sum_variances = 0.0
        self._evidence_ns = self._window_ns = self._end_ns = 0
        self._message = '' if self.model else NO_MODEL

    def _take(self, vector: FeatureVector, model: RoughnessModel) -> None:
        if vector.feature_set != model.feature_set:
            self.refused += 1
            self._message = (
                f"model '{model.name}' does not fit: {fingerprint_difference(vector.feature_set, model.feature_set)}"
            )
            return
        refusal = model.refusal(vector)
        if refusal:
            self.unusable += 1
            self._message = f'a window was left out: {refusal}'
            return
        grade, std = (float(number) for number in model.grade(vector.values))
        if math.isnan(grade):
            self.silent += 1
            self._message = SILENT
            return
        self._windows += 1
        self._sum += grade
        self._sum_squares += grade * grade
        self._sum_variances += float(model.calibration.shared_variance(std))
        self._window_ns = round(vector.window_s * NANOSECONDS)
        end = vector.start_ns + self._window_ns
        self._evidence_ns += max(0, end - max(vector.start_ns, self._end_ns))
        self._end_ns = max(end, self._end_ns)

    def _estimate(self, vector: FeatureVector) -> RoughnessEstimate:
        model = self.model
        if model is None or not self._windows:
            return RoughnessEstimate(
                stamp_ns=vector.start_ns,
                exploration_id=vector.exploration_id,
                frame_id=vector.frame_id,
                final=vector.last,
                model=model.name if model else '',
                message=self._message or (no_window(model.recipe.feature_set.windows) if model and vector.last else ''),
            )
        # More sliding does not lessen the variance that the windows share, but that of their mean: windows that overlap
        # contribute the sliding time that they cover together.
        count = self._windows
        around = max(0.0, self._sum_squares - self._sum * self._sum / count)
        of_windows = (PRIOR_WINDOWS * model.calibration.within_std**2 + around) / (PRIOR_WINDOWS + count - 1.0)
        shared, scatter = self._sum_variances / count, of_windows * self._window_ns / self._evidence_ns
        std = math.sqrt(shared + scatter)
        to_gain = NORMAL_90 * (std - math.sqrt(shared))
        narrow = count >= MIN_WINDOWS and to_gain < MIN_NARROWING_GRADES
        return RoughnessEstimate(
            stamp_ns=self._end_ns,
            exploration_id=vector.exploration_id,
            frame_id=vector.frame_id,
            valid=True,
            grade=min(max(self._sum / count, SMOOTH), ROUGH),
            grade_std=std,
            windows=count,
            evidence_s=self._evidence_ns / NANOSECONDS,
            final=vector.last or narrow,
            model=model.name,
            message=self._message,
        )


# --------------------
# Learn to grade from windows of textures that people graded.

MIN_TEXTURES = 4  # to hold one out and train on the others
SCALES = (0.05, 20.0)


def train_grades(recipe: RoughnessRecipe, examples: LabelledFeatures, grades: Grades, name: str = '') -> RoughnessModel:
    """Return a model that predicts the grades by people of the textures of the examples.

    The standard deviation is calibrated on textures held out in turn, of the training alone.
    """
    labels, codes = np.unique(examples.labels, return_inverse=True)
    table = {str(label): grades.of(str(label)) for label in labels}
    true = np.array([table[str(label)] for label in labels])[codes]
    check_finite(examples)
    columns = graded_columns(examples.names)
    values = examples.values[:, columns]
    calibration, facts = Calibration(), {'calibration': f'not calibrated: fewer than {MIN_TEXTURES} textures'}
    if len(labels) >= MIN_TEXTURES:
        calibration, facts = calibrate(
            *hold_out(recipe.regressor, values, true, codes, recipe.training.folds), true, codes
        )
    limits = {}
    if (of_stick_slip := checked_columns(examples.names, STICK_SLIP)).size:
        limits[STICK_SLIP] = float(examples.values[:, of_stick_slip].max()) + STICK_SLIP_MARGIN
    if (of_level := checked_columns(examples.names, LEVEL)).size:
        limits[LEVEL] = float(examples.values[:, of_level].max(axis=1).min()) - QUIET_MARGIN
    return RoughnessModel(
        name=name or recipe.name,
        names=examples.names,
        feature_set=examples.feature_set,
        recipe=recipe,
        parameters=recipe.regressor.fit(values, true, codes),
        calibration=calibration,
        limits=limits,
        grades=table,
        training={
            'windows': len(codes),
            'slides': len(np.unique(examples.groups)),
            'textures': len(labels),
            'window_s': examples.window_s,
            'hop_s': examples.hop_s,
            **facts,
        },
    )


def hold_out(
    regressor: RoughnessRegressor, values: Array, true: Array, textures: Codes, folds: int
) -> tuple[Array, Array]:
    """Return grades and deviations, (n,) each, that a regressor gives which trained on other textures; NaN for none."""
    codes = np.unique(textures)
    grades, stds = np.empty(len(true)), np.empty(len(true))
    # Textures of like grade go to different parts, so that each part leaves some of every grade.
    order = codes[np.argsort([true[textures == code][0] for code in codes], kind='stable')]
    for part in range(min(folds, len(codes))):
        held = np.isin(textures, order[part :: min(folds, len(codes))])
        fitted = regressor.predictor(regressor.fit(values[~held], true[~held], textures[~held]))
        grades[held], stds[held] = fitted(values[held])
    return grades, stds


def calibrate(grades: Array, stds: Array, true: Array, textures: Codes) -> tuple[Calibration, dict[str, Any]]:
    """Return the calibration, and facts for the card, from the estimates of held-out textures, (n,) each.

    The scale makes the mean square of error over standard deviation, each texture counting alike, what it is for a
    Student distribution with as many degrees of freedom as there are textures, whose 90 % interval ours then is.
    """
    known = np.isfinite(grades)
    if not known.any():
        return Calibration(), {'calibration': 'not calibrated: no held-out window got a grade'}
    missing = 1.0 - float(known.mean())
    from scipy.optimize import brentq  # noqa: PLC0415  # takes 0.5 s, and only training needs it
    from scipy.stats import t as student  # noqa: PLC0415

    grades, stds, true = grades[known], stds[known], true[known]
    codes, at = np.unique(textures[known], return_inverse=True)

    def over_textures(values: Array) -> Array:
        """Return the mean of values, (n,), of each texture."""
        return np.array([values[at == number].mean() for number in range(len(codes))])

    errors, means = grades - true, over_textures(grades)
    within = np.sqrt(over_textures((grades - means[at]) ** 2).mean())
    base = 0.0 if (stds > 0).any() else np.sqrt(over_textures((means[at] - true) ** 2).mean())
    wanted = (NORMAL_90 / float(student.ppf(0.95, len(codes)))) ** 2

    def excess(log_scale: float) -> float:
        spread = Calibration(float(np.exp(log_scale)), float(base), float(within)).window_std(stds)
        return float(over_textures((errors / np.maximum(spread, 1e-9)) ** 2).mean()) - wanted

    low, high = np.log(SCALES)
    if excess(low) <= 0.0:
        scale = SCALES[0]
    elif excess(high) >= 0.0:
        scale = SCALES[1]
    else:
        scale = float(np.exp(brentq(excess, low, high)))
    return Calibration(scale, float(base), float(within)), {
        'calibration': f'{len(codes)} textures held out in turn',
        'held_out_error': round(float(over_textures(np.abs(errors)).mean()), 4),
        'held_out_without_grade': round(missing, 4),
    }

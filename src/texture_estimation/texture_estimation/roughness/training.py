"""Learn to grade from windows of textures that people graded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_estimation.learners.learner import Codes
from texture_estimation.roughness.checks import graded_columns, limits_of
from texture_estimation.roughness.grades import Grades
from texture_estimation.roughness.model import NORMAL_90, Calibration, RoughnessModel
from texture_estimation.roughness.regressor import RoughnessRegressor
from texture_estimation.roughness.roughness_recipe import RoughnessRecipe
from texture_features.labelled_features import LabelledFeatures

MIN_TEXTURES = 4  # to hold one out and train on the others
SCALES = (0.05, 20.0)


@dataclass(frozen=True, eq=False)
class HeldOutGrades:
    """What a regressor says of windows of textures that it has not seen, (n,) each; NaN where it gives no grade.

    Examples
    --------
    >>> held = HeldOutGrades(np.array([1.0, 2.0, np.nan]), np.ones(3), np.ones(3), np.array([0, 0, 1]))
    >>> held.graded.grades.tolist()
    [1.0, 2.0]
    """

    grades: Array
    stds: Array
    true: Array
    textures: Codes

    @property
    def graded(self) -> HeldOutGrades:
        """Those windows that got a grade."""
        rows = np.isfinite(self.grades)
        return HeldOutGrades(self.grades[rows], self.stds[rows], self.true[rows], self.textures[rows])

    def mean_over_textures(self, values: Array) -> float:
        """Return the mean of values, (n,), in which each texture counts alike.

        Parameters
        ----------
        values : (n,)
            A number for each window.
        """
        return float(np.mean([values[self.textures == code].mean() for code in np.unique(self.textures)]))


def train_grades(recipe: RoughnessRecipe, examples: LabelledFeatures, grades: Grades, name: str = '') -> RoughnessModel:
    """Return a model that grades as the people did who graded the textures of the examples.

    The standard deviation is calibrated on textures held out in turn, of the training alone.

    Parameters
    ----------
    recipe
        Names the head.
    examples
        Cut with `recipe.training_windows`.
    grades
        Of every texture in the examples.
    name
        Of the model; that of the recipe if ''.

    Returns
    -------
    RoughnessModel
        Ready to grade and to be stored.

    Raises
    ------
    InvalidData, UnknownName
        If there are no examples, a value is not finite, or a texture has no grade.
    """
    labels, codes = np.unique(examples.labels, return_inverse=True)
    table = {str(label): grades.of(str(label)) for label in labels}
    true = np.array([table[str(label)] for label in labels])[codes]
    _check(examples)
    columns = graded_columns(examples.names)
    values = examples.values[:, columns]
    held_out = hold_out(recipe.regressor, values, true, codes, recipe.training.folds)
    calibration, facts = calibrate(held_out)
    return RoughnessModel(
        name=name or recipe.name,
        names=examples.names,
        feature_set=examples.feature_set,
        recipe=recipe,
        parameters=recipe.regressor.fit(values, true, codes),
        calibration=calibration,
        limits=limits_of(recipe.checks, examples.names, examples.values),
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
) -> HeldOutGrades | None:
    """Return what is said of each texture by a regressor that trained on the others; None if there are too few.

    Parameters
    ----------
    regressor
        Regressor of the recipe.
    values : (n, n_features)
        Features of windows.
    true : (n,)
        Grade that people gave the texture of each.
    textures : (n,)
        Number of the texture of each.
    folds
        Number of parts into which the textures are divided.

    Returns
    -------
    HeldOutGrades or None
    """
    codes = np.unique(textures)
    if len(codes) < MIN_TEXTURES:
        return None
    grades, stds = np.empty(len(true)), np.empty(len(true))
    # Textures of like grade go to different parts, so that each part leaves some of every grade.
    order = codes[np.argsort([true[textures == code][0] for code in codes], kind='stable')]
    for part in range(min(folds, len(codes))):
        held = np.isin(textures, order[part :: min(folds, len(codes))])
        fitted = regressor.predictor(regressor.fit(values[~held], true[~held], textures[~held]))
        grades[held], stds[held] = fitted(values[held])
    return HeldOutGrades(grades, stds, true, textures)


def calibrate(held_out: HeldOutGrades | None) -> tuple[Calibration, Mapping[str, object]]:
    """Return the calibration, and facts for the card.

    The scale makes the mean square of error over standard deviation, each texture counting alike, what it is for a
    Student distribution with as many degrees of freedom as there are textures, whose 90 % interval ours then is.
    """
    if held_out is None:
        return Calibration(), {'calibration': f'not calibrated: fewer than {MIN_TEXTURES} textures'}
    graded = held_out.graded
    if not len(graded.grades):
        return Calibration(), {'calibration': 'not calibrated: no held-out window got a grade'}
    errors = graded.grades - graded.true
    codes = np.unique(graded.textures)
    # np.unique sorts, so codes index these tables by search.
    at = np.searchsorted(codes, graded.textures)
    means = np.array([graded.grades[at == number].mean() for number in range(len(codes))])
    within = np.sqrt(graded.mean_over_textures((graded.grades - means[at]) ** 2))
    knows = bool((graded.stds > 0).any())
    base = 0.0 if knows else np.sqrt(graded.mean_over_textures((means[at] - graded.true) ** 2))
    wanted = (NORMAL_90 / float(student.ppf(0.95, len(codes)))) ** 2

    def excess(log_scale: float) -> float:
        spread = Calibration(float(np.exp(log_scale)), float(base), float(within)).window_std(graded.stds)
        return graded.mean_over_textures((errors / np.maximum(spread, 1e-9)) ** 2) - wanted

    low, high = np.log(SCALES)
    if excess(low) <= 0.0:
        scale = SCALES[0]
    elif excess(high) >= 0.0:
        scale = SCALES[1]
    else:
        scale = float(np.exp(brentq(excess, low, high)))
    return Calibration(scale, float(base), float(within)), {
        'calibration': f'{len(codes)} textures held out in turn',
        'held_out_error': round(graded.mean_over_textures(np.abs(errors)), 4),
        'held_out_without_grade': round(1.0 - len(graded.grades) / len(held_out.grades), 4),
    }


def _check(examples: LabelledFeatures) -> None:
    bad = ~np.isfinite(examples.values).all(axis=0)
    if bad.any():
        name = examples.names[int(bad.argmax())]
        raise InvalidData(
            f"feature '{name}' and {int(bad.sum()) - 1} others are not finite; features of the surface need the speed "
            'of every slide: record it, or leave these features out of the recipe'
        )

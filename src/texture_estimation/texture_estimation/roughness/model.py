"""A trained roughness model: NAME.skops, which holds plain arrays only, and its card NAME.json."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.errors import ModelMismatch
from texture_estimation import model_files
from texture_estimation.roughness.checks import Checks, graded_columns
from texture_estimation.roughness.regressor import RegressorPredictor
from texture_estimation.roughness.roughness_recipe import RoughnessRecipe

NORMAL_90 = 1.6449  # a normal value lies so many standard deviations around its mean in 90 of 100 cases


@dataclass(frozen=True)
class Calibration:
    """What makes an honest standard deviation of the one that a regressor claims.

    Parameters
    ----------
    scale
        Factor on what is common to all windows of a texture.
    base_std
        Standard deviation, in grades, of what the regressor does not know of.
    within_std
        Standard deviation of the windows of one texture around their mean, in grades.

    Examples
    --------
    >>> calibration = Calibration(scale=2.0, within_std=0.3)
    >>> float(calibration.window_std(np.array(0.2))).__round__(2)  # √((2 · 0.2)² + 0.3²)
    0.5
    """

    scale: float = 1.0
    base_std: float = 0.0
    within_std: float = 0.0

    def shared_variance(self, regressor_std: Array | float) -> Array:
        """Return the variance that more sliding over the texture does not lessen.

        Parameters
        ----------
        regressor_std
            Standard deviation that the regressor gives, grades.

        Returns
        -------
        array of the same shape
            Square of grades.
        """
        variance: Array = self.scale**2 * (np.square(regressor_std) + self.base_std**2)
        return variance

    def window_std(self, regressor_std: Array) -> Array:
        """Return the standard deviation of the grade of a single window.

        Parameters
        ----------
        regressor_std : (...)
            Standard deviation that the regressor gives, grades.

        Returns
        -------
        (...)
            Grades.
        """
        return np.sqrt(self.shared_variance(regressor_std) + self.within_std**2)


@dataclass(frozen=True, eq=False)
class RoughnessModel:
    """Fitted parameters, and what is needed to grade a feature vector and to refuse an incompatible one.

    Parameters
    ----------
    name
        Of the model.
    names, feature_set
        Features it expects, and their fingerprint.
    recipe
        By which it was made.
    parameters
        Fitted parameters of the regressor: plain arrays.
    calibration
        Of the standard deviation.
    limits
        Of the checks.
    grades
        Of the training textures.
    training
        Facts about the training, for the card.

    Examples
    --------
    >>> import numpy as np
    >>> from texture_estimation.roughness.roughness_recipe import RoughnessRecipe
    >>> from texture_estimation.roughness.training import train_grades
    >>> from texture_estimation.roughness.grades import Grades
    >>> from texture_features.labelled_features import LabelledFeatures
    >>> inputs = {'signal': {'features': ['mean']}}
    >>> recipe = RoughnessRecipe.from_mapping({'inputs': inputs, 'regressor': 'gaussian_process'}, 'tiny')
    >>> labels = np.repeat(['silk', 'felt', 'cork', 'jute'], 10)
    >>> values = np.repeat([1.0, 2.0, 3.0, 4.0], 10)[:, None] + 0.1 * np.random.default_rng(0).standard_normal((40, 1))
    >>> examples = LabelledFeatures(values, labels, np.char.add(labels, '/1'), ('signal/mean',), 'a1', 0.5, 0.1)
    >>> model = train_grades(recipe, examples, Grades({'silk': 1.0, 'felt': 2.0, 'cork': 3.0, 'jute': 4.0}))
    >>> abs(float(model.grade(np.array([2.0]))[0]) - 2.0) < 0.5
    True
    """

    name: str
    names: tuple[str, ...]
    feature_set: str
    recipe: RoughnessRecipe
    parameters: Mapping[str, Any]
    calibration: Calibration
    limits: Mapping[str, float]
    grades: Mapping[str, float]
    training: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def predictor(self) -> RegressorPredictor:
        """The head as plain arrays; it sees the features that are no checks."""
        return self.recipe.regressor.predictor(self.parameters)

    @cached_property
    def checks(self) -> Checks:
        """What tells whether a window can be graded."""
        return Checks(self.recipe.checks, self.names, self.limits)

    @cached_property
    def _columns(self) -> NDArray[np.intp]:
        return graded_columns(self.names)

    def grade(self, X: Array) -> tuple[Array, Array]:
        """Return grade and the regressor's own standard deviation, (...) each, of (..., n_features).

        Parameters
        ----------
        X : (..., n_features)

        Returns
        -------
        (...)
            Grade, 1 to 5.
        (...)
            Standard deviation, grades.
        """
        return self.predictor(X.take(self._columns, axis=-1))

    @property
    def card(self) -> dict[str, Any]:
        """What the card says, in the form of JSON."""
        return {
            'format': model_files.FORMAT,
            'name': self.name,
            'target': 'roughness grade, 1 (smooth) to 5 (rough), as people give it: an opinion, not a depth',
            'feature_set': self.feature_set,
            'features': list(self.names),
            'grades': dict(self.grades),
            'calibration': asdict(self.calibration),
            'limits': dict(self.limits),
            'training': dict(self.training),
            'recipe': self.recipe.as_mapping(),
            'recipe_name': self.recipe.name,
        }

    def save(self, path: str | Path, facts: Mapping[str, Any] | None = None) -> Path:
        """Write NAME.skops and NAME.json; `facts` are added to the card. Return NAME.skops."""
        return model_files.write(path, self.parameters, {**self.card, **(facts or {})})


def load_roughness_model(path: str | Path) -> RoughnessModel:
    """Read a model; `path` is that of either file, or of both without the ending. No code in the file is run.

    Raises
    ------
    ModelMismatch
        With one sentence, if a file is missing, damaged, foreign or does not belong to the other.
    """
    target = model_files.stem(path)
    card, content = model_files.read(path)
    if 'regressor' not in card.get('recipe', {}):
        raise ModelMismatch(f"model '{target}' classifies textures; load it in the classifier")
    with model_files.usable(target):
        model = RoughnessModel(
            name=str(card['name']),
            names=tuple(map(str, card['features'])),
            feature_set=str(card['feature_set']),
            recipe=RoughnessRecipe.from_mapping(card['recipe'], str(card['recipe_name'])),
            parameters=model_files.load_parameters(content, ()),
            calibration=Calibration(**card['calibration']),
            limits=dict(card['limits']),
            grades=dict(card['grades']),
            training=dict(card['training']),
        )
        grade, std = model.grade(np.zeros(len(model.names)))
    if np.shape(grade) or np.shape(std):
        raise ModelMismatch(f"model '{target}' answers with more than one grade; train it again")
    return model

"""A roughness recipe: windows, inputs and features, head, checks and evidence, in one YAML file."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidParameter
from texture_core.parameters import from_mapping, param
from texture_estimation.recipe import TrainingParams
from texture_estimation.roughness.catalogue import REGRESSORS
from texture_estimation.roughness.checks import CheckParams
from texture_estimation.roughness.regressor import RoughnessRegressor
from texture_features.feature_set import FeatureSet
from texture_features.recipe_entry import choose
from texture_features.recipe_file import read_recipe
from texture_features.windowing.windows import WindowParams

KEYS = ('description', 'windows', 'inputs', 'regressor', 'checks', 'evidence', 'training')


@dataclass(frozen=True)
class EvidenceParams:
    """When a grade is final before the slide ends."""

    min_narrowing_grades: float = param(
        0.1,
        'The grade is final once more sliding would narrow its 90 % interval by less; 0: only at the end.',
        low=0.0,
        high=5.0,
    )
    min_windows: int = param(3, 'Smallest number of graded windows before a grade can be final.', low=1, high=10_000)


@dataclass(frozen=True)
class CalibrationParams(TrainingParams):
    """How the examples for training are cut, and on what the interval is calibrated."""

    folds: int = param(
        15,
        'Sets the number of folds of textures for the calibration; at most one per texture is possible.',
        low=2,
        high=1000,
    )


@dataclass(frozen=True)
class RoughnessRecipe:
    """What turns a signal into a grade, before any training.

    Examples
    --------
    >>> recipe = RoughnessRecipe.from_mapping({'inputs': {'signal': {'features': ['hjorth']}}}, 'mine')
    >>> recipe.training == CalibrationParams(), recipe.evidence == EvidenceParams()
    (True, True)
    """

    name: str
    feature_set: FeatureSet
    regressor_name: str
    regressor: RoughnessRegressor
    checks: CheckParams = field(default_factory=CheckParams)
    evidence: EvidenceParams = field(default_factory=EvidenceParams)
    training: CalibrationParams = field(default_factory=CalibrationParams)
    description: str = ''

    @property
    def training_windows(self) -> WindowParams:
        """How to cut the windows that are used for training."""
        return dataclasses.replace(self.feature_set.windows, hop_s=self.training.hop_s)

    @classmethod
    def from_mapping(cls, content: Mapping[str, Any], name: str) -> RoughnessRecipe:
        """Build from what a recipe file holds.

        Raises
        ------
        InvalidParameter, UnknownName
            With the place in the recipe and what is allowed there.
        """
        where = f"roughness recipe '{name}'"
        for key in content:
            if key not in KEYS:
                raise InvalidParameter(f'{where}: {unknown_name(str(key), KEYS, "key")}')
        return cls(
            name,
            FeatureSet.from_mapping(content, where),
            *choose(REGRESSORS, content.get('regressor', 'gaussian_process'), 'regressor', where),
            from_mapping(CheckParams, content.get('checks') or {}, f'{where}, checks'),
            from_mapping(EvidenceParams, content.get('evidence') or {}, f'{where}, evidence'),
            from_mapping(CalibrationParams, content.get('training') or {}, f'{where}, training'),
            str(content.get('description', '')),
        )

    def as_mapping(self) -> dict[str, Any]:
        """Return the recipe as a file writes it, every parameter spelt out."""
        return {
            'description': self.description,
            **self.feature_set.as_mapping(),
            'regressor': {self.regressor_name: dataclasses.asdict(self.regressor)},
            'checks': dataclasses.asdict(self.checks),
            'evidence': dataclasses.asdict(self.evidence),
            'training': dataclasses.asdict(self.training),
        }


def load_roughness_recipe(name_or_path: str) -> RoughnessRecipe:
    """Read a recipe that the package ships in config/roughness, or any by path; a model's card holds one too.

    Raises
    ------
    UnknownName, InvalidParameter
        With one sentence that says what is wrong and what is allowed.
    """
    name, content = read_recipe(name_or_path, 'config/roughness', 'roughness recipe')
    return RoughnessRecipe.from_mapping(content, name)

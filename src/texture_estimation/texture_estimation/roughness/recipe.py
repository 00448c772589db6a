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
from texture_estimation.roughness.catalogue import HEADS
from texture_estimation.roughness.checks import CheckParams
from texture_estimation.roughness.head import Head
from texture_features.choice import choose
from texture_features.feature_set import FeatureSet
from texture_features.recipe_file import read_recipe
from texture_features.windowing.windows import WindowParams

KEYS = ('description', 'windows', 'inputs', 'head', 'checks', 'evidence', 'training')


@dataclass(frozen=True)
class EvidenceParams:
    """When a grade is final before the slide ends."""

    narrow_grades: float = param(
        0.1,
        'A grade is final once more sliding could narrow its 90 % interval by less than this; 0: at the end only.',
        low=0.0,
        high=5.0,
    )
    least_windows: int = param(3, 'Graded windows without which none is final before the end.', low=1, high=10_000)


@dataclass(frozen=True)
class CalibrationParams(TrainingParams):
    """How the examples for training are cut, and on what the interval is calibrated."""

    folds: int = param(
        15, 'Parts into which the textures are divided to be held out; at most one a texture.', low=2, high=1000
    )


@dataclass(frozen=True)
class RoughnessRecipe:
    """What turns a signal into a grade, before anything is learnt."""

    name: str
    feature_set: FeatureSet
    head_name: str
    head: Head
    checks: CheckParams = field(default_factory=CheckParams)
    evidence: EvidenceParams = field(default_factory=EvidenceParams)
    training: CalibrationParams = field(default_factory=CalibrationParams)
    description: str = ''

    @property
    def training_windows(self) -> WindowParams:
        """How to cut the windows that are learnt from."""
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
        head_name, head = choose(HEADS, content.get('head', 'gaussian_process'), 'head', where)
        return cls(
            name,
            FeatureSet.from_mapping(content, where),
            head_name,
            head,
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
            'head': {self.head_name: dataclasses.asdict(self.head)},
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

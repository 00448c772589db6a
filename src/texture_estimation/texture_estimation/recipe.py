# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A recipe: windows, inputs and features, learner and evidence rule, in one YAML file."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from texture_core.config import from_mapping, param, unknown_name
from texture_core.errors import InvalidParameter
from texture_estimation.acceptance import Rates
from texture_estimation.domain import FORCE_MARGIN, SPEED_MARGIN
from texture_estimation.evidence_rules import EVIDENCE_RULES, EvidenceRule
from texture_estimation.learners.discriminant import Discriminant, ForceDiscriminant
from texture_estimation.learners.learner import Learner, extras_of
from texture_estimation.learners.mlp import Mlp
from texture_estimation.learners.sklearn_learner import SklearnLearner
from texture_features.augmentation import Augmentation
from texture_features.feature_set import FeatureSet, choose, entry_of, read_recipe
from texture_features.windows import WindowParams

# --------------------
# The learners that a recipe can name, and the recipe.

LEARNERS: Mapping[str, type[Learner]] = {
    'mlp': Mlp,  # one hidden layer, softmax, calibrated
    'discriminant': Discriminant,  # Fisher 1936, shrunk as Friedman 1989, calibrated
    'force_discriminant': ForceDiscriminant,  # one for each range of forces
    'sklearn': SklearnLearner,  # any classifier of scikit-learn
}

KEYS = ('description', 'windows', 'inputs', 'learner', 'evidence', 'training')
AUGMENTATION = 'augmentation'  # section within `training`
SPEEDS = 5  # from the slowest to the fastest, for windows of as many lengths


def check_keys(content: Mapping[str, Any], known: Sequence[str], where: str) -> None:
    """Raise InvalidParameter if a mapping has another key than the known ones, with the nearest of these."""
    for key in content:
        if key not in known:
            raise InvalidParameter(f'{where}: {unknown_name(str(key), known, "key")}')


@dataclass(frozen=True)
class TrainingParams:
    """How the examples for training are cut."""

    hop_s: float = param(
        0.25,
        'Time between the starts of two training windows; a smaller one costs time and adds little.',
        unit='s',
        low=0.001,
        high=60.0,
    )


@dataclass(frozen=True)
class DecisionParams(TrainingParams):
    """How the examples for training are cut, how they count, and how rarely decisions made with them may err."""

    start_weight: int = param(
        1,
        'Weight of the first windows of a slide in training, while friction and sensor settle; a '
        'larger one counts them more.',
        low=1,
        high=100,
    )
    max_accepted_wrong: float = param(
        0.033,
        'Largest fraction of held-out slides, tried once as they are and once with their label taken out of the model, '
        'that may be accepted under a wrong label; a smaller one accepts less, and needs more slides.',
        low=0.001,
        high=0.2,
    )
    false_rejection_rate: float = param(
        0.04,
        'Fraction of the slides with the right label that may be rejected as soon as they are long enough; a smaller '
        'one accepts more unknown surfaces.',
        low=0.0,
        high=0.5,
    )
    max_error_rate: float = param(
        0.02, 'Largest fraction of wrong decisions when slides are stopped early; 0: none is.', low=0.0, high=1.0
    )
    coverage: float = param(
        0.95, 'Coverage of the prediction set: fraction of slides whose texture it contains.', low=0.5, high=0.999
    )
    held_out_places: int = param(
        1,
        'Number of parts of the track into which slides over one track are cut: what is fitted to '
        'held-out slides is fitted to held-out parts of the track, as places that the training does not have; 1: none.',
        low=1,
        high=20,
    )
    slowest_m_s: float = param(
        0.0,
        'Lowest speed at which surfaces will be explored: further training windows show as little of a '
        'surface as one shows at this speed; 0: none.',
        unit='m/s',
        low=0.0,
        high=10.0,
    )
    fastest_m_s: float = param(
        0.0,
        'Highest speed at which surfaces will be explored: further training windows show as much of a surface '
        'as one shows at this speed; 0: none.',
        unit='m/s',
        low=0.0,
        high=10.0,
    )
    speed_margin: float = param(
        SPEED_MARGIN,
        'How far the speed of an exploration may lie outside the speeds of the training, relative to them; '
        'beyond, the estimate is rejected as outside the training.',
        low=0.0,
        high=100.0,
    )
    force_margin: float = param(
        FORCE_MARGIN,
        'How far the force of an exploration may lie outside the forces of the training, relative to them; '
        'beyond, the estimate is rejected as outside the training.',
        low=0.0,
        high=100.0,
    )

    def __post_init__(self) -> None:
        if self.slowest_m_s > self.fastest_m_s or (self.fastest_m_s > 0.0 and not self.slowest_m_s):
            raise InvalidParameter(
                f'training: slowest_m_s is {self.slowest_m_s:g} and fastest_m_s is {self.fastest_m_s:g}; '
                'give both, the lower speed first, or neither'
            )

    def distances_m(self, window_s: float) -> tuple[float, ...]:
        """Return how far the finger slides in a window at the slowest to the fastest speed, m; () without speeds."""
        if not self.slowest_m_s:
            return ()
        ratio = self.fastest_m_s / self.slowest_m_s
        return tuple(self.slowest_m_s * window_s * ratio ** (step / (SPEEDS - 1)) for step in range(SPEEDS))

    @property
    def rates(self) -> Rates:
        """Allowed error rates of the decisions about a slide."""
        return Rates(self.max_accepted_wrong, self.false_rejection_rate, self.max_error_rate, self.coverage)


@dataclass(frozen=True)
class Recipe:
    """What turns a signal into a decision, before any training.

    Examples
    --------
    >>> recipe = Recipe.from_mapping({'inputs': {'signal': {'features': ['hjorth']}}, 'learner': 'mlp'}, 'mine')
    >>> recipe.feature_set.topics, recipe.evidence_name
    (('signal',), 'soft_vote')
    """

    name: str
    feature_set: FeatureSet
    learner_name: str
    learner: Learner
    evidence_name: str
    evidence: EvidenceRule
    training: DecisionParams = dataclasses.field(default_factory=DecisionParams)
    description: str = ''
    augmentation: Augmentation = dataclasses.field(default_factory=Augmentation)

    @property
    def training_windows(self) -> WindowParams:
        """How to cut the windows that `train` is trained on."""
        return dataclasses.replace(self.feature_set.windows, hop_s=self.training.hop_s)

    @classmethod
    def from_mapping(cls, content: Mapping[str, Any], name: str) -> Recipe:
        """Build from what a recipe file holds.

        Raises
        ------
        InvalidParameter, UnknownName
            With the place in the recipe and what is allowed there.
        """
        where = f"recipe '{name}'"
        check_keys(content, KEYS, where)
        learner = choose(LEARNERS, content.get('learner', 'mlp'), 'learner', where)
        evidence = choose(EVIDENCE_RULES, content.get('evidence', 'soft_vote'), 'evidence rule', where)
        training, augmentation = _training(content.get('training') or {}, where)
        if augmentation.copies and 'augmented' not in extras_of(learner[1]):
            raise InvalidParameter(
                f"{where}: training is augmented, but learner '{learner[0]}' cannot be trained so; use 'mlp' or remove "
                "the section 'augmentation'"
            )
        return cls(
            name,
            FeatureSet.from_mapping(content, where),
            *learner,
            *evidence,
            training,
            str(content.get('description', '')),
            augmentation,
        )

    def as_mapping(self) -> dict[str, Any]:
        """Return the recipe as a file writes it, every parameter spelt out."""
        augmentation = {AUGMENTATION: dataclasses.asdict(self.augmentation)} if self.augmentation.copies else {}
        return {
            'description': self.description,
            **self.feature_set.as_mapping(),
            'learner': {self.learner_name: entry_of(self.learner)},
            'evidence': {self.evidence_name: dataclasses.asdict(self.evidence)},
            'training': {**dataclasses.asdict(self.training), **augmentation},
        }


def _training(section: Any, where: str) -> tuple[DecisionParams, Augmentation]:
    """Return the parameters of the section `training`, and those of the section for augmentation."""
    augmentation: Any = {}
    if isinstance(section, Mapping):
        augmentation = section.get(AUGMENTATION) or {}
        section = {name: value for name, value in section.items() if name != AUGMENTATION}
    return (
        from_mapping(DecisionParams, section, f'{where}, training'),
        from_mapping(Augmentation, augmentation, f'{where}, training, augmentation'),
    )


def load_recipe(name_or_path: str) -> Recipe:
    """Read a shipped recipe by name, or any by path; a model's card also holds one.

    Raises
    ------
    UnknownName, InvalidParameter
        With one sentence that states what is wrong and what is allowed.
    """
    name, content = read_recipe(name_or_path)
    return Recipe.from_mapping(content, name)


FAST_TOPIC = 'signal'  # the vibration

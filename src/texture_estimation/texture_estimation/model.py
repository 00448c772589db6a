"""A trained model, and the files that hold it: NAME.skops, the card NAME.json, and what it was taught since.

What a model is taught after its training stands in the folder NAME.lessons; the two files stay as they are.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import ModelMismatch
from texture_estimation import model_files
from texture_estimation.incremental.added_examples import Lesson, read_lessons
from texture_estimation.incremental.examples import Examples
from texture_estimation.incremental.ridge_classifier import TaughtHead
from texture_estimation.learners.learner import LogProbabilities
from texture_estimation.log_probabilities import log_softmax, undecided
from texture_estimation.next_motion.choice import Explorations
from texture_estimation.open_set.novelty import Familiarity
from texture_estimation.open_set.prediction_sets import PredictionSets
from texture_estimation.open_set.stopping import Stopping
from texture_estimation.recipe import Recipe

# Names of their parts in the file.
EXAMPLES, FAMILIARITY, EXPLORATIONS = 'examples', 'familiarity', 'explorations'
# What a model file may hold beyond plain values and arrays; anything else is refused before it is built.
TRUSTED = ('sklearn.preprocessing._data.StandardScaler', 'sklearn.svm._classes.SVC')


@dataclass(frozen=True, eq=False)
class Model:
    """What was learnt, with all that is needed to judge a feature vector and to refuse a foreign one.

    Parameters
    ----------
    name
        Of the model.
    labels
        Textures it knows, in the order of the probabilities; those it was taught last.
    names, feature_set
        Features it expects, and their fingerprint.
    recipe
        By which it was made.
    parts
        What the learner has learnt, as the file stores it.
    growth
        Exponent with which the evidence of a slide grows, 0 to 1.
    training
        Facts about the training, for the card.
    stopping
        When a slide may end.
    sets
        Which textures are candidates.
    familiarity
        Tells unknown surfaces; None takes all for known.
    explorations
        What textures feel like under each motion, to choose the next one; None if the slides were all of one kind.
    examples
        Windows it was trained on, to learn more beside them; None if it holds none.
    lessons
        What it was taught after the training.
    taught
        What judges since then; None if nothing was taught.
    """

    name: str
    labels: tuple[str, ...]
    names: tuple[str, ...]
    feature_set: str
    recipe: Recipe
    parts: Mapping[str, Any]
    growth: float
    training: Mapping[str, Any] = field(default_factory=dict)
    stopping: Stopping = field(default_factory=Stopping)
    sets: PredictionSets = field(default_factory=PredictionSets)
    familiarity: Familiarity | None = None
    explorations: Explorations | None = None
    examples: Examples | None = None
    lessons: tuple[Lesson, ...] = ()
    taught: LogProbabilities | None = None

    @cached_property
    def judge(self) -> LogProbabilities:
        """The learner as plain arrays, or what judges since the model was taught."""
        if self.taught is not None:
            return self.taught
        return self.recipe.learner.array_form(self.parts)

    @cached_property
    def familiar(self) -> Familiarity | None:
        """What tells unknown surfaces, knowing the slides of the lessons, too."""
        if self.familiarity is None or not self.lessons:
            return self.familiarity
        windows = self.recipe.feature_set.windows
        overlap = min(windows.hop_s / windows.length_s, 1.0)
        return self.familiarity.with_slides([lesson.values for lesson in self.lessons], overlap)

    def predict_log_proba(self, values: Array) -> Array:
        """Return the log-probability of each label, (..., n_labels) of (..., n_features)."""
        return log_softmax(self.judge(values))

    def decide(self, values: Array) -> list[str]:
        """Return the label of each window alone, (n,) of (n, n_features); '' where several labels are equally good."""
        log_probabilities = self.predict_log_proba(values)
        best = log_probabilities.argmax(axis=-1).tolist()
        none = undecided(log_probabilities).tolist()
        return ['' if tied else self.labels[index] for index, tied in zip(best, none, strict=True)]

    def with_lessons(self, lessons: tuple[Lesson, ...]) -> Model:
        """Return the model with these lessons instead of its own; it judges as before until `taught` is set anew."""
        new = dict.fromkeys(lesson.label for lesson in lessons if lesson.label not in self.trained_labels)
        return replace(self, labels=(*self.trained_labels, *new), lessons=lessons)

    @property
    def trained_labels(self) -> tuple[str, ...]:
        """Textures known from the training."""
        return self.labels[: int(self.examples.codes.max()) + 1] if self.examples else self.labels

    def examples_of(self, label: str) -> Array:
        """Return what is known of a label from training and lessons, (n, n_features)."""
        known = self.examples.of_label(self.labels.index(label)) if self.examples and label in self.labels else None
        own = [lesson.values for lesson in self.lessons if lesson.label == label]
        return np.concatenate([np.empty((0, len(self.names))) if known is None else known, *own])

    def taught_head(self) -> TaughtHead:
        """Return what can be taught more, knowing what the model was trained on and taught.

        Raises
        ------
        ModelMismatch
            If the model holds no examples to learn beside.
        """
        if self.examples is None:
            raise ModelMismatch(f"model '{self.name}' holds no examples to learn beside; train it again")
        known = self.examples
        head = TaughtHead(
            known.values.astype(np.float64),
            known.codes,
            known.slides,
            parts=self.parts if self.recipe.learner_name == 'mlp' else None,
            trained=self.recipe.learner.array_form(self.parts),
        )
        for label in dict.fromkeys(lesson.label for lesson in self.lessons):
            head.set_examples(self.labels.index(label), self.examples_of(label))
        return head

    def try_out(self) -> None:
        """Use every part once on a window of zeros: what does not fit the others, or is no number, raises now."""
        nothing = np.zeros(len(self.names))
        answer = self.predict_log_proba(nothing)
        if answer.shape != (len(self.labels),) or np.isnan(answer).any():
            raise ModelMismatch(f'it answers {answer.shape} numbers, its card names {len(self.labels)} labels')
        self.sets.members(np.exp(answer), 1.0)
        self.stopping.certain(0.5, 1.0)
        if self.familiarity is not None:
            self.familiarity.knows(nothing, 1.0)
        if self.explorations is not None:
            self.explorations.check(nothing)
        if self.examples is not None:
            self.examples.check(len(self.names), len(self.labels))
        if not 0.0 <= self.growth <= 1.0:
            raise ModelMismatch(f'the exponent of its evidence is {self.growth}; allowed is 0 to 1')

    @property
    def card(self) -> dict[str, Any]:
        """What the card says, in the form of JSON."""
        return {
            'format': model_files.FORMAT,
            'name': self.name,
            'labels': list(self.trained_labels),
            'feature_set': self.feature_set,
            'features': list(self.names),
            'growth': self.growth,
            'stopping': asdict(self.stopping),
            'sets': asdict(self.sets),
            'motions': [asdict(motion) for motion in self.explorations.felt] if self.explorations else [],
            'training': dict(self.training),
            'recipe': self.recipe.as_mapping(),
            'recipe_name': self.recipe.name,
        }

    def save(self, path: str | Path, facts: Mapping[str, Any] | None = None) -> Path:
        """Write NAME.skops and NAME.json; `facts`, such as accuracies, are added to the card. Return NAME.skops.

        Lessons are not written: they stand beside the model that was taught.
        """
        more = {EXAMPLES: self.examples, FAMILIARITY: self.familiarity, EXPLORATIONS: self.explorations}
        kept = {name: part.as_parts() for name, part in more.items() if part}
        return model_files.write(path, {**self.parts, **kept}, {**self.card, **(facts or {})})


def load_model(path: str | Path) -> Model:
    """Read a model with what it was taught. No code in the files is run.

    Parameters
    ----------
    path
        Of either file, or of both without the ending.

    Raises
    ------
    ModelMismatch
        With one sentence, if a file is missing, damaged, foreign or does not belong to the other.
    """
    target = model_files.stem(path)
    card, content = model_files.read(target)
    if 'head' in card.get('recipe', {}):
        raise ModelMismatch(f"model '{target}' gives grades of roughness; the roughness_estimator takes it")
    try:
        recipe = Recipe.from_mapping(card['recipe'], str(card['recipe_name']))
        parts = model_files.parts_of(content, TRUSTED)
        examples, familiarity, felt = (parts.pop(name, None) for name in (EXAMPLES, FAMILIARITY, EXPLORATIONS))
        model = Model(
            name=str(card['name']),
            labels=tuple(map(str, card['labels'])),
            names=tuple(map(str, card['features'])),
            feature_set=str(card['feature_set']),
            recipe=recipe,
            parts=parts,
            growth=float(card['growth']),
            training=dict(card['training']),
            stopping=Stopping(**card['stopping']),
            sets=PredictionSets(**{name: _tuples(value) for name, value in card['sets'].items()}),
            familiarity=Familiarity.from_parts(familiarity) if familiarity else None,
            explorations=Explorations.from_parts(felt) if felt else None,
            examples=Examples.from_parts(examples) if examples else None,
        )
        model.try_out()
    except model_files.BROKEN as error:
        raise ModelMismatch(
            f"model '{target}' cannot be used: {type(error).__name__}: {error}; train it again"
        ) from error
    lessons = read_lessons(target, model.feature_set, model.names)
    if not lessons:
        return model
    taught = model.with_lessons(lessons)
    try:
        return replace(taught, taught=taught.taught_head().judge)
    except model_files.BROKEN as error:
        raise ModelMismatch(f"the lessons of model '{target}' cannot be used: {error}; move them away") from error


def _tuples(value: Any) -> Any:
    return tuple(map(float, value)) if isinstance(value, list) else float(value)

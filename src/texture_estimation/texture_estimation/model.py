"""A trained model, and the two files that hold it: NAME.skops and the card NAME.json."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import ModelMismatch, TextureError
from texture_estimation import model_files
from texture_estimation.learners.learner import LogProbabilities
from texture_estimation.log_probabilities import log_softmax, undecided
from texture_estimation.recipe import Recipe

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
        Textures it knows, in the order of the probabilities.
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
    """

    name: str
    labels: tuple[str, ...]
    names: tuple[str, ...]
    feature_set: str
    recipe: Recipe
    parts: Mapping[str, Any]
    growth: float
    training: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def judge(self) -> LogProbabilities:
        """The learner as plain arrays."""
        return self.recipe.learner.array_form(self.parts)

    def predict_log_proba(self, values: Array) -> Array:
        """Return the log-probability of each label, (..., n_labels) of (..., n_features)."""
        return log_softmax(self.judge(values))

    def decide(self, values: Array) -> list[str]:
        """Return the label of each window alone, (n,) of (n, n_features); '' where several labels are equally good."""
        log_probabilities = self.predict_log_proba(values)
        best = log_probabilities.argmax(axis=-1).tolist()
        none = undecided(log_probabilities).tolist()
        return ['' if tied else self.labels[index] for index, tied in zip(best, none, strict=True)]

    @property
    def card(self) -> dict[str, Any]:
        """What the card says, in the form of JSON."""
        return {
            'format': model_files.FORMAT,
            'name': self.name,
            'labels': list(self.labels),
            'feature_set': self.feature_set,
            'features': list(self.names),
            'growth': self.growth,
            'training': dict(self.training),
            'recipe': self.recipe.as_mapping(),
            'recipe_name': self.recipe.name,
        }

    def save(self, path: str | Path, facts: Mapping[str, Any] | None = None) -> Path:
        """Write NAME.skops and NAME.json; `facts`, such as accuracies, are added to the card. Return NAME.skops."""
        return model_files.write(path, self.parts, {**self.card, **(facts or {})})


def load_model(path: str | Path) -> Model:
    """Read a model; `path` is that of either file, or of both without the ending. No code in the file is run.

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
        model = Model(
            name=str(card['name']),
            labels=tuple(map(str, card['labels'])),
            names=tuple(map(str, card['features'])),
            feature_set=str(card['feature_set']),
            recipe=recipe,
            parts=model_files.parts_of(content, TRUSTED),
            growth=float(card['growth']),
            training=dict(card['training']),
        )
        answer = model.predict_log_proba(np.zeros(len(model.names)))
    except (KeyError, TypeError, ValueError, AttributeError, zipfile.BadZipFile, TextureError) as error:
        raise ModelMismatch(
            f"model '{target}' cannot be used: {type(error).__name__}: {error}; train it again"
        ) from error
    if answer.shape != (len(model.labels),):
        raise ModelMismatch(
            f"model '{target}' answers for {answer.shape} labels but its card names {len(model.labels)}; train it again"
        )
    return model

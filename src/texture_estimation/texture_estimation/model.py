"""A trained model, and the two files that hold it: NAME.skops and the card NAME.json."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import ModelMismatch, TextureError
from texture_estimation.learners.learner import LogProbabilities
from texture_estimation.log_probabilities import undecided
from texture_estimation.recipe import Recipe

FORMAT = 1
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
        return self.judge(values)

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
            'format': FORMAT,
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
        """Write NAME.skops and NAME.json; `facts`, such as accuracies, are added to the card. Return NAME.skops.

        A reader never sees half a file: both are written beside their places and then moved.
        """
        from skops.io import dumps  # noqa: PLC0415  # takes a second, and only who saves or loads needs it

        target = _stem(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        content = dumps(dict(self.parts), compression=zipfile.ZIP_DEFLATED, compresslevel=1)
        card = {**self.card, **(facts or {}), 'sha256': hashlib.sha256(content).hexdigest()}
        _replace(target.with_name(f'{target.name}.skops'), content)
        _replace(target.with_name(f'{target.name}.json'), (json.dumps(card, indent=1) + '\n').encode())
        return target.with_name(f'{target.name}.skops')


def load_model(path: str | Path) -> Model:
    """Read a model; `path` is that of either file, or of both without the ending. No code in the file is run.

    Raises
    ------
    ModelMismatch
        With one sentence, if a file is missing, damaged, foreign or does not belong to the other.
    """
    target = _stem(path)
    card = _read_card(target.with_name(f'{target.name}.json'))
    content = _read_parts(target.with_name(f'{target.name}.skops'), str(card.get('sha256')))
    try:
        recipe = Recipe.from_mapping(card['recipe'], str(card['recipe_name']))
        model = Model(
            name=str(card['name']),
            labels=tuple(map(str, card['labels'])),
            names=tuple(map(str, card['features'])),
            feature_set=str(card['feature_set']),
            recipe=recipe,
            parts=_load_parts(content),
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


def _load_parts(content: bytes) -> dict[str, Any]:
    from skops.io import get_untrusted_types, loads  # noqa: PLC0415

    unexpected = sorted(set(get_untrusted_types(data=content)) - set(TRUSTED))
    if unexpected:
        raise ModelMismatch(f'it holds {", ".join(unexpected)}, which no model of this suite holds')
    parts = loads(content, trusted=list(TRUSTED))
    return dict(parts)


def _read_card(path: Path) -> dict[str, Any]:
    try:
        card = json.loads(path.read_text(encoding='utf-8'))
    except (OSError, ValueError) as error:
        raise ModelMismatch(f"model card '{path}' cannot be read: {error}; give the path of a trained model") from error
    if not isinstance(card, dict) or card.get('format') != FORMAT:
        raise ModelMismatch(f"'{path}' is not the card of a model of format {FORMAT}; give the path of a trained model")
    return card


def _read_parts(path: Path, digest: str) -> bytes:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ModelMismatch(f"model file '{path}' cannot be read: {error}; it belongs beside its card") from error
    if hashlib.sha256(content).hexdigest() != digest:
        raise ModelMismatch(f"model file '{path}' is damaged or of another card; copy both files again or train again")
    return content


def _stem(path: str | Path) -> Path:
    path = Path(path).expanduser()
    return path.with_suffix('') if path.suffix in ('.skops', '.json') else path


def _replace(path: Path, content: bytes) -> None:
    beside = path.with_name(f'.{path.name}.{os.getpid()}')
    try:
        beside.write_bytes(content)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)

"""What a model was taught after its training, and the folder NAME.lessons beside it that holds it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import ModelMismatch
from texture_core.files import MB
from texture_core.plain_data import load_json
from texture_estimation import model_files

FORMAT = 1
MAX_BYTES = 20 * MB  # of a file; a slide of a minute with 200 features has 5


@dataclass(frozen=True, eq=False)
class Lesson:
    """One slide over a known surface: its label, and the features of its windows, (n, n_features)."""

    label: str
    exploration_id: str
    values: Array


def write_lesson(model: str | Path, number: int, lesson: Lesson, feature_set: str) -> Path:
    """Write the lesson with a number, from 1, of a model; a reader never sees half a file."""
    content = {
        'format': FORMAT,
        'feature_set': feature_set,
        'label': lesson.label,
        'exploration_id': lesson.exploration_id,
        'values': lesson.values.tolist(),
    }
    path = _folder(model) / f'{number:05d}.json'
    path.parent.mkdir(parents=True, exist_ok=True)
    model_files.replace(path, (json.dumps(content) + '\n').encode())
    return path


def remove_lesson(model: str | Path, number: int) -> None:
    """Remove a lesson; one that is not there is no fault."""
    (_folder(model) / f'{number:05d}.json').unlink(missing_ok=True)


def read_lessons(model: str | Path, feature_set: str, names: Sequence[str]) -> tuple[Lesson, ...]:
    """Return the lessons of a model in their order; none if there is no folder.

    They hold features, so they stay valid when the model is trained anew with the same features.

    Raises
    ------
    ModelMismatch
        If one is damaged, or holds features of another kind.
    """
    return tuple(_read(path, feature_set, len(names)) for path in sorted(_folder(model).glob('*.json')))


def _read(path: Path, feature_set: str, n_features: int) -> Lesson:
    try:
        content = load_json(path, MAX_BYTES)
        values = np.array(content['values'], dtype=np.float64)
        lesson = Lesson(str(content['label']), str(content['exploration_id']), values)
        of = str(content['feature_set'])
        if not np.isfinite(values).all():
            raise ValueError('it holds values that are not finite')
    except (OSError, ValueError, KeyError, TypeError, OverflowError) as error:
        raise ModelMismatch(
            f"lesson '{path}' cannot be read: {type(error).__name__}: {error}; remove it and teach it again"
        ) from error
    if of != feature_set or values.ndim != 2 or values.shape[1] != n_features or not lesson.label:
        raise ModelMismatch(
            f"lesson '{path}' is of the features '{of}', the model has '{feature_set}'; "
            f"move the folder '{path.parent.name}' away, or use the model that was taught"
        )
    return lesson


def _folder(model: str | Path) -> Path:
    stem = model_files.stem(model)
    return stem.with_name(f'{stem.name}.lessons')

"""Slides added to a model after its training, stored in the folder NAME.added beside it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import ModelMismatch
from texture_core.files import MB
from texture_core.plain_data import load_json
from texture_estimation import model_files
from texture_features.slide_conditions import SlideConditions

FORMAT = 1
MAX_BYTES = 20 * MB  # of a file; a slide of a minute with 200 features has 5


@dataclass(frozen=True, eq=False)
class AddedSlide:
    """One slide over a known surface.

    Parameters
    ----------
    label
        Of the surface.
    exploration_id
        Of the slide.
    values : (n, n_features)
        Features of its windows.
    conditions
        How it was made, as far as it is known.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_added_slide(f'{folder}/model', 1, AddedSlide('oak', 'slide', np.ones((3, 1))), 'a1')
    ...     [slide] = read_added_slides(f'{folder}/model', 'a1', ('mean',))
    >>> slide.label, slide.values.shape
    ('oak', (3, 1))
    """

    label: str
    exploration_id: str
    values: Array
    conditions: SlideConditions = field(default_factory=SlideConditions)


def write_added_slide(model: str | Path, number: int, added_slide: AddedSlide, feature_set: str) -> Path:
    """Write an added slide of a model by its number, from 1, atomically.

    Parameters
    ----------
    model
        Path of the model.
    number
        Number of the slide, from 1; an existing one is replaced.
    added_slide
        What is written.
    feature_set
        Fingerprint of the features.

    Returns
    -------
    Path
        Of the file.
    """
    content = {
        'format': FORMAT,
        'feature_set': feature_set,
        'label': added_slide.label,
        'exploration_id': added_slide.exploration_id,
        'values': added_slide.values.tolist(),
        'conditions': asdict(added_slide.conditions),
    }
    path = _folder(model) / f'{number:05d}.json'
    path.parent.mkdir(parents=True, exist_ok=True)
    model_files.replace(path, (json.dumps(content) + '\n').encode())
    return path


def stored_numbers(model: str | Path) -> list[int]:
    """Return the numbers of the stored slides of a model, rising; those of removed slides are missing."""
    return sorted(int(path.stem) for path in _folder(model).glob('*.json') if path.stem.isdecimal())


def remove_added_slide(model: str | Path, number: int) -> None:
    """Remove an added slide if it exists."""
    (_folder(model) / f'{number:05d}.json').unlink(missing_ok=True)


def read_added_slides(model: str | Path, feature_set: str, names: Sequence[str]) -> tuple[AddedSlide, ...]:
    """Return the added slides of a model in their order; none if there is no folder.

    They hold features, so they stay valid when the model is trained again with the same features.

    Parameters
    ----------
    model
        Path of the model.
    feature_set
        Fingerprint of the features of the model.
    names
        Name of each feature.

    Returns
    -------
    tuple of AddedSlide
        In the order in which they were added.

    Raises
    ------
    ModelMismatch
        If one is damaged, or holds features of another kind.
    """
    return tuple(_read(path, feature_set, len(names)) for path in sorted(_folder(model).glob('*.json')))


def _read(path: Path, feature_set: str, n_features: int) -> AddedSlide:
    try:
        content = load_json(path, MAX_BYTES)
        values = np.array(content['values'], dtype=np.float64)
        conditions = SlideConditions.from_mapping(content.get('conditions', {}))
        added_slide = AddedSlide(str(content['label']), str(content['exploration_id']), values, conditions)
        of = str(content['feature_set'])
        if not np.isfinite(values).all():
            raise ValueError('it holds values that are not finite')
    except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ModelMismatch(
            f"added slide '{path}' cannot be read: {type(error).__name__}: {error}; remove it and add it again"
        ) from error
    if of != feature_set or values.ndim != 2 or values.shape[1] != n_features or not added_slide.label:
        raise ModelMismatch(
            f"added slide '{path}' is of the features '{of}', the model has '{feature_set}'; "
            f"move the folder '{path.parent.name}' away, or use the model to which it was added"
        )
    return added_slide


def _folder(model: str | Path) -> Path:
    stem = model_files.stem(model)
    return stem.with_name(f'{stem.name}.added')

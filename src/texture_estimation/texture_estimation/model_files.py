# SPDX-License-Identifier: Apache-2.0
"""The files of a model, read without running code: NAME.npz, the card NAME.json, added slides in NAME.added."""

from __future__ import annotations

import hashlib
import io
import json
import os
import struct
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from texture_core.config import MAX_CARD_BYTES, MB, Arrays, FileRefused, load_json, read_bounded, safe_repr
from texture_core.errors import InvalidData, MissingLibrary, ModelMismatch, TextureError
from texture_core.types import AnyArray, Array
from texture_features.correction import CORRECTED
from texture_features.examples import SlideConditions

# --------------------
# The parts of a model as a tree: mappings, lists, plain values, and arrays as leaves.


def tree_of(part: Any) -> Any:
    """Return a part of a model as a tree: of a dataclass its fields by name."""
    if is_dataclass(part) and not isinstance(part, type):
        return {item.name: tree_of(getattr(part, item.name)) for item in fields(part)}
    if isinstance(part, Mapping):
        return {str(name): tree_of(value) for name, value in part.items()}
    return [tree_of(value) for value in part] if isinstance(part, tuple | list) else part


def part_of(kind: Any, value: Any, where: str) -> Any:
    """Return what `tree_of` made a tree of.

    Parameters
    ----------
    kind
        Its type: a dataclass, a tuple, a mapping by names, an array, or a plain one.
    value
        The tree.
    where
        What it is, for the sentence of an error.

    Raises
    ------
    InvalidData
        If something in it is missing, unknown or of another type.
    """
    origin, given = get_origin(kind), get_args(kind)
    found: Any = None
    if is_dataclass(kind):
        found = _dataclass_of(kind, value, where)
    elif origin is UnionType:  # such a part or None
        return None if value is None else part_of(given[0], value, where)
    elif origin is tuple and isinstance(value, list) and (given[-1] is ... or len(given) == len(value)):
        kinds = given[:1] * len(value) if given[-1] is ... else given
        found = tuple(part_of(own, item, where) for own, item in zip(kinds, value, strict=True))
    elif origin is Mapping and isinstance(value, Mapping):
        found = {name: part_of(given[1], item, f'{where}, {name}') for name, item in value.items()}
    elif origin is np.ndarray and isinstance(value, np.ndarray) and value.dtype == get_args(given[1])[0]:
        found = value
    elif kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        found = float(value)
    elif kind is Any or (isinstance(kind, type) and type(value) is kind):
        return value
    if found is None:
        raise InvalidData(f'{where} is {safe_repr(value):.80}; {kind} is needed')
    return found


def _dataclass_of(kind: Any, value: Any, where: str) -> Any:
    types = get_type_hints(kind)
    if not isinstance(value, Mapping):
        raise InvalidData(f'{where} is {safe_repr(value):.80}; the entries {", ".join(types)} are needed')
    different = set(types) ^ set(value)
    if different:
        raise InvalidData(f'{where} has the entries {", ".join(value)}; {", ".join(types)} are needed')
    return kind(**{name: part_of(own, value[name], f'{where}, {name}') for name, own in types.items()})


# --------------------
# The two files that hold a model, whatever it answers: the tree as the card NAME.json, the arrays in it as NAME.npz.

FORMAT = 1
ENDINGS = ('.npz', '.json')
MAX_BYTES = 200 * MB  # of a file of arrays; ensembles of networks over many features come to 20 MB
MAX_UNPACKED_BYTES = 300 * MB  # predictors hold copies of arrays: so a model takes less than 1 GB
NUMBERS = ('float32', 'float64', 'int32', 'int64')  # smaller types would grow when they are computed with
# What unpacking, and using what came out, raises at files that are damaged or made to do harm, found by trying.
BROKEN = (
    TextureError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError, MemoryError, RuntimeError,
    ImportError, EOFError, SyntaxError, struct.error, zipfile.BadZipFile,
)  # fmt: skip


@contextmanager
def usable(target: Path) -> Iterator[None]:
    """Say in one sentence, within a `with` block, that what it makes of the files of a model cannot be used.

    Raises
    ------
    ModelMismatch
        If the block raises what damaged or foreign files cause.
    """
    try:
        yield
    except MissingLibrary:
        raise
    except BROKEN as error:
        raise ModelMismatch(
            f"model '{target}' cannot be used: {type(error).__name__}: {error}; train it again with 'texture train'"
        ) from error


def model_stem(path: str | Path) -> Path:
    """Return the path without the ending of either file."""
    path = Path(path).expanduser()
    return path.with_suffix('') if path.suffix in ENDINGS else path


def both_files(path: str | Path) -> tuple[Path, Path]:
    """Return NAME.npz and NAME.json of a model that is named by either, or by both without the ending."""
    target = model_stem(path)
    arrays, card = (target.with_name(target.name + ending) for ending in ENDINGS)
    return arrays, card


def write(path: str | Path, tree: Mapping[str, Any]) -> Path:
    """Write NAME.npz and NAME.json, and return NAME.npz.

    A reader never sees half a file: both are written beside their places and then moved.

    Parameters
    ----------
    path
        Path of the model, with or without its ending.
    tree
        What was trained, and what people may read about it.

    Returns
    -------
    Path
        Of NAME.npz.
    """
    arrays_path, card_path = both_files(path)
    card_path.parent.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, AnyArray] = {}
    card = _without_arrays(tree, '', arrays)
    packed = io.BytesIO()
    np.savez_compressed(packed, **arrays)  # type: ignore[arg-type]
    content = packed.getvalue()
    card = {'format': FORMAT, **card, 'sha256': hashlib.sha256(content).hexdigest()}
    replace_file(arrays_path, content)
    replace_file(card_path, (json.dumps(card, indent=1) + '\n').encode())
    return arrays_path


def _without_arrays(tree: Any, place: str, arrays: dict[str, AnyArray]) -> Any:
    """Return a tree without its arrays, which are added to a mapping by their places, such as 'parameters/mean'."""
    if isinstance(tree, np.ndarray):
        arrays[place] = tree
        return None
    if isinstance(tree, np.generic):
        return tree.item()
    if isinstance(tree, Mapping):
        kept = {name: _without_arrays(part, f'{place}/{name}'.lstrip('/'), arrays) for name, part in tree.items()}
        return {name: part for name, part in kept.items() if part is not None or tree[name] is None}
    if isinstance(tree, list):
        return [_without_arrays(part, f'{place}/{number}', arrays) for number, part in enumerate(tree)]
    return tree


def read(path: str | Path, *, of: str) -> dict[str, Any]:
    """Return the tree that `write` was given; nothing in the files is run.

    Parameters
    ----------
    path
        Path of either file, or of both without the ending.
    of
        What its recipe names: 'learner' or 'regressor'.

    Raises
    ------
    ModelMismatch
        If a file is missing, damaged, of the other kind, or does not belong to the other.
    """
    arrays_path, card_path = both_files(path)
    tree = _read_card(card_path, path)
    if of not in tree['recipe']:
        answers, node = KINDS[of]
        raise ModelMismatch(f"model '{model_stem(path)}' {answers}; load it in the {node}")
    try:
        content = read_bounded(arrays_path, MAX_BYTES)
    except (OSError, FileRefused) as error:
        raise ModelMismatch(
            f"model file '{arrays_path}' cannot be read: {error}; it belongs next to its card"
        ) from error
    if hashlib.sha256(content).hexdigest() != tree.get('sha256'):
        raise ModelMismatch(
            f"model file '{arrays_path}' is damaged or of another card; copy both files again or train again"
        )
    with usable(model_stem(path)):
        arrays = Arrays(io.BytesIO(content), MAX_UNPACKED_BYTES)
        for name in arrays.names:
            *way, last = name.split('/')
            place: Any = tree
            for step in way:
                place = place[int(step)] if isinstance(place, list) else place.setdefault(step, {})
            place[last] = _numbers(arrays[name], name)
    return tree


@dataclass(frozen=True, eq=False, kw_only=True)
class StoredModel:
    """What models of textures and of roughness have in common.

    Parameters
    ----------
    name
        Of the model.
    names, feature_set
        Features it expects, and their fingerprint.
    recipe
        By which it was made.
    parameters
        Fitted parameters of the learner or regressor, as the file stores them.
    training
        Facts about the training, for the card.
    """

    name: str
    names: tuple[str, ...]
    feature_set: str
    recipe: Any
    parameters: Mapping[str, Any]
    training: Mapping[str, Any] = field(default_factory=dict)

    @property
    def tree(self) -> dict[str, Any]:
        """What the two files hold: plain values, and arrays as leaves."""
        return {
            'name': self.name,
            'feature_set': self.feature_set.partition(CORRECTED)[0],
            'features': list(self.names),
            'training': tree_of(self.training),
            'recipe': self.recipe.as_mapping(),
            'recipe_name': self.recipe.name,
            'parameters': tree_of(self.parameters),
        }

    def save(self, path: str | Path, facts: Mapping[str, Any] | None = None) -> Path:
        """Write NAME.npz and NAME.json; `facts`, such as accuracies, are added to the card. Return NAME.npz.

        Slides added to a model are not written: they lie beside the model to which they were added.
        """
        return write(path, {**self.tree, **(facts or {})})


def common_parts(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of `StoredModel`, but for its recipe, from its tree; InvalidData if they have other types."""
    return {
        'name': part_of(str, tree.get('name'), 'name'),
        'feature_set': part_of(str, tree.get('feature_set'), 'feature_set'),
        'names': part_of(tuple[str, ...], tree.get('features'), 'features'),
        'training': part_of(Mapping[str, Any], tree.get('training'), 'training'),
        'parameters': part_of(Mapping[str, Any], tree.get('parameters'), 'parameters'),
    }


# What a model that does not name one of these in its recipe does, and where it belongs.
KINDS = {'learner': ('estimates roughness', 'roughness_estimator'), 'regressor': ('classifies textures', 'classifier')}
PACKED = 'packed'  # ends the name of an array of bytes, which a library unpacks


def _numbers(array: AnyArray, name: str) -> AnyArray:
    if array.dtype.name not in NUMBERS and not (name.endswith(PACKED) and array.dtype == np.uint8):
        raise InvalidData(f"its array '{name}' holds {array.dtype}; {', '.join(NUMBERS)} are allowed")
    return array


def replace_file(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    beside = path.with_name(f'.{path.name}.{os.getpid()}')
    try:
        beside.write_bytes(content)
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def _read_card(path: Path, given: str | Path) -> dict[str, Any]:
    try:
        card = load_json(path, MAX_CARD_BYTES)
    except (OSError, ValueError) as error:
        if isinstance(error, FileNotFoundError) and Path(given).exists():
            raise ModelMismatch(f"there is no card '{path}' of '{given}'; give the path of a trained model") from error
        if isinstance(error, FileNotFoundError):
            raise ModelMismatch(f"there is no model '{given}'; give the path of a trained model") from error
        raise ModelMismatch(
            f"model card '{path}' cannot be read: {error}; '{given}' was given; give the path of a trained model"
        ) from error
    if not isinstance(card, dict) or card.get('format') != FORMAT or not isinstance(card.get('recipe'), dict):
        raise ModelMismatch(f"'{path}' is not the card of a model of format {FORMAT}; give the path of a trained model")
    return card


# --------------------
# Slides added to a model after its training, stored in the folder NAME.added beside it.

ADDED_SLIDES_MAX_BYTES = 20 * MB  # of a file; a slide of a minute with 200 features has 5


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
    told = {**tree_of(added_slide), 'values': added_slide.values.tolist()}
    content = {'format': FORMAT, 'feature_set': feature_set, **told}
    path = _folder(model) / f'{number:05d}.json'
    path.parent.mkdir(parents=True, exist_ok=True)
    replace_file(path, (json.dumps(content) + '\n').encode())
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
        content = load_json(path, ADDED_SLIDES_MAX_BYTES)
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
    # Corrected or not, features mean what they meant to the finger of the training.
    if (
        of.partition(CORRECTED)[0] != feature_set.partition(CORRECTED)[0]
        or values.ndim != 2
        or values.shape[1] != n_features
        or not added_slide.label
    ):
        raise ModelMismatch(
            f"added slide '{path}' is of the features '{of}', the model has '{feature_set}'; "
            f"move the folder '{path.parent.name}' away, or use the model to which it was added"
        )
    return added_slide


def _folder(model: str | Path) -> Path:
    stem = model_stem(model)
    return stem.with_name(f'{stem.name}.added')

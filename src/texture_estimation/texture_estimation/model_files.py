# SPDX-License-Identifier: Apache-2.0
"""The files of a model, read without running code: NAME.skops, the card NAME.json, added slides in NAME.added."""

from __future__ import annotations

import hashlib
import io
import json
import os
import struct
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.config import (
    MAX_CARD_BYTES,
    MB,
    Archive,
    FileRefused,
    library,
    load_json,
    parse_json,
    read_bounded,
)
from texture_core.errors import InvalidParameter, MissingLibrary, ModelMismatch, TextureError
from texture_core.types import Array
from texture_features.correction import CORRECTED
from texture_features.examples import SlideConditions

# --------------------
# Read a .skops file that holds nothing but dicts, lists, plain values and arrays, without the library that wrote it.
#
# That library knows every class of scikit-learn, and loads all of it first: seconds and 150 MB, of which a node that
# classifies needs nothing. What is not as plain as said here is left to it.

Node = Mapping[str, Any]
SCHEMA = 'schema.json'
PLAIN_SKOPS_MAX_SCHEMA_BYTES = 5_000_000


class NotPlain(Exception):
    """Something else than plain values and arrays.

    Examples
    --------
    >>> try:
    ...     raise NotPlain("it holds a function")
    ... except NotPlain as error:
    ...     print(error)
    it holds a function
    """


def read_plain_skops(file: Archive) -> dict[str, Any] | None:
    """Return what a file holds; None if that is not plain."""
    try:
        parameters = _build(parse_json(file.read(SCHEMA, PLAIN_SKOPS_MAX_SCHEMA_BYTES).decode()), file)
    except (NotPlain, KeyError, TypeError, UnicodeDecodeError):
        return None
    return parameters if isinstance(parameters, dict) else None


def _build(node: Node, file: Archive) -> Any:
    kind = node['__loader__'], node['__module__']
    if kind not in KINDS:
        raise NotPlain(kind)
    return KINDS[kind](node, file)


def _dict(node: Node, file: Archive) -> dict[str, Any]:
    if node['__class__'] != 'dict' or any(key['__class__'] != 'str' for key in node['key_types']['content']):
        raise NotPlain(node['__class__'])
    return {name: _build(value, file) for name, value in node['content'].items()}


def _list(node: Node, file: Archive) -> list[Any]:
    if node['__class__'] != 'list':
        raise NotPlain(node['__class__'])
    return [_build(value, file) for value in node['content']]


def _value(node: Node, _file: Archive) -> Any:
    value = parse_json(node['content'])
    if not (value is None or isinstance(value, (bool, int, float, str))):
        raise NotPlain(type(value))
    return value


def _array(node: Node, file: Archive) -> Any:
    if node['type'] != 'numpy':
        raise NotPlain(node['type'])
    array = file.array(node['file'])
    return array if node['__class__'] == 'ndarray' else array[()]


# By loader and module, as the schema names them.
KINDS: Mapping[tuple[str, str], Callable[[Node, Archive], Any]] = {
    ('DictNode', 'builtins'): _dict,
    ('ListNode', 'builtins'): _list,
    ('JsonNode', 'builtins'): _value,
    ('NdArrayNode', 'numpy'): _array,
}


# --------------------
# The two files that hold a model, whatever it classifies: NAME.skops with what was trained, and the card NAME.json.

FORMAT = 1
SKOPS = ('skops.io', 'new models, and models with parts of scikit-learn,', 'models')
ENDINGS = ('.skops', '.json')
MAX_BYTES = 200 * MB  # of a file of parts; ensembles of networks over many features come to 20 MB
MAX_SCHEMA_BYTES = 2 * MB  # each node in it becomes objects of 2 kB
MAX_ESTIMATOR_SCHEMA_BYTES = 10 * MB  # a thousand trees
NODES = ('DictNode', 'ListNode', 'TupleNode', 'JsonNode', 'NdArrayNode', 'TypeNode', 'ObjectNode')
# What an estimator of scikit-learn holds beside these; its trees are checked before they are used.
ESTIMATOR_NODES = ('TreeNode', 'RandomStateNode')
ESTIMATOR_PARTS = (
    'sklearn.calibration._CalibratedClassifier',
    'sklearn.neural_network._stochastic_optimizers.AdamOptimizer',
    'sklearn.neural_network._stochastic_optimizers.SGDOptimizer',
)
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
    """Return NAME.skops and NAME.json of a model that is named by either, or by both without the ending."""
    target = model_stem(path)
    parameters, card = (target.with_name(target.name + ending) for ending in ENDINGS)
    return parameters, card


def write(path: str | Path, parameters: Mapping[str, Any], card: Mapping[str, Any]) -> Path:
    """Write NAME.skops and NAME.json, and return NAME.skops.

    A reader never sees half a file: both are written beside their places and then moved.

    Parameters
    ----------
    path
        Path of the model, with or without its ending.
    parameters
        What was trained: arrays, plain values and trusted types.
    card
        What people may read about it: plain values.

    Returns
    -------
    Path
        Of NAME.skops.
    """
    skops = library(*SKOPS)  # takes a second, and only who saves needs it

    parameters_path, card_path = both_files(path)
    card_path.parent.mkdir(parents=True, exist_ok=True)
    content = skops.dumps(dict(parameters), compression=zipfile.ZIP_DEFLATED, compresslevel=1)
    card = {**card, 'sha256': hashlib.sha256(content).hexdigest()}
    replace_file(parameters_path, content)
    replace_file(card_path, (json.dumps(card, indent=1) + '\n').encode())
    return parameters_path


def read(path: str | Path) -> tuple[dict[str, Any], bytes]:
    """Return the card, and the bytes that belong to it; `path` is that of either file, or of both without the ending.

    Raises
    ------
    ModelMismatch
        If a file is missing, damaged, or does not belong to the other.
    """
    parameters_path, card_path = both_files(path)
    card = _read_card(card_path, path)
    return card, _read_parameters(parameters_path, str(card.get('sha256')))


def load_parameters(content: bytes, trusted: Sequence[str], *, estimators: bool = False) -> dict[str, Any]:
    """Return what was trained; nothing is built of types that are not trusted, and no code of the file is run.

    Parameters
    ----------
    content
        Bytes of NAME.skops.
    trusted
        Types that it may hold beyond plain values and arrays.
    estimators
        Whether it may hold any estimator of scikit-learn and its decision trees, too.

    Returns
    -------
    dict
        What `write` was given.

    Raises
    ------
    ModelMismatch
        If it holds something else.
    """
    with Archive(io.BytesIO(content)) as file:
        plain = read_plain_skops(file)
    if plain is not None:
        return plain
    with Archive(io.BytesIO(content)) as file:
        trusted = _check_parts(file, trusted, estimators)
    skops = library(*SKOPS)  # takes seconds, and few models need it

    unexpected = sorted(set(skops.get_untrusted_types(data=content)) - set(trusted))
    if unexpected:
        raise ModelMismatch(f'it holds {", ".join(unexpected)}, which no model of this suite holds')
    return dict(skops.loads(content, trusted=list(trusted)))


def check_storable(parameters: Mapping[str, Any], name: str) -> None:
    """Raise InvalidParameter if a model file could not hold an estimator of scikit-learn, or not be read again.

    Raises
    ------
    InvalidParameter
        If it could not.
    """
    skops = library(*SKOPS)

    try:
        content = skops.dumps(dict(parameters))
        with Archive(io.BytesIO(content)) as file:
            _check_parts(file, (), estimators=True)
    except BROKEN as error:
        raise InvalidParameter(
            f"'{name}' cannot be stored as a model: {error}; use another estimator or other parameters "
            '(neighbours with algorithm: brute, fewer trees)'
        ) from error


def _check_parts(file: Archive, trusted: Sequence[str], estimators: bool) -> list[str]:
    """Return the trusted types; raise ModelMismatch or FileRefused unless skops, which counts nothing, may read a file.

    A member may be named by many nodes, each of which makes an array of its own; and some kinds of node would read
    archives within the archive, or call functions.
    """
    schema = parse_json(file.read(SCHEMA, MAX_ESTIMATOR_SCHEMA_BYTES if estimators else MAX_SCHEMA_BYTES).decode())
    kinds = (*NODES, *ESTIMATOR_NODES) if estimators else NODES
    found = set(trusted)
    for node in _nodes(schema):
        kind, name = str(node['__loader__']), f'{node.get("__module__")}.{node.get("__class__")}'
        known = name in found or (estimators and _is_estimator(name))
        if kind not in kinds or (kind == 'ObjectNode' and not known):
            raise ModelMismatch(f'it holds {name} ({kind}), which no model of this suite holds')
        if kind in ('ObjectNode', 'TreeNode'):
            found.add(name)
        if kind == 'NdArrayNode' and node.get('type') == 'numpy':
            file.array(str(node['file']))
    return sorted(found)


@lru_cache(maxsize=1000)
def _is_estimator(name: str) -> bool:
    """Return whether a name is that of an estimator of scikit-learn, or of a part of one that holds plain values."""
    if name in ESTIMATOR_PARTS:
        return True
    module, _, cls_name = name.rpartition('.')
    if not module.startswith('sklearn.'):
        return False
    from sklearn.base import BaseEstimator  # noqa: PLC0415  # takes a second

    try:
        cls = getattr(import_module(module), cls_name, None)
    except ImportError:
        return False
    return isinstance(cls, type) and issubclass(cls, BaseEstimator)


def _nodes(value: Any) -> Iterator[Mapping[str, Any]]:
    """Yield the nodes of a schema."""
    if isinstance(value, Mapping) and '__loader__' in value:
        yield value
    parameters = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
    for part in parameters:
        yield from _nodes(part)


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
        raise ModelMismatch(
            f"model card '{path}' cannot be read: {error}; '{given}' was given; give the path of a trained model"
        ) from error
    if not isinstance(card, dict) or card.get('format') != FORMAT or not isinstance(card.get('recipe'), dict):
        raise ModelMismatch(f"'{path}' is not the card of a model of format {FORMAT}; give the path of a trained model")
    return card


def _read_parameters(path: Path, digest: str) -> bytes:
    try:
        content = read_bounded(path, MAX_BYTES)
    except (OSError, FileRefused) as error:
        raise ModelMismatch(f"model file '{path}' cannot be read: {error}; it belongs beside its card") from error
    if hashlib.sha256(content).hexdigest() != digest:
        raise ModelMismatch(f"model file '{path}' is damaged or of another card; copy both files again or train again")
    return content


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

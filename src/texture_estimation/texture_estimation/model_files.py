"""The two files that hold a model, whatever it classifies: NAME.skops with what was trained, and the card NAME.json."""

from __future__ import annotations

import hashlib
import io
import json
import os
import struct
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

from texture_core.errors import InvalidParameter, ModelMismatch, TextureError
from texture_core.files import MB, Archive, FileRefused, read_bounded
from texture_core.plain_data import MAX_CARD_BYTES, load_json, parse_json
from texture_estimation.plain_skops import SCHEMA, read_plain_skops

FORMAT = 1
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
    except BROKEN as error:
        raise ModelMismatch(
            f"model '{target}' cannot be used: {type(error).__name__}: {error}; train it again with 'texture train'"
        ) from error


def stem(path: str | Path) -> Path:
    """Return the path without the ending of either file."""
    path = Path(path).expanduser()
    return path.with_suffix('') if path.suffix in ENDINGS else path


def both_files(path: str | Path) -> tuple[Path, Path]:
    """Return NAME.skops and NAME.json of a model that is named by either, or by both without the ending."""
    target = stem(path)
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
    from skops.io import dumps  # noqa: PLC0415  # takes a second, and only who saves or loads needs it

    parameters_path, card_path = both_files(path)
    card_path.parent.mkdir(parents=True, exist_ok=True)
    content = dumps(dict(parameters), compression=zipfile.ZIP_DEFLATED, compresslevel=1)
    card = {**card, 'sha256': hashlib.sha256(content).hexdigest()}
    replace(parameters_path, content)
    replace(card_path, (json.dumps(card, indent=1) + '\n').encode())
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
    from skops.io import get_untrusted_types, loads  # noqa: PLC0415  # takes seconds, and few models need it

    unexpected = sorted(set(get_untrusted_types(data=content)) - set(trusted))
    if unexpected:
        raise ModelMismatch(f'it holds {", ".join(unexpected)}, which no model of this suite holds')
    return dict(loads(content, trusted=list(trusted)))


def check_storable(parameters: Mapping[str, Any], name: str) -> None:
    """Raise InvalidParameter if a model file could not hold an estimator of scikit-learn, or not be read again.

    Raises
    ------
    InvalidParameter
        If it could not.
    """
    from skops.io import dumps  # noqa: PLC0415  # takes a second

    try:
        content = dumps(dict(parameters))
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
            file.array(str(node['file']), records=estimators)
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


def replace(path: Path, content: bytes) -> None:
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

"""Read a .skops file that holds nothing but dicts, lists, plain values and arrays, without the library that wrote it.

That library knows every class of scikit-learn, and loads all of it first: seconds and 150 MB, of which a node that
judges needs nothing. What is not as plain as said here is left to it.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

Node = Mapping[str, Any]
SCHEMA = 'schema.json'


class NotPlain(Exception):
    """Something else than plain values and arrays."""


def plain_parts(file: zipfile.ZipFile) -> dict[str, Any] | None:
    """Return what a file holds; None if that is not plain."""
    try:
        parts = _build(json.loads(file.read(SCHEMA).decode()), file)
    except (NotPlain, KeyError, TypeError, UnicodeDecodeError):
        return None
    return parts if isinstance(parts, dict) else None


def _build(node: Node, file: zipfile.ZipFile) -> Any:
    kind = node['__loader__'], node['__module__']
    if kind not in KINDS:
        raise NotPlain(kind)
    return KINDS[kind](node, file)


def _dict(node: Node, file: zipfile.ZipFile) -> dict[str, Any]:
    if node['__class__'] != 'dict' or any(key['__class__'] != 'str' for key in node['key_types']['content']):
        raise NotPlain(node['__class__'])
    return {name: _build(value, file) for name, value in node['content'].items()}


def _list(node: Node, file: zipfile.ZipFile) -> list[Any]:
    if node['__class__'] != 'list':
        raise NotPlain(node['__class__'])
    return [_build(value, file) for value in node['content']]


def _value(node: Node, _file: zipfile.ZipFile) -> Any:
    value = json.loads(node['content'])
    if not (value is None or isinstance(value, (bool, int, float, str))):
        raise NotPlain(type(value))
    return value


def _array(node: Node, file: zipfile.ZipFile) -> Any:
    if node['type'] != 'numpy':
        raise NotPlain(node['type'])
    array = np.load(io.BytesIO(file.read(node['file'])), allow_pickle=False)
    if not isinstance(array, np.ndarray):
        raise NotPlain(type(array))
    return array if node['__class__'] == 'ndarray' else array[()]


# By loader and module, as the schema names them.
KINDS: Mapping[tuple[str, str], Callable[[Node, zipfile.ZipFile], Any]] = {
    ('DictNode', 'builtins'): _dict,
    ('ListNode', 'builtins'): _list,
    ('JsonNode', 'builtins'): _value,
    ('NdArrayNode', 'numpy'): _array,
}

"""Read a .skops file that holds nothing but dicts, lists, plain values and arrays, without the library that wrote it.

That library knows every class of scikit-learn, and loads all of it first: seconds and 150 MB, of which a node that
classifies needs nothing. What is not as plain as said here is left to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from texture_core.files import Archive
from texture_core.plain_data import parse_json

Node = Mapping[str, Any]
SCHEMA = 'schema.json'
MAX_SCHEMA_BYTES = 5_000_000


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
        parameters = _build(parse_json(file.read(SCHEMA, MAX_SCHEMA_BYTES).decode()), file)
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

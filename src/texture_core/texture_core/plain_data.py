"""Read YAML and JSON as plain values, whoever wrote them: nothing is run, and little text never becomes much data.

Figures are written as JSON here, too.
"""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidParameter
from texture_core.files import MB, FileRefused, read_text, writing

MAX_CHARACTERS = 100_000  # of YAML, which take 3 s at worst; the longest settings in use have a tenth
MAX_VALUES = 200_000  # with every alias written out
MAX_DEPTH = 50  # of lists and mappings within each other, in YAML and JSON
MAX_CARD_BYTES = 5 * MB
MAX_JSON_VALUES = 5_000_000
JSON_STRING = re.compile(r'"[^"\\]*(?:\\.[^"\\]*)*"', re.DOTALL)
# What the parsers raise, depending on what is wrong; a value such as 2024-99-99 or !!bool x is no YAMLError.
PARSE_ERRORS = (
    yaml.YAMLError, OSError, ValueError, LookupError, AttributeError, TypeError, OverflowError, RecursionError,
)  # fmt: skip


def write_json(content: Any, path: str | Path) -> None:
    """Write figures as JSON; InvalidParameter if the file cannot be written."""
    with writing(path):
        Path(path).write_text(json.dumps(content, indent=1) + '\n', encoding='utf-8')


def load_yaml(path: Path, what: str) -> Any:
    """Return the plain values in a YAML file; `what` is the noun for the error sentence, such as 'scene'.

    Raises
    ------
    InvalidParameter
        If it cannot be read, is no YAML, or holds more than a file of settings does.
    """
    try:
        return parse_yaml(read_text(path, 4 * MAX_CHARACTERS))
    except PARSE_ERRORS as error:
        raise InvalidParameter(f"{what} '{path}' is no YAML that can be read: {error}") from error


def load_card(path: Path) -> Any:
    """Return what stands under `recipe` in a model's card (JSON).

    Raises
    ------
    InvalidParameter
        If it cannot be read as such.
    """
    try:
        return load_json(path, MAX_CARD_BYTES).get('recipe')
    except PARSE_ERRORS as error:
        raise InvalidParameter(f"model card '{path}' cannot be read: {error}") from error


def parse_yaml(text: str) -> Any:
    """Return the plain values in a text; one of `PARSE_ERRORS` is raised if it is no YAML, or too much of it.

    Raises
    ------
    ValueError
        If the text is too long or its aliases stand for too many values.
    """
    if len(text) > MAX_CHARACTERS:
        raise ValueError(f'it has {len(text)} characters; {MAX_CHARACTERS} are allowed')
    loader = _BoundedLoader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        if _count_values(node, {}) > MAX_VALUES:
            raise ValueError(f'its aliases stand for more than {MAX_VALUES} values; write less')
        return loader.construct_document(node)
    finally:
        loader.dispose()


def load_json(path: Path, most_bytes: int) -> Any:
    """Return the plain values in a JSON file.

    Raises
    ------
    OSError, ValueError
        If it cannot be read, is no JSON, or larger than `most_bytes`.
    """
    return parse_json(read_text(path, most_bytes))


def parse_json(text: str) -> Any:
    """Return the plain values in a text; ValueError if it is no JSON, or one with too many or too deep values.

    Raises
    ------
    ValueError
        If it is no JSON.
    FileRefused
        If it has too many values or is nested too deeply.
    """
    marks = np.frombuffer(JSON_STRING.sub('', text).encode('utf-8', 'replace'), np.uint8)
    depth = int(_among(marks, b'[{').sum(initial=0)) and int(np.cumsum(_steps(marks)).max(initial=0))
    if depth > MAX_DEPTH:
        raise FileRefused(f'it is nested {depth} deep; {MAX_DEPTH} is allowed')
    n_values = int(_among(marks, b'[{,:').sum())
    if n_values > MAX_JSON_VALUES:
        raise FileRefused(f'it has {n_values} values; {MAX_JSON_VALUES} are allowed')
    try:
        return json.loads(text, parse_int=_whole_number)
    except RecursionError as error:
        raise ValueError('it is nested too deeply') from error


def safe_repr(value: Any) -> str:
    """Return a value as a sentence shows it, however it is nested and however many digits it has."""
    try:
        return repr(value)
    except RecursionError:
        return 'something nested too deeply'
    except ValueError:
        return 'a number of thousands of digits'


def _whole_number(text: str) -> int:
    """Return a whole number that a float can hold: nothing here is counted beyond."""
    number = int(text)
    if abs(number) > sys.float_info.max:
        raise ValueError(f'it has a whole number of {len(text)} digits; 308 are allowed')
    return number


class _BoundedLoader(yaml.SafeLoader):
    """Build a tree of nodes that is neither deep nor large, without whole numbers that no float can hold."""

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        return _whole_number(str(super().construct_yaml_int(node)))

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise FileRefused(f'it is nested more than {MAX_DEPTH} deep')
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


_BoundedLoader.add_constructor('tag:yaml.org,2002:int', _BoundedLoader.construct_yaml_int)


def _among(marks: AnyArray, wanted: bytes) -> AnyArray:
    return np.isin(marks, np.frombuffer(wanted, np.uint8))


def _steps(marks: AnyArray) -> AnyArray:
    """Return +1 where a list or an object begins and -1 where one ends."""
    return _among(marks, b'[{').astype(np.int32) - _among(marks, b']}')


def _count_values(node: yaml.Node, known: dict[int, float]) -> float:
    """Return how many values a node stands for, each alias counted; infinite if it contains itself."""
    if id(node) not in known:
        known[id(node)] = math.inf
        parts = node.value if isinstance(node, yaml.CollectionNode) else ()
        children = [child for part in parts for child in (part if isinstance(part, tuple) else (part,))]
        known[id(node)] = 1 + sum(_count_values(child, known) for child in children)
    return known[id(node)]

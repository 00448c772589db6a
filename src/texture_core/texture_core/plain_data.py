"""Read YAML and JSON as plain values, whoever wrote them: nothing is run, and little text never becomes much data."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import yaml

from texture_core.errors import InvalidParameter

MOST_CHARACTERS = 1_000_000
MOST_VALUES = 200_000  # with every alias written out
# What the parsers raise, depending on what is wrong; a value such as 2024-99-99 or !!bool x is no YAMLError.
BROKEN = (
    yaml.YAMLError, OSError, ValueError, LookupError, AttributeError, TypeError, OverflowError, RecursionError,
)  # fmt: skip


def load_yaml(path: Path, what: str) -> Any:
    """Return the plain values in a YAML file; `what` is the noun for the error sentence, such as 'scene'.

    Raises
    ------
    InvalidParameter
        If it cannot be read, is no YAML, or holds more than a file of settings does.
    """
    try:
        return parse_yaml(path.read_text(encoding='utf-8'))
    except BROKEN as error:
        raise InvalidParameter(f"{what} '{path}' is no YAML that can be read: {error}") from error


def load_card(path: Path) -> Any:
    """Return what stands under `recipe` in a model's card (JSON).

    Raises
    ------
    InvalidParameter
        If it cannot be read as such.
    """
    try:
        return parse_json(path.read_text(encoding='utf-8')).get('recipe')
    except BROKEN as error:
        raise InvalidParameter(f"model card '{path}' cannot be read: {error}") from error


def parse_yaml(text: str) -> Any:
    """Return the plain values in a text; one of `BROKEN` is raised if it is no YAML, or too much of it."""
    if len(text) > MOST_CHARACTERS:
        raise ValueError(f'it has {len(text)} characters; {MOST_CHARACTERS} are allowed')
    loader = yaml.SafeLoader(text)
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        if _weight(node, {}) > MOST_VALUES:
            raise ValueError(f'its aliases stand for more than {MOST_VALUES} values; write less')
        return loader.construct_document(node)
    finally:
        loader.dispose()


def parse_json(text: str) -> Any:
    """Return the plain values in a text; ValueError if it is no JSON."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError('it is nested too deeply') from error


def shown(value: Any) -> str:
    """Return a value as a sentence shows it, however it is nested."""
    try:
        return repr(value)
    except RecursionError:
        return 'something nested too deeply'


def _weight(node: yaml.Node, known: dict[int, float]) -> float:
    """Return how many values a node stands for, each alias counted; infinite if it contains itself."""
    if id(node) not in known:
        known[id(node)] = math.inf
        parts = node.value if isinstance(node, yaml.CollectionNode) else ()
        children = [child for part in parts for child in (part if isinstance(part, tuple) else (part,))]
        known[id(node)] = 1 + sum(_weight(child, known) for child in children)
    return known[id(node)]

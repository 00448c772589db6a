"""Build what a recipe chooses: 'name', or {name: {parameter: value}}, from a catalogue of parameter dataclasses."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from texture_core.catalogue import find
from texture_core.errors import InvalidParameter, UnknownName
from texture_core.parameters import from_mapping
from texture_core.plain_data import safe_repr

T = TypeVar('T')


def choose(catalogue: Mapping[str, type[T]], entry: Any, kind: str, where: str) -> tuple[str, T]:
    """Return name and object of one entry of a recipe; `kind` is the noun for the error sentence.

    Raises
    ------
    InvalidParameter, UnknownName
        If the entry is not of that form, or the name or a parameter is unknown or out of range.
    """
    if isinstance(entry, str):
        entry = {entry: {}}
    if not isinstance(entry, Mapping) or len(entry) != 1:
        raise InvalidParameter(
            f"{where}: came {safe_repr(entry)}; a {kind} is written 'name' or 'name: {{parameter: value}}'"
        )
    [(name, values)] = entry.items()
    try:
        cls = find(catalogue, str(name), kind)
    except UnknownName as error:
        raise UnknownName(f'{where}: {error}') from error
    return str(name), from_mapping(cls, values or {}, f"{where}, {kind} '{name}'")

"""Build what a recipe chooses: 'name', or {name: {parameter: value}}, from a catalogue of parameter dataclasses."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, TypeVar

from texture_core.catalogue import find
from texture_core.errors import InvalidParameter, UnknownName
from texture_core.parameters import from_mapping
from texture_core.plain_data import safe_repr

T = TypeVar('T')


def choose(catalogue: Mapping[str, type[T]], entry: Any, kind: str, where: str) -> tuple[str, T]:
    """Return name and object of one entry of a recipe; `kind` is the noun for the error sentence.

    Parameters
    ----------
    catalogue
        What can be chosen, by name.
    entry
        'name', or {name: {parameter: value}}.
    kind
        Noun for the sentence of an error, such as 'feature'.
    where
        Where the entry stands, for the same sentence.

    Returns
    -------
    str, object
        Name of the entry and the object that was built.

    Raises
    ------
    InvalidParameter, UnknownName
        If the entry is not of that form, or the name or a parameter is unknown or out of range.
    """
    entry = {entry: {}} if isinstance(entry, str) else entry
    if not isinstance(entry, Mapping) or len(entry) != 1:
        raise InvalidParameter(
            f"{where}: came {safe_repr(entry)}; a {kind} is written 'name' or 'name: {{parameter: value}}'"
        )
    [(name, values)] = entry.items()
    try:
        cls = find(catalogue, str(name), kind)
    except UnknownName as error:
        raise UnknownName(f'{where}: {error}') from error
    place = f"{where}, {kind} '{name}'"
    build = getattr(cls, 'from_recipe', None)  # of an entry whose parameters are not known beforehand
    return str(name), build(values or {}, place) if build else from_mapping(cls, values or {}, place)


def entry_of(chosen: Any) -> dict[str, Any]:
    """Return the parameters of what was chosen, as a recipe writes them."""
    write = getattr(chosen, 'as_recipe', None)
    entry: dict[str, Any] = write() if write else dataclasses.asdict(chosen)
    return entry

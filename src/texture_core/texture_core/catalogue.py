"""Look a choice up by name: in a table of the suite, or as 'module:Class' of the user's own."""

from __future__ import annotations

import difflib
import importlib
import sys
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar, cast

from texture_core.errors import UnknownName

T = TypeVar('T')


def find(catalogue: Mapping[str, T], name: str, kind: str) -> T:
    """Return the entry called `name`; `kind` is the noun for the error sentence, such as 'feature'.

    A name with a colon is imported: 'my_package.my_module:MyFeature'.

    Parameters
    ----------
    catalogue
        Names and what they mean.
    name
        Name that the user gave, or 'module:Class'.
    kind
        Noun for the error sentence, such as 'feature'.

    Returns
    -------
    object
        The entry, or the imported class.

    Raises
    ------
    UnknownName
        With the nearest known name.
    """
    if ':' in name:
        return cast(T, _import(name, kind))
    if name not in catalogue:
        raise unknown_name(name, catalogue, kind)
    return catalogue[name]


def unknown_name(name: str, known: Iterable[str], kind: str) -> UnknownName:
    """Return the error for a name that is not among the known ones, with the nearest of them.

    Parameters
    ----------
    name
        Name that the user gave.
    known
        All names that are allowed.
    kind
        Noun for the error sentence, such as 'feature'.

    Returns
    -------
    UnknownName
        To be raised.
    """
    names = sorted(known)
    near = difflib.get_close_matches(name, names, n=1)
    hint = f"; did you mean '{near[0]}'?" if near else '.'
    return UnknownName(f"no {kind} '{name}'{hint} Known: {', '.join(names) or 'none'}")


def _import(name: str, kind: str) -> Any:
    module, _, attribute = name.partition(':')
    parts = module.split('.')
    # Names come from files and over the network, too: modules that do something when imported are none of ours.
    if parts[0] in sys.stdlib_module_names or '__main__' in parts:
        raise UnknownName(f"no {kind} '{name}': '{module}' is a part or a program of Python; name a module of your own")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError, TypeError) as error:
        raise UnknownName(
            f"no {kind} '{name}': {error}; write 'module:Class' of something that can be imported"
        ) from error

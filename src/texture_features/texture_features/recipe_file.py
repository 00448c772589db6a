"""Read the mapping in a recipe, or in the card of a model that was trained with one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from texture_core.errors import InvalidParameter
from texture_core.plain_data import load_card, load_yaml, safe_repr
from texture_core.resources import find_file


def read_recipe(
    name_or_path: str, subfolder: str = 'config/recipes', kind: str = 'recipe'
) -> tuple[str, Mapping[str, Any]]:
    """Return name and content of a recipe (YAML) that texture_estimation ships, or of any file.

    A model's card (JSON) holds its recipe under `recipe`; a model (.skops) has the card beside it.

    Parameters
    ----------
    name_or_path
        Name of a shipped recipe, or path of a recipe (.yaml), a card (.json) or a model (.skops).
    subfolder
        Where texture_estimation keeps the shipped ones.
    kind
        Noun for the sentence of an error.

    Returns
    -------
    str, mapping
        Name of the file without its ending, and its content.

    Raises
    ------
    UnknownName, InvalidParameter
        If there is no such file or it holds no recipe; `kind` is the noun for the sentence.
    """
    path = find_file(name_or_path, 'texture_estimation', subfolder, kind)
    if path.suffix == '.skops':
        path = path.with_suffix('.json')
    content = load_card(path) if path.suffix == '.json' else load_yaml(path, kind)
    if not isinstance(content, Mapping):
        raise InvalidParameter(f"{kind} '{path}' holds {safe_repr(content)}; a mapping with the key 'inputs' is needed")
    return path.stem, content

"""A digest of the definition of a recipe, by which stored figures are distinguished from outdated ones."""

from __future__ import annotations

import hashlib
import json

from texture_core.errors import UnknownName
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness.recipe import load_roughness_recipe


def digest_of(recipe: str) -> str:
    """Return eight letters of the definition of a shipped recipe, by its name; what describes it does not count.

    Raises
    ------
    UnknownName
        If there is no such recipe.
    """
    try:
        definition = load_recipe(recipe).as_mapping()
    except UnknownName:
        definition = load_roughness_recipe(recipe).as_mapping()
    counted = {name: value for name, value in definition.items() if name != 'description'}
    return hashlib.sha256(json.dumps(counted, sort_keys=True).encode()).hexdigest()[:8]

"""A digest of the definition of a recipe, by which stored figures are distinguished from outdated ones."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from texture_core.errors import UnknownName
from texture_estimation.recipe import load_recipe
from texture_estimation.roughness.roughness_recipe import load_roughness_recipe

# What of `training` decides the label after a whole slide. The rest says when a slide ends early, or what is outside.
TRAINING = frozenset({'augmentation', 'false_rejection_rate', 'hop_s', 'start_weight'})
# Values with which a parameter of the evidence rule changes nothing: stored digests are older than the parameter.
NEUTRAL = {'late_weight': 1.0}


def digest_of(recipe: str) -> str:
    """Return eight letters of what of a shipped recipe, by its name, decides the label after a whole slide.

    Descriptions, the tare of inputs, and rules for ending a slide early do not count.

    Raises
    ------
    UnknownName
        If there is no such recipe.
    """
    try:
        definition = load_recipe(recipe).as_mapping()
    except UnknownName:
        definition = load_roughness_recipe(recipe).as_mapping()
    return hashlib.sha256(json.dumps(_decisive(definition), sort_keys=True).encode()).hexdigest()[:8]


def _decisive(definition: Mapping[str, Any]) -> dict[str, Any]:
    decisive = {name: value for name, value in definition.items() if name != 'description'}
    if 'inputs' in decisive:
        decisive['inputs'] = {
            name: {key: value for key, value in part.items() if key != 'tare'}
            for name, part in decisive['inputs'].items()
        }
    if 'evidence' in decisive:
        decisive['evidence'] = {
            rule: {key: value for key, value in params.items() if NEUTRAL.get(key) != value}
            if isinstance(params, Mapping)
            else params
            for rule, params in decisive['evidence'].items()
        }
    if 'training' in decisive:
        decisive['training'] = {name: value for name, value in decisive['training'].items() if name in TRAINING}
    return decisive

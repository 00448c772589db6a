"""A recipe for the vibration alone, or for all channels of a sensor."""

from __future__ import annotations

from dataclasses import replace

from texture_core.errors import InvalidParameter
from texture_estimation.recipe import Recipe

FAST_TOPIC = 'signal'
CHANNELS = ('fast', 'all')


def with_channels(recipe: Recipe, channels: str) -> Recipe:
    """Return the recipe as it is for 'all' channels, with the input `signal` alone for 'fast'.

    Raises
    ------
    InvalidParameter
        If `channels` is neither, or the recipe has no vibration.
    """
    if channels not in CHANNELS:
        raise InvalidParameter(f"channels are '{channels}'; 'fast' or 'all' is needed")
    if channels == 'all':
        return recipe
    inputs = tuple(item for item in recipe.feature_set.inputs if item.topics == (FAST_TOPIC,))
    if not inputs:
        raise InvalidParameter(f"recipe '{recipe.name}' has no input '{FAST_TOPIC}'; use it with all channels")
    feature_set = replace(recipe.feature_set, inputs=inputs, _layouts={})
    return replace(recipe, feature_set=feature_set)

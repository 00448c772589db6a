"""Which numbers each motion takes, with default and range: what the buttons of the page offer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from texture_exploration.motions import circular, cross_slide, in_hand_sliding, linear_slide
from texture_exploration.safety import RANGES, SafetyLimits

DEFAULTS: Mapping[str, Mapping[str, float]] = {
    'linear_slide': linear_slide.DEFAULTS,
    'circular': circular.DEFAULTS,
    'cross_slide': cross_slide.DEFAULTS,
    'in_hand_sliding': in_hand_sliding.DEFAULTS,
    'in_hand_random': in_hand_sliding.DEFAULTS,
}


def offered(limits: SafetyLimits) -> dict[str, list[dict[str, Any]]]:
    """Return the numbers of each motion: name, default, lowest, highest and unit."""
    return {
        motion: [{'name': name, 'default': value, **_range(limits, name)} for name, value in defaults.items()]
        for motion, defaults in DEFAULTS.items()
    }


def _range(limits: SafetyLimits, name: str) -> dict[str, Any]:
    low, high, unit = RANGES[name]
    return {'low': getattr(limits, low), 'high': getattr(limits, high), 'unit': unit}

"""Which numbers each motion takes, with default and range: what the buttons of the page offer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from texture_exploration.motions import circular, in_hand_sliding, linear_slide
from texture_exploration.safety import RANGES, SafetyLimits

DEFAULTS: Mapping[str, Mapping[str, float]] = {
    'linear_slide': {
        'speed_m_s': linear_slide.DEFAULT_SPEED_M_S,
        'force_n': linear_slide.DEFAULT_FORCE_N,
        'distance_m': linear_slide.DEFAULT_DISTANCE_M,
    },
    'circular': {
        'speed_m_s': circular.DEFAULT_SPEED_M_S,
        'force_n': circular.DEFAULT_FORCE_N,
        'radius_m': circular.DEFAULT_RADIUS_M,
        'turns': circular.DEFAULT_TURNS,
    },
    'in_hand_sliding': {
        'speed_m_s': in_hand_sliding.DEFAULT_SPEED_M_S,
        'force_n': in_hand_sliding.DEFAULT_FORCE_N,
        'distance_m': in_hand_sliding.DEFAULT_STROKE_M,
        'duration_s': in_hand_sliding.DEFAULT_DURATION_S,
    },
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

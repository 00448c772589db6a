"""Random explorations of an endurance run, with occasional stops and invalid requests."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from texture_core.exploration import ExplorationRequest

STOPPED_SHARE, INVALID_SHARE = 0.08, 0.03  # shares of the explorations
NEW_SURFACE = 0.3  # how often the sample is swapped
IMPOSSIBLE_M_S = 9.0


@dataclass(frozen=True)
class PlannedExploration:
    """An exploration to ask for; `stop_after_s` is NaN if nobody stops it."""

    request: ExplorationRequest
    stop_after_s: float = math.nan

    @property
    def invalid_on_purpose(self) -> bool:
        """Whether it has to be refused."""
        return self.request.speed_m_s == IMPOSSIBLE_M_S


def planned_explorations(rng: np.random.Generator, surfaces: Sequence[str]) -> Iterator[PlannedExploration]:
    """Yield explorations without end; each names the surface that is to lie under the finger."""
    surface = surfaces[0]
    while True:
        if rng.random() < NEW_SURFACE:
            surface = surfaces[int(rng.integers(len(surfaces)))]
        request = replace(_motion(rng), surface=surface, early_stopping=bool(rng.random() < 0.5))
        if rng.random() < INVALID_SHARE:
            request = replace(request, speed_m_s=IMPOSSIBLE_M_S)
        yield PlannedExploration(request, float(rng.uniform(0.1, 1.5)) if rng.random() < STOPPED_SHARE else math.nan)


def _motion(rng: np.random.Generator) -> ExplorationRequest:
    speed_m_s, force_n = float(rng.uniform(0.03, 0.15)), float(rng.uniform(0.5, 3.0))
    direction_rad = float(rng.uniform(-math.pi, math.pi))
    if rng.random() < 0.7:
        distance_m = float(rng.uniform(0.03, 0.12))
        return ExplorationRequest(
            'linear_slide', speed_m_s=speed_m_s, force_n=force_n, distance_m=distance_m, direction_rad=direction_rad
        )
    return ExplorationRequest(
        'circular', speed_m_s=speed_m_s, force_n=force_n, radius_m=0.015, turns=1.0, direction_rad=direction_rad
    )

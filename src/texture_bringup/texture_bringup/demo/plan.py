"""What the demonstration explores, and how."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

from texture_core.exploration import ExplorationRequest


@dataclass(frozen=True)
class DemoPlan:
    """Surfaces of the scene `twelve_textures`, slides over each, and the slide itself.

    The finger touches each time at another place; every second slide goes the other way. A last slide at
    `untrained_speed_m_s` shows what is said outside the conditions of the training.
    """

    surfaces: tuple[str, ...] = ('glass', 'leather', 'woven_cloth', 'ridge_2mm_deep')
    shown: str = 'ridge_2mm_deep'  # in the picture: its ridges make a line in the spectrum, at speed / pitch
    learning_slides: int = 3
    recognition_slides: int = 2
    speed_m_s: float = 0.05
    force_n: float = 1.0
    distance_m: float = 0.06
    untrained_speed_m_s: float = 0.02

    def requests(self, surface: str, slides: int, early_stopping: bool = False) -> Iterator[ExplorationRequest]:
        """Yield the explorations of one surface.

        Parameters
        ----------
        surface
            Label of the surface.
        slides
            Number of explorations.
        early_stopping
            Whether a slide may end when it is certain.

        Yields
        ------
        ExplorationRequest
        """
        for number in range(slides):
            yield ExplorationRequest(
                'linear_slide',
                speed_m_s=self.speed_m_s,
                force_n=self.force_n,
                distance_m=self.distance_m,
                direction_rad=math.pi * (number % 2),
                surface=surface,
                early_stopping=early_stopping,
            )

    def untrained_request(self) -> ExplorationRequest:
        """Return a slide over the shown surface, as in the training but for its speed, and as long in time."""
        [usual] = self.requests(self.shown, 1, early_stopping=True)
        share = self.untrained_speed_m_s / self.speed_m_s
        return replace(usual, speed_m_s=self.untrained_speed_m_s, distance_m=share * self.distance_m)

"""How a finger slides, and which slides are of one kind."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median

# Slides that differ by no more are of one kind: what an arm misses of the speed and force it was asked for.
TURNED_RAD, SPEED_RATIO, FORCE_RATIO = 0.1, 1.15, 1.3


@dataclass(frozen=True)
class SlideMotion:
    """One way to slide.

    Parameters
    ----------
    motion
        Name in the catalogue of motions.
    direction_rad
        From +x towards +y.
    speed_m_s, force_n
        Along the surface, and on it.
    duration_s
        What it costs: of two motions that tell as much, the shorter is made.
    """

    motion: str
    direction_rad: float
    speed_m_s: float
    force_n: float
    duration_s: float

    def is_similar(self, other: SlideMotion) -> bool:
        """Return whether both are of one kind; how long they last does not matter."""
        return (
            self.motion == other.motion
            and abs(math.remainder(self.direction_rad - other.direction_rad, math.tau)) <= TURNED_RAD
            and _within(self.speed_m_s, other.speed_m_s, SPEED_RATIO)
            and _within(self.force_n, other.force_n, FORCE_RATIO)
        )


def group_similar(motions: Sequence[SlideMotion]) -> list[SlideMotion]:
    """Return for each motion the median of its group; a motion joins the first group whose first motion is similar."""
    founders: list[SlideMotion] = []
    groups = []
    for motion in motions:
        group = next((k for k, founder in enumerate(founders) if motion.is_similar(founder)), len(founders))
        if group == len(founders):
            founders.append(motion)
        groups.append(group)
    medians = [
        _median([motion for motion, own in zip(motions, groups, strict=True) if own == k]) for k in range(len(founders))
    ]
    return [medians[group] for group in groups]


def _median(motions: Sequence[SlideMotion]) -> SlideMotion:
    """Return the motion with the medians of all numbers, rounded to what people would ask for."""
    heading = cmath.phase(sum(cmath.rect(1.0, motion.direction_rad) for motion in motions))
    speed, force, duration = (
        float(f'{median(getattr(motion, name) for motion in motions):.3g}')
        for name in ('speed_m_s', 'force_n', 'duration_s')
    )
    return replace(motions[0], direction_rad=round(heading, 3), speed_m_s=speed, force_n=force, duration_s=duration)


def _within(one: float, other: float, factor: float) -> bool:
    return one <= other * factor and other <= one * factor

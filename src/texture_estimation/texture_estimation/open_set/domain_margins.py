"""How far beyond the trained conditions a slide may be made."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from texture_core.errors import InvalidData


@dataclass(frozen=True)
class DomainMargins:
    """How far an exploration may lie outside the conditions of the training.

    Parameters
    ----------
    speed, force
        Relative margins: from low / (1 + margin) to high · (1 + margin) is within.
    direction_rad
        Largest angle to a direction of the training.
    level
        Relative margin of the signal level.

    Examples
    --------
    >>> DomainMargins(speed=0.2).speed
    0.2
    """

    speed: float = 0.15
    force: float = 0.3
    direction_rad: float = 0.35
    level: float = 1.0

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not 0.0 <= value < math.inf:
                raise InvalidData(f'the margin {name} of a domain is {value}; 0 or a positive number is needed')

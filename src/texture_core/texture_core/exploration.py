"""What the exploring finger is asked to do, and what it is doing."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from texture_core.errors import InvalidData
from texture_core.labels import checked_label


class Phase(str, enum.Enum):
    """Phase of an exploration; windows are cut from SLIDE alone."""

    IDLE = 'idle'
    APPROACH = 'approach'
    CONTACT = 'contact'
    SLIDE = 'slide'
    LIFT = 'lift'
    DONE = 'done'
    ABORTED = 'aborted'

    @property
    def code(self) -> int:
        """Number of the phase in the message ExplorationState."""
        return tuple(Phase).index(self)


ENDED = frozenset({Phase.IDLE, Phase.DONE, Phase.ABORTED})


@dataclass(frozen=True)
class ExplorationState:
    """What the finger is doing from `stamp_ns` on; unknown numbers are NaN, unknown names ''.

    `steady_s` guarantees that phase, speed and force hold at least that long after the stamp. A window can be used as
    soon as its last sample arrives, without waiting for the next state.
    """

    stamp_ns: int
    exploration_id: str
    motion: str
    phase: Phase
    steady_s: float = 0.0
    speed_m_s: float = math.nan
    force_n: float = math.nan
    direction_rad: float = math.nan
    progress: float = math.nan
    surface: str = ''
    x_m: float = math.nan
    y_m: float = math.nan
    z_m: float = math.nan
    frame_id: str = ''
    tangential_force_n: float = math.nan


@dataclass(frozen=True)
class ExplorationRequest:
    """What an operator asks for; a number of 0 means the default of the motion, a `timeout_s` of 0 no timeout.

    Raises
    ------
    InvalidData
        If `surface` is no label (see `texture_core.labels`), or `timeout_s` is negative or not finite.
    """

    motion: str
    speed_m_s: float = 0.0
    force_n: float = 0.0
    distance_m: float = 0.0
    radius_m: float = 0.0
    turns: float = 0.0
    duration_s: float = 0.0
    direction_rad: float = 0.0
    surface: str = ''
    early_stopping: bool = False
    timeout_s: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, 'surface', checked_label(self.surface))
        if not 0.0 <= self.timeout_s < math.inf:
            raise InvalidData(f'timeout_s is {self.timeout_s}; 0, for none, or a positive number of seconds is needed')

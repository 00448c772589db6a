"""The features of one window of sliding."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidData


@dataclass(frozen=True, eq=False)
class FeatureVector:
    """Named features of one window; the last of an exploration is empty and has `last` set.

    `feature_set` is the fingerprint of the windows, inputs and features that made the values: a model refuses
    vectors of another fingerprint. `skipped` counts the windows left out so far for lost or non-finite samples.
    `sequence` counts the vectors that its sender has sent before: a jump is what was lost on the way.
    `motion`, `direction_rad` and `sensor` say how the window was measured, as `speed_m_s` and `force_n` do.
    """

    start_ns: int
    exploration_id: str
    window_s: float
    hop_s: float
    names: tuple[str, ...] = ()
    values: Array = field(default_factory=lambda: np.empty(0))
    speed_m_s: float = math.nan
    force_n: float = math.nan
    feature_set: str = ''
    last: bool = False
    skipped: int = 0
    sequence: int = 0
    frame_id: str = ''
    motion: str = ''
    direction_rad: float = math.nan
    sensor: str = ''

    def __post_init__(self) -> None:
        if self.values.shape != (len(self.names),):
            raise InvalidData(f'a feature vector has {len(self.names)} names but values of shape {self.values.shape}')

"""Ids of explorations."""

from __future__ import annotations

from datetime import datetime, timezone

import numpy as np


class ExplorationIds:
    """Make readable unique ids such as '20261120T235959-001-ab12': UTC, a running number, a random end.

    The random end keeps two nodes apart that begin in the same second.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._number = 0

    def next(self, time_ns: int) -> str:
        """Return the name of an exploration that begins at `time_ns` since 1970."""
        self._number += 1
        begin = datetime.fromtimestamp(time_ns // 1_000_000_000, tz=timezone.utc)
        return f'{begin:%Y%m%dT%H%M%S}-{self._number:03d}-{self._rng.integers(0x10000):04x}'

"""How one exploration was made: motion, sensor, and the speed, force and directions of its windows."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.features import FeatureVector

Interval = tuple[float, float]
UNKNOWN: Interval = (math.nan, math.nan)
DIRECTION_DIGITS = 2  # so that a slide has few directions, however long it is


@dataclass(frozen=True)
class SlideConditions:
    """The conditions of one exploration; unknown names are '', unknown numbers NaN.

    Parameters
    ----------
    motion, sensor
        Name of the exploratory motion, and of the sensor that measured.
    speed_m_s, force_n
        Means over the windows in which they are known.
    directions_rad
        Directions of travel of the windows, to a hundredth of a radian, each once.
    speed_range_m_s, force_range_n
        Lowest and highest mean over the first windows, however many: at the start of a slide speed and force settle.
    """

    motion: str = ''
    sensor: str = ''
    speed_m_s: float = math.nan
    force_n: float = math.nan
    directions_rad: tuple[float, ...] = ()
    speed_range_m_s: Interval = UNKNOWN
    force_range_n: Interval = UNKNOWN


class RunningConditions:
    """The conditions of an exploration, window by window.

    Examples
    --------
    >>> running = RunningConditions()
    >>> for speed_m_s in (0.04, 0.06):
    ...     running.update(FeatureVector(0, 'a', 0.5, 0.1, speed_m_s=speed_m_s, motion='linear_slide'))
    >>> round(running.get().speed_m_s, 3), running.get().motion
    (0.05, 'linear_slide')
    """

    def __init__(self) -> None:
        self._motion = self._sensor = ''
        self._speed = _RunningMean()
        self._force = _RunningMean()
        self._directions: dict[float, None] = {}  # in the order in which they came

    def update(self, vector: FeatureVector) -> None:
        """Take the conditions of one more window into account."""
        self._motion = vector.motion or self._motion
        self._sensor = vector.sensor or self._sensor
        self._speed.update(vector.speed_m_s)
        self._force.update(vector.force_n)
        if math.isfinite(vector.direction_rad):
            self._directions[round(vector.direction_rad, DIRECTION_DIGITS)] = None

    def get(self) -> SlideConditions:
        """Return the conditions of the windows so far."""
        return SlideConditions(
            self._motion,
            self._sensor,
            self._speed.value,
            self._force.value,
            tuple(self._directions),
            self._speed.range,
            self._force.range,
        )


class _RunningMean:
    """Mean of the finite values, and the range in which it has been so far."""

    def __init__(self) -> None:
        self.value = math.nan
        self.range = UNKNOWN
        self._sum = 0.0
        self._count = 0

    def update(self, value: float) -> None:
        if math.isfinite(value):
            self._sum += value
            self._count += 1
            self.value = mean = self._sum / self._count
            low, high = self.range
            self.range = (low if low <= mean else mean, high if high >= mean else mean)  # NaN is neither

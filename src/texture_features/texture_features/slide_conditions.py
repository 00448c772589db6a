"""How one exploration was made: motion, sensor, and the speed, force, directions and signal level of its windows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from texture_core.features import FeatureVector

Interval = tuple[float, float]
UNKNOWN: Interval = (math.nan, math.nan)
DIRECTION_DIGITS = 2  # so that a slide has few directions, however long it is
# In the name of the feature that tells the level of a channel, 'signal/moments/signal_log_power/dynamic'.
LOG_POWER = '/moments/signal_log_power/'


class SignalLevel(NamedTuple):
    """Level of one channel over a slide: geometric mean of the root mean square of its windows.

    Parameters
    ----------
    channel
        Topic and channel, such as 'signal/dynamic'.
    rms
        Mean over all windows, in the unit of the signal.
    lowest, highest
        Of the means over the first windows, however many.

    Examples
    --------
    >>> level = SignalLevel('signal/dynamic', rms=12.0, lowest=11.5, highest=13.0)
    >>> level.lowest <= level.rms <= level.highest
    True
    """

    channel: str
    rms: float
    lowest: float
    highest: float


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
    levels
        Of the channels whose moments are among the features.

    Examples
    --------
    >>> made = SlideConditions('linear_slide', speed_m_s=0.05)
    >>> made.speed_m_s, math.isnan(made.force_n)
    (0.05, True)
    """

    motion: str = ''
    sensor: str = ''
    speed_m_s: float = math.nan
    force_n: float = math.nan
    directions_rad: tuple[float, ...] = ()
    speed_range_m_s: Interval = UNKNOWN
    force_range_n: Interval = UNKNOWN
    levels: tuple[SignalLevel, ...] = ()

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> SlideConditions:
        """Return the conditions that `dataclasses.asdict` has written as JSON; what is missing is unknown.

        Raises
        ------
        KeyError, TypeError, ValueError
            If a value cannot be one.
        """
        known = cls()
        return cls(
            motion=str(values.get('motion', '')),
            sensor=str(values.get('sensor', '')),
            speed_m_s=float(values.get('speed_m_s', known.speed_m_s)),
            force_n=float(values.get('force_n', known.force_n)),
            directions_rad=tuple(map(float, values.get('directions_rad', ()))),
            speed_range_m_s=_pair(values.get('speed_range_m_s', UNKNOWN)),
            force_range_n=_pair(values.get('force_range_n', UNKNOWN)),
            levels=tuple(_level(*level) for level in values.get('levels', ())),
        )


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
        self._levels: list[tuple[str, int, _RunningMean]] | None = None  # channel, place among the features, log power

    def update(self, vector: FeatureVector) -> None:
        """Take the conditions of one more window into account."""
        self._motion = vector.motion or self._motion
        self._sensor = vector.sensor or self._sensor
        self._speed.update(vector.speed_m_s)
        self._force.update(vector.force_n)
        if math.isfinite(vector.direction_rad):
            self._directions[round(vector.direction_rad, DIRECTION_DIGITS)] = None
        if self._levels is None and vector.names:
            self._levels = [(channel, place, _RunningMean()) for channel, place in _log_powers(vector.names)]
        for _, place, log_power in self._levels or ():
            log_power.update(float(vector.values[place]))

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
            tuple(_signal_level(channel, log_power) for channel, _, log_power in self._levels or ()),
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


def _level(channel: Any, rms: Any, *interval: Any) -> SignalLevel:
    return SignalLevel(str(channel), float(rms), *_pair(interval))


def _pair(values: Sequence[Any]) -> Interval:
    low, high = values
    return float(low), float(high)


def _log_powers(names: Sequence[str]) -> list[tuple[str, int]]:
    """Return the channels whose logarithm of the power is a feature, and its place among the features."""
    return [(name.replace(LOG_POWER, '/'), place) for place, name in enumerate(names) if LOG_POWER in name]


def _signal_level(channel: str, log_power: _RunningMean) -> SignalLevel:
    return SignalLevel(channel, *(math.exp(0.5 * value) for value in (log_power.value, *log_power.range)))

"""The image of the slow channels: how far each is from where it rested, and where it lies."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from texture_core.signal import TactileSignal

PLACE = re.compile(r'.*_(\d+)_(\d+)')  # 'taxel_6_3': row and column
MAX_CHANNELS = 1024
RESTING_SHARE = 0.05  # of a batch in the resting value: follows a drift of seconds, not a touch
LEAST_NOISES = 10.0  # range of the colours in standard deviations of the noisiest channel, so that noise stays pale


class Taxels:
    """Keep the newest image and the resting one."""

    def __init__(self) -> None:
        self.channels: tuple[str, ...] = ()
        self.places: list[tuple[int, int]] = []
        self.unit = ''
        self._resting: NDArray[np.float64] = np.zeros(0)
        self._newest: NDArray[np.float64] = np.zeros(0)
        self._power: NDArray[np.float64] = np.zeros(0)  # of the noise of each channel

    def update(self, signal: TactileSignal, touching: bool) -> None:
        """Take the newest sample; while nothing is touched it moves the resting image."""
        newest = signal.samples[-1:, :MAX_CHANNELS].astype(np.float64)
        if not len(newest):
            return
        if signal.channels[:MAX_CHANNELS] != self.channels:
            self.channels, self.unit = signal.channels[:MAX_CHANNELS], signal.common_unit
            self.places = places_of(self.channels)
            self._resting, self._power = newest[0], np.zeros(newest.shape[1])
        self._newest = newest[0]
        if not touching:
            known = np.where(np.isfinite(self._resting), self._resting, self._newest)
            step = np.nan_to_num(self._newest - known, posinf=0.0, neginf=0.0)
            self._resting = known + RESTING_SHARE * step
            self._power += RESTING_SHARE * np.where(np.isfinite(self._newest), step**2 - self._power, 0.0)

    @property
    def image(self) -> NDArray[np.float64]:
        """How far each channel is from its resting value, (n_channels,)."""
        return self._newest - self._resting

    @property
    def least_range(self) -> float:
        """Smallest value that has the full colour, in the unit of the channels; 0 while no noise was measured."""
        return LEAST_NOISES * float(np.sqrt(self._power.max(initial=0.0)))


def places_of(channels: tuple[str, ...]) -> list[tuple[int, int]]:
    """Return row and column of each channel: as its name tells, else line by line in a square."""
    named = [PLACE.fullmatch(channel) for channel in channels]
    if named and all(named):
        return [(int(match[1]), int(match[2])) for match in named if match]
    columns = int(np.ceil(np.sqrt(len(channels)))) or 1
    return [divmod(number, columns) for number in range(len(channels))]

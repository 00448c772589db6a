"""One window of a signal, from which features are computed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.arrays import Samples
from texture_core.errors import InvalidData


@dataclass(frozen=True, eq=False)
class Window:
    """Samples of one stream over one stretch of sliding.

    Parameters
    ----------
    samples : (n_samples, n_channels) float64
    rate_hz
        Sampling rate, > 0.
    channels
        Name of each column; () if they do not matter.
    start_ns
        Time of the first sample.
    speed_m_s, force_n
        Mean speed and normal force in the window; NaN if unknown.
    sensor
        Name of the sensor part that measured; '' if unknown.
    """

    samples: Samples
    rate_hz: float
    channels: tuple[str, ...] = ()
    start_ns: int = 0
    speed_m_s: float = math.nan
    force_n: float = math.nan
    sensor: str = ''

    def __post_init__(self) -> None:
        if self.samples.ndim != 2 or 0 in self.samples.shape:
            raise InvalidData(f'a window has samples of shape {self.samples.shape}; (n_samples, n_channels) is needed')
        if not self.rate_hz > 0:
            raise InvalidData(f'a window has a sampling rate of {self.rate_hz} Hz; give one above 0')

    @property
    def duration_s(self) -> float:
        """Length of the window, s."""
        return len(self.samples) / self.rate_hz

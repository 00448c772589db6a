"""Peak-to-median power of the segments of a window: high when the finger sticks and slips."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch, power

MEDIAN, MINIMUM = 'median', 'minimum'


@dataclass(frozen=True)
class PeakToMedianPower:
    """Logarithm of the power of the strongest segment over that of the median or of the weakest one.

    A finger that sticks and slips is still and then jumps; over an even texture all events are alike. The weakest event
    tells a single skid: being still for a tenth of the window does not move the middle.

    Examples
    --------
    >>> alternating = np.resize([1.0, -1.0], 100)[:, None]
    >>> jump = alternating * np.where(np.arange(100) < 10, 3.0, 1.0)[:, None]  # 9 times the power in one segment
    >>> np.exp(PeakToMedianPower()(WindowBatch(jump, rate_hz=100.0))).round(6).item()
    9.0
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    segments: int = param(
        10, 'Number of equal segments of the window; fewer if it has fewer samples.', low=2, high=1000
    )
    reference: str = param(
        MEDIAN,
        'Segment with whose power the largest is compared: the median or the minimum one.',
        choices=(MEDIAN, MINIMUM),
    )
    floor: float = param(
        1e-20, 'Power added before the logarithm, so that silence gives a finite value, unit².', low=1e-300, high=1e300
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return log(strongest / other)."""
        rows = windows.centred_rows
        segments = min(self.segments, rows.shape[-1])
        length = rows.shape[-1] // segments
        cut = rows[..., : segments * length].reshape(*rows.shape[:-1], segments, length)
        powers = power(cut)
        powers.sort(axis=-1)
        other = segments // 2 if self.reference == MEDIAN else 0
        ratio = (powers[..., -1:] + self.floor) / (powers[..., other : other + 1] + self.floor)
        return np.log(ratio)

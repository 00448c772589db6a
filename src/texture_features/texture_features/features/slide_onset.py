"""Whether a window is the first of a slide."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch

NAME = 'slide_onset'


@dataclass(frozen=True)
class SlideOnset:
    """1 for a window that begins with the slide, 0 for later ones and where the time since the start is unknown.

    While friction, contact and sensor settle, all textures look different from what they look like later.

    Examples
    --------
    >>> windows = WindowBatch(np.zeros((2, 5, 1)), rate_hz=100.0, elapsed_s=np.array([0.0, 0.1]))
    >>> SlideOnset()(windows).ravel().tolist()
    [1.0, 0.0]
    """

    per_channel: ClassVar[bool] = False
    names: ClassVar[tuple[str, ...]] = ('',)

    within_s: float = param(
        0.03,
        'Sets how long after the start of a slide a window may begin and be one of the onset.',
        unit='s',
        low=0.0,
        high=60.0,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return 1 or 0, (..., 1, 1)."""
        elapsed_s = np.broadcast_to(windows.elapsed_s, windows.samples.shape[:-2])
        return (elapsed_s <= self.within_s).astype(np.float64)[..., None, None]

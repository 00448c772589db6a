"""Signal energy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from texture_core.arrays import Array
from texture_features.feature import WindowBatch, power


@dataclass(frozen=True)
class SignalEnergy:
    """Integral of the squared, zero-mean signal over the window, unit² s.

    Source: Roberge et al., "Textures recognition through tactile exploration", eq. 1.

    Examples
    --------
    >>> import numpy as np
    >>> SignalEnergy()(WindowBatch(np.array([[2.0], [-2.0]]), rate_hz=10.0)).item()  # 4 unit² for 0.2 s
    0.8
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    def __call__(self, windows: WindowBatch) -> Array:
        """Return ∫ s² dt."""
        rows = windows.centred_rows
        return (power(rows) * (rows.shape[-1] / windows.rate_hz))[..., None]

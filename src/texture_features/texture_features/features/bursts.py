"""How much the strongest moment stands out: what a skid does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import Windows, power

MIDDLE, WEAKEST = 'middle', 'weakest'


@dataclass(frozen=True)
class Bursts:
    """Logarithm of the power of the strongest piece of the window over that of the middle or of the weakest one.

    A finger that sticks and slips is still and then jumps; over an even texture all pieces are alike. The weakest piece
    tells a single skid: being still for a tenth of the window does not move the middle.
    """

    of_signal: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    pieces: int = param(10, 'Number of pieces; fewer if the window has fewer samples.', low=2, high=1000)
    over: str = param(MIDDLE, 'Piece that the strongest is compared with.', choices=(MIDDLE, WEAKEST))
    floor: float = param(1e-20, 'Power added before the logarithm, unit².', low=1e-300, high=1e300)

    def __call__(self, windows: Windows) -> Array:
        """Return log(strongest / other)."""
        rows = windows.centred_rows
        pieces = min(self.pieces, rows.shape[-1])
        length = rows.shape[-1] // pieces
        cut = rows[..., : pieces * length].reshape(*rows.shape[:-1], pieces, length)
        powers = power(cut)
        powers.sort(axis=-1)
        other = pieces // 2 if self.over == MIDDLE else 0
        ratio = (powers[..., -1:] + self.floor) / (powers[..., other : other + 1] + self.floor)
        return np.log(ratio)

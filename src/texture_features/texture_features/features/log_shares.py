"""Log shares: how the load is distributed over the taxels, with its sign."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch


@dataclass(frozen=True)
class LogShares:
    """Signed logarithm of each channel's share of the total load, less the mean of these logarithms.

    The share s of a channel is its mean over the sum of the absolute means. Each gives sign(s) · log(max(|s|, floor) /
    floor): a taxel that carries nearly nothing gives 0, not its noise. Where no level is negative these are the
    centred log-ratios of Aitchison 1986 with a floor that follows the load. A force that presses all taxels harder by
    the same factor changes nothing.

    Examples
    --------
    >>> levels = np.array([[3.0, -1.0, 0.0]])  # pressed, pulled, and free
    >>> shares = LogShares(floor=0.01)(WindowBatch(levels, rate_hz=100.0))[:, 0]
    >>> (shares - shares[2]).round(2).tolist()  # log 75, -log 25, 0
    [4.32, -3.22, 0.0]
    >>> np.allclose(LogShares()(WindowBatch(10 * levels, 100.0)), LogShares()(WindowBatch(levels, 100.0)))
    True
    """

    per_channel: ClassVar[bool] = True
    names: ClassVar[tuple[str, ...]] = ('',)

    floor: float = param(
        0.01,
        'Sets the share of the load below which a channel counts as free; a larger one keeps out more noise.',
        low=1e-6,
        high=0.5,
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the signed log shares."""
        rows = windows.rows
        levels = np.add.reduce(rows, axis=-1) / rows.shape[-1]
        sizes = np.abs(levels)
        total = np.add.reduce(sizes, axis=-1, keepdims=True)
        shares = np.divide(sizes, total, out=np.zeros_like(sizes), where=total > 0.0)
        logs = np.sign(levels) * np.log(np.maximum(shares, self.floor) / self.floor)
        centred: Array = logs - np.add.reduce(logs, axis=-1, keepdims=True) / logs.shape[-1]
        return centred[..., None]

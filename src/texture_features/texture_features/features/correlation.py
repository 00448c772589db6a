"""How two inputs vary together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch, centred, power

TINY = 1e-150


@dataclass(frozen=True)
class Correlation:
    """Mean linear (Pearson) and monotonic (Spearman) correlation of the channels of one input with those of another.

    Both are brought to the grid of the input with fewer samples: a sample there is compared with the mean of the other
    input's samples until the next. Each pair of channels counts the same. Equal samples share the mean of their ranks.
    A channel that is constant, or a single sample long, correlates with nothing: 0. Of one input alone it is the mean
    correlation of its channels with each other, 0 for a single channel.

    Source: Kaboli et al. 2015, eq. 4 and 5; eq. 6 has the means over the electrodes alone.

    Examples
    --------
    >>> rise = np.arange(10.0)[:, None]
    >>> joined = WindowBatch(rise, rate_hz=100.0, joined=(WindowBatch(-(rise**3), rate_hz=100.0),))
    >>> pearson, spearman = Correlation()(joined)[0].round(2).tolist()
    >>> spearman, -1.0 < pearson < -0.9  # monotonic, but not along a straight line
    (-1.0, True)
    """

    per_channel: ClassVar[bool] = False
    names: ClassVar[tuple[str, ...]] = ('pearson', 'spearman')
    joins: ClassVar[bool] = True

    omit: str = param(
        '', "Sets which channels are left out of the means, by their names, such as 'tdc tac pdc'; empty: none."
    )

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the two correlations, (..., 1, 2)."""
        inputs = (windows, *windows.joined)
        count = min(item.samples.shape[-2] for item in inputs)
        rows = [cell_means(self._rows(item), count) for item in inputs]
        values = [_mean_correlation(of_inputs) for of_inputs in (rows, [ranks(of_input) for of_input in rows])]
        return np.stack(values, axis=-1)[..., None, :]

    def _rows(self, windows: WindowBatch) -> Array:
        rows = windows.centred_rows
        return rows[..., windows.without(self.omit), :] if self.omit else rows


def cell_means(rows: Array, count: int) -> Array:
    """Return the means of `count` equal cells of rows, (..., count); at most as many as there are samples.

    Parameters
    ----------
    rows : (..., n_samples)
    count
        Number of cells, at most n_samples.

    Returns
    -------
    (..., count)
        In the unit of the rows.
    """
    length = rows.shape[-1]
    if length == count:
        return rows
    starts = -(-np.arange(count) * length // count)
    means: Array = np.add.reduceat(rows, starts, axis=-1) / np.diff(np.append(starts, length))
    return means


def ranks(rows: Array) -> Array:
    """Return the rank of each sample within its row, from 0; equal ones share their mean rank.

    Parameters
    ----------
    rows : (..., n_samples)

    Returns
    -------
    (..., n_samples)
        Whole numbers, or halves for equal samples.
    """
    order = np.argsort(rows, axis=-1, kind='stable')
    ordered = np.take_along_axis(rows, order, axis=-1)
    place = np.arange(rows.shape[-1])
    begins = np.ones(rows.shape, dtype=bool)
    begins[..., 1:] = ordered[..., 1:] != ordered[..., :-1]
    first = np.maximum.accumulate(np.where(begins, place, 0), axis=-1)
    last = _until_next(begins, place)
    ranked = np.empty_like(rows)
    np.put_along_axis(ranked, order, (first + last) / 2.0, axis=-1)
    return ranked


def _until_next(begins: NDArray[np.bool_], place: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the last place of the run of equal samples that each place is in."""
    ends = np.ones_like(begins)
    ends[..., :-1] = begins[..., 1:]
    backwards = np.where(ends, place, place[-1])[..., ::-1]
    last: NDArray[np.intp] = np.minimum.accumulate(backwards, axis=-1)[..., ::-1]
    return last


def _mean_correlation(inputs: Sequence[Array]) -> Array:
    """Return the mean correlation, (...), of all pairs of rows of different inputs, or of different rows of one."""
    units = np.concatenate([_unit(rows) for rows in inputs], axis=-2)
    origin = np.repeat(np.arange(len(inputs)), [rows.shape[-2] for rows in inputs])
    alone = len(inputs) == 1
    first, second = np.triu_indices(len(origin), k=1)
    chosen = alone | (origin[first] != origin[second])
    if not chosen.any():
        return np.zeros(units.shape[:-2])
    products = (units @ units.swapaxes(-1, -2))[..., first[chosen], second[chosen]]
    mean: Array = np.add.reduce(np.ascontiguousarray(products), axis=-1) / products.shape[-1]
    return mean


def _unit(rows: Array) -> Array:
    """Return zero-mean rows of length 1; 0 for a constant row."""
    difference = centred(rows)
    spread = np.sqrt(power(difference))
    # What rounding leaves of a constant row is no variation.
    largest = np.abs(rows).max(axis=-1)
    varies = spread > 1e-12 * largest
    scale = np.where(varies, 1.0 / (spread + TINY), 0.0) / np.sqrt(rows.shape[-1])
    unit: Array = difference * scale[..., None]
    return unit

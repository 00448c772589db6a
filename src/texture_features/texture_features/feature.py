# SPDX-License-Identifier: Apache-2.0
"""What a feature is: a stateless function of windows that are alike, with named values."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Protocol, TypeVar

import numpy as np

from texture_core.config import param
from texture_core.errors import InvalidData
from texture_core.types import Array, Samples

T = TypeVar('T')


@dataclass(frozen=True, eq=False)
class WindowBatch:
    """One window, or many of one rate and length: the leading axes count the windows.

    Parameters
    ----------
    samples : (..., n_samples, n_channels) float64
        Finite.
    rate_hz
        Sampling rate, > 0.
    speed_m_s, force_n : (...)
        Mean speed and normal force in each window; NaN if unknown.
    tangential_force_n : (...)
        Mean force of the surface against the direction of travel; NaN if unknown.
    elapsed_s : (...)
        From the start of the slide to that of each window; infinite if unknown.
    joined
        The same stretches of time of other inputs, for features that join several; of the same leading axes.
    channels
        Name of each channel; () where nothing names them.

    Examples
    --------
    >>> batch = WindowBatch(np.arange(6.0).reshape(3, 2), rate_hz=1000.0)
    >>> batch.rows.tolist(), batch.centred_rows.tolist()
    ([[0.0, 2.0, 4.0], [1.0, 3.0, 5.0]], [[-2.0, 0.0, 2.0], [-2.0, 0.0, 2.0]])
    """

    samples: Samples
    rate_hz: float
    speed_m_s: Array = field(default_factory=lambda: np.array(np.nan))
    force_n: Array = field(default_factory=lambda: np.array(np.nan))
    joined: tuple[WindowBatch, ...] = ()
    channels: tuple[str, ...] = ()
    elapsed_s: Array = field(default_factory=lambda: np.array(np.inf))
    tangential_force_n: Array = field(default_factory=lambda: np.array(np.nan))
    _memo: dict[Hashable, Any] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        if self.samples.ndim < 2 or 0 in self.samples.shape[-2:]:
            raise InvalidData(
                f'windows to describe have samples of shape {self.samples.shape}; '
                '(..., n_samples, n_channels) with at least one of each is needed'
            )

    @property
    def rows(self) -> Array:
        """The samples as (..., n_channels, n_samples), contiguous.

        Sums along the last axis have the same rounding for one window as for many, and are fast.
        """
        return np.ascontiguousarray(self.samples.swapaxes(-1, -2))

    @property
    def centred_rows(self) -> Array:
        """The rows less their mean."""
        return self.shared('centred_rows', lambda: centred(self.rows))

    @property
    def moving_m_s(self) -> Array:
        """The speed, (...); NaN where it is unknown or not above 0."""
        return self.shared('moving_m_s', lambda: np.where(np.greater(self.speed_m_s, 0), self.speed_m_s, np.nan))

    def without(self, omitted: str) -> list[int]:
        """Return the numbers of the channels that are left when some are omitted.

        Parameters
        ----------
        omitted
            Names separated by spaces; one that no channel has is passed over.

        Raises
        ------
        InvalidData
            If some are to be omitted and the channels have no names, or none is left.
        """
        if not omitted:
            return list(range(self.samples.shape[-1]))
        if not self.channels:
            raise InvalidData(
                f"channels '{omitted}' are to be omitted, but the windows do not name their channels; give WindowBatch "
                'its `channels`'
            )
        left = [number for number, name in enumerate(self.channels) if name not in omitted.split()]
        if not left:
            raise InvalidData(
                f"all channels ({', '.join(self.channels)}) are omitted by '{omitted}'; leave one or more"
            )
        return left

    def shared(self, key: Hashable, compute: Callable[[], T]) -> T:
        """Return an intermediate result that several features need; it is computed once."""
        if key not in self._memo:
            self._memo[key] = compute()
        return self._memo[key]


class Feature(Protocol):
    """Frozen parameters of a feature; called with windows it gives its values.

    A feature of the signal gives (..., n_channels, n_names); one of the motion, such as the speed, (..., 1, n_names)
    and has `per_channel` False. One that can join several inputs, found in `windows.joined`, says so by a class
    variable `joins` that is True; it has `per_channel` False. So has one of pairs of channels, which gives
    (..., n_pairs, n_names) in the order of itertools.combinations and says so by a class variable `per_pair` that is
    True.

    Examples
    --------
    >>> class Range:  # the largest less the smallest sample of each channel
    ...     per_channel, names = True, ('',)
    ...
    ...     def __call__(self, windows: WindowBatch) -> Array:
    ...         return np.ptp(windows.rows, axis=-1)[..., None]
    >>> Range()(WindowBatch(np.array([[1.0], [4.0]]), rate_hz=1000.0)).tolist()
    [[3.0]]
    """

    @property
    def per_channel(self) -> bool:
        """Whether there are values for each channel."""

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each value of one channel; '' for the only value of a feature."""

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the values; finite for finite samples.

        Parameters
        ----------
        windows
            Windows of one input.

        Returns
        -------
        (..., n_channels, n_values)
            Of each channel, or (..., 1, n_values) where there are none for each channel.
        """


def floor_param(added: str = 'Power', unit: str = 'unit²', default: float = 1e-20) -> Any:
    """Return the parameter `floor` of a feature that is a logarithm.

    Parameters
    ----------
    added, unit
        What it is added to, and the unit of that.
    default
        Far below any value of a sensor that works.
    """
    sentence = f'{added} added before the logarithm, so that silence gives a finite value, {unit}.'
    return param(default, sentence, low=1e-300, high=1e300)


def centred(rows: Array) -> Array:
    """Return rows less their mean, (..., n_samples).

    Parameters
    ----------
    rows : (..., n_samples)

    Returns
    -------
    (..., n_samples)
        In the unit of the rows.
    """
    # A product with equal shares is the fastest mean, and has the same rounding for one row as for many.
    return rows - (rows @ mean_weights(rows.shape[-1]))[..., None]


@lru_cache(maxsize=64)
def mean_weights(count: int) -> Array:
    """Return 1 / count, `count` times: what a mean is a product with.

    Returns
    -------
    (count,)
        Read-only, because it is shared.
    """
    equal = np.full(count, 1.0 / count)
    equal.flags.writeable = False
    return equal


def power(rows: Array) -> Array:
    """Return the mean square of each row, (...).

    Parameters
    ----------
    rows : (..., n_samples)

    Returns
    -------
    (...)
        In the square of the unit of the rows; the mean is not removed.
    """
    # A product of vectors for each row: no array of squares, and the same rounding for one row as for many.
    squares: Array = (rows[..., None, :] @ rows[..., :, None])[..., 0, 0]
    return squares / rows.shape[-1]


def first_difference(rows: Array) -> Array:
    """Return the steps from sample to sample, (..., max(1, n_samples - 1)); 0 for a single sample.

    Parameters
    ----------
    rows : (..., n_samples)

    Returns
    -------
    (..., max(1, n_samples - 1))
        In the unit of the rows, per sample step.
    """
    if rows.shape[-1] == 1:
        return np.zeros_like(rows)
    return rows[..., 1:] - rows[..., :-1]

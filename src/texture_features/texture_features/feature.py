# SPDX-License-Identifier: Apache-2.0
"""What a feature is: a stateless function of windows that are alike, with named values."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import combinations
from typing import Any, Protocol, TypeVar

import numpy as np

from texture_core.errors import InvalidData
from texture_core.types import Array, Samples

# --------------------
# Speed of the finger from the delays between the taxels of an array.

SUM_FLOOR = 1e-12


@dataclass(frozen=True, eq=False)
class ArraySpeedEstimator:
    """Places of the taxels along the direction of sliding, and from them the speed of any slide.

    A bump that taxel a meets now, taxel b meets d_ab / v later. The cross-correlations of the rates of change of all
    pairs are read off at d_ab / v and added up; the speed with the greatest sum is taken. Neither the surface nor its
    label is needed. The places come from a drawing of the sensor, or from slides at known speeds by `training`.

    Parameters
    ----------
    offsets_m : (n_pairs,)
        d_ab of each pair of taxels a < b, in the order of itertools.combinations.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> surface = np.cumsum(rng.standard_normal(400))  # met 1 mm later by the second taxel: 10 samples at 0.1 m/s
    >>> slide = np.column_stack([surface[10:], surface[:-10]])
    >>> estimator = ArraySpeedEstimator.from_positions(np.array([1e-3, 0.0]))
    >>> estimator(slide, 1000.0, np.array([0.05, 0.1, 0.2]))
    0.1
    """

    offsets_m: Array

    @classmethod
    def from_positions(cls, positions_m: Array) -> ArraySpeedEstimator:
        """Return the estimator for taxels at known places.

        Parameters
        ----------
        positions_m : (n_taxels,)
            Place of each taxel along the direction of sliding, m.
        """
        return cls(np.array([positions_m[a] - positions_m[b] for a, b in combinations(range(len(positions_m)), 2)]))

    @classmethod
    def fit(
        cls, slides: list[tuple[Array, float, float]], reach_m: float = 0.02, steps: int = 401
    ) -> ArraySpeedEstimator:
        """Return the estimator from slides at known speeds.

        Parameters
        ----------
        slides
            (samples (n, n_taxels), rate in Hz, speed in m/s) of each.
        reach_m
            No two taxels are further apart along the direction of sliding.
        steps
            Offsets tried, from -reach_m to reach_m.

        Returns
        -------
        ArraySpeedEstimator
            With the offset of each pair that fits all slides best, to reach_m · 2 / (steps - 1).

        Raises
        ------
        InvalidData
            If there are no slides.
        """
        if not slides:
            raise InvalidData('there are no slides to learn the places of the taxels from; give one at a known speed')
        offsets = np.asarray(np.linspace(-reach_m, reach_m, steps), dtype=np.float64)
        each = [_correlations(samples, rate_hz, offsets / speed_m_s) for samples, rate_hz, speed_m_s in slides]
        return cls(offsets[np.sum(each, axis=0).argmax(axis=1)])

    def __call__(self, samples: Array, rate_hz: float, candidates_m_s: Array) -> float:
        """Return the most probable of the candidate speeds for a slide, (n, n_taxels)."""
        lags_s = self.offsets_m[:, None] / np.asarray(candidates_m_s)
        return float(candidates_m_s[int(_correlations(samples, rate_hz, lags_s).sum(axis=0).argmax())])


def _correlations(samples: Array, rate_hz: float, lags_s: Array) -> Array:
    """Return the correlation of the steps of each pair of taxels at lags, (n_pairs, n_lags); `lags_s` is either."""
    steps = np.diff(samples, axis=0)
    steps = steps - steps.mean(axis=0)
    points = 2 << (len(steps) - 1).bit_length()
    lines = np.fft.rfft(steps, points, axis=0)
    strength = np.sqrt(np.square(steps).sum(axis=0)) + SUM_FLOOR
    first, second = (list(side) for side in zip(*combinations(range(samples.shape[1]), 2), strict=True))
    cross = np.fft.irfft(lines[:, first].conj() * lines[:, second], points, axis=0)
    cross = np.fft.fftshift(cross, axes=0) / (strength[first] * strength[second])
    axis = (np.arange(points) - points // 2) / rate_hz
    wanted = np.broadcast_to(lags_s, (len(first), lags_s.shape[-1]))
    return np.stack([np.interp(row, axis, column) for row, column in zip(wanted, cross.T, strict=True)])


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
        result: T = self._memo[key]
        return result


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
    difference: Array = rows - (rows @ mean_weights(rows.shape[-1]))[..., None]
    return difference


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

"""Speed of the finger from the delays between the taxels of an array."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidData

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

"""Level of each channel without load: measured by a tare, published, subtracted if wanted, and watched for drift."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_core.signal import NANOSECONDS, TARED, TactileSignal

# A tare is refused if the two halves of it differ by more than this many standard deviations of the samples; the mean
# of a half is right to a small part of one.
MOST_MOVED = 3.0
LEAST_SAMPLES = 4
RELATIVE_FLOOR = 1e-4  # the noise of a channel is taken for at least this share of its baseline: some have none


@dataclass(frozen=True, eq=False)
class Baseline:
    """What a stream measures without load.

    Parameters
    ----------
    level : (n_channels,)
        Mean of each channel during the tare, in its unit.
    noise : (n_channels,)
        Standard deviation of each channel during the tare.
    stamp_ns
        When the tare began.
    stream
        A batch of the stream, for its names and units.
    """

    level: Array
    noise: Array
    stamp_ns: int
    stream: TactileSignal

    def subtract_from(self, batch: TactileSignal) -> TactileSignal:
        """Return a batch without the baseline; the sensor's name says so."""
        samples = (batch.samples - self.level).astype(np.float32)
        return replace(batch, samples=samples, sensor=f'{batch.sensor}{TARED}')

    def drift(self, level: Array) -> Array:
        """Return by how many standard deviations of the noise a level differs from the baseline.

        Parameters
        ----------
        level : (n_channels,)
            Mean of each channel.

        Returns
        -------
        (n_channels,)
            0 or more.
        """
        floor = np.maximum(RELATIVE_FLOOR * np.abs(self.level), np.median(self.noise))
        off: Array = np.abs(level - self.level) / np.maximum(np.maximum(self.noise, floor), np.finfo(float).tiny)
        return off

    def as_signal(self) -> TactileSignal:
        """Return the baseline as a batch of one sample."""
        return replace(self.stream, stamp_ns=self.stamp_ns, first_sample=0, samples=self.level[None].astype(np.float32))


class Tare:
    """Collect the samples of a stream until its baseline is known.

    Parameters
    ----------
    duration_s
        Over how much the level is averaged.
    skip_s
        How much is left out before, while the device sets a bias of its own.
    """

    def __init__(self, duration_s: float, skip_s: float = 0.0) -> None:
        self._duration_s = duration_s
        self._skip_s = skip_s
        self._batches: list[TactileSignal] = []
        self._begin_ns: int | None = None

    def add(self, batch: TactileSignal) -> Baseline | None:
        """Take a batch; return the baseline when the last one has come.

        Raises
        ------
        InvalidData
            If the stream holds too little, or moved during the tare.
        """
        if self._begin_ns is None:
            self._begin_ns = batch.stamp_ns + round(self._skip_s * NANOSECONDS)
        if batch.stamp_ns < self._begin_ns:
            return None
        self._batches.append(batch)
        if batch.end_ns < self._begin_ns + self._duration_s * NANOSECONDS:
            return None
        return baseline_of(self._batches)


def baseline_of(batches: Sequence[TactileSignal]) -> Baseline:
    """Return the baseline out of the batches of a stream, without load.

    Raises
    ------
    InvalidData
        If they hold too few samples, no valid one of a channel, or a level that moved.
    """
    first = batches[0]
    samples = np.concatenate([batch.samples for batch in batches]).astype(np.float64)
    if len(samples) < LEAST_SAMPLES or np.isnan(samples).all(axis=0).any():
        raise InvalidData(
            f"tare of '{first.sensor}': {len(samples)} samples came, or a channel without any valid one; "
            'check the sensor, or tare for longer'
        )
    halves = np.array_split(samples, 2)
    begun, ended = (np.nanmean(half, axis=0) for half in halves)
    noise = np.sqrt(np.mean([np.nanvar(half, axis=0) for half in halves], axis=0))
    moved = np.abs(ended - begun) > MOST_MOVED * np.maximum(noise, RELATIVE_FLOOR * np.abs(begun)) + 1e-12
    if moved.any():
        names = ', '.join(name for name, has in zip(first.channels, moved, strict=True) if has)
        raise InvalidData(
            f"tare of '{first.sensor}': the level of {names} moved meanwhile; let nothing touch the finger and tare "
            'again'
        )
    return Baseline(np.nanmean(samples, axis=0), noise, first.stamp_ns, first)


def saturated(
    samples: NDArray[np.float32], lowest: Array, highest: Array, least_share: float = 0.01
) -> NDArray[np.bool_]:
    """Return which channels stand at an end of their range in more than a share of the samples.

    Parameters
    ----------
    samples : (n_samples, n_channels)
        Samples of the last while.
    lowest, highest
        Ends of the range, of all channels or of each.
    least_share
        Single samples at an end are a hard touch, and no fault.

    Returns
    -------
    (n_channels,) bool
    """
    at_end = (samples <= lowest) | (samples >= highest)
    too_often: NDArray[np.bool_] = at_end.mean(axis=0) > least_share
    return too_often

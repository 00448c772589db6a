"""Watch the baseline of the channels of one stream."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_core.signal import TactileSignal
from texture_drivers.baseline import Baseline, Tare, saturated

DEAD_S = 30.0  # a channel that has not changed for so long, while most of its stream has, is dead
MOST_KEPT_S = 5.0  # of samples between two reviews


NAMED = 3  # channels in a sentence
DRIFT_REVIEWS = 3  # so many in a row show a drift: one may be a touch


Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class TareParams:
    """How the level without load is measured and used."""

    tare_s: float = param(
        1.0,
        "Sets over how long the service 'tare' averages; a longer time gives a more exact baseline.",
        unit='s',
        low=0.1,
        high=60.0,
    )
    subtract_baseline: bool = param(
        False,
        'Subtracts the baseline from the published samples once the sensor has been tared; a model needs the setting '
        'of its training.',
    )
    auto_tare: bool = param(
        False,
        'Tares by itself while no exploration touches anything, at the start and whenever the level has drifted; it '
        "needs the topic 'exploration'.",
    )
    drift_limit: float = param(
        10.0,
        'Sets the drift of an unloaded channel, in standard deviations of its noise, from which on it is reported; a '
        'larger value reports less.',
        low=1.0,
        high=1e6,
    )


class StreamWatch:
    """Watch one stream."""

    def __init__(self, limits: tuple[Any, Any] | None) -> None:
        self.baseline: Baseline | None = None
        self.drift = 0.0  # largest of all channels, in standard deviations of their noise
        self.drifted = False
        self._limits = limits
        self._tare: Tare | None = None
        self._batches: list[TactileSignal] = []
        self._last: NDArray[np.float32] | None = None  # newest valid sample of each channel
        self._still_s: Array = np.zeros(0)  # for how long each channel has not changed
        self._drifts = 0

    @property
    def taring(self) -> bool:
        """Whether a tare is under way."""
        return self._tare is not None

    def start_tare(self, tare: Tare | None) -> None:
        """Tare from the next batch on; None gives up a tare."""
        self._tare = tare

    def add(self, batch: TactileSignal) -> bool:
        """Take a batch; return whether it has completed a baseline. InvalidData if the tare is refused."""
        if len(self._batches) * len(batch.samples) < MOST_KEPT_S * batch.sampling_rate_hz:
            self._batches.append(batch)
        tare, found = self._tare, None
        if tare is not None:
            self._tare = None  # unless it goes on
            found = tare.add(batch)
            self._tare = None if found else tare
        if found:
            self.baseline, self.drifted, self.drift, self._drifts = found, False, 0.0, 0
        return found is not None

    def review(self, elapsed_s: float, unloaded: bool | None, drift_limit: float) -> list[str]:
        """Return sentences on what is wrong with the samples since the last review.

        Parameters
        ----------
        elapsed_s
            Time since then.
        unloaded
            Whether nothing touches the finger; None if nobody tells.
        drift_limit
            See `TareParams`.

        Returns
        -------
        list of str
            None if all is well.
        """
        batches, self._batches = self._batches, []
        if not batches or len({batch.channels for batch in batches}) > 1:
            return []
        samples = np.concatenate([batch.samples for batch in batches])
        channels = batches[0].channels
        faults = []
        if self._limits is not None:
            faults += _named(saturated(samples, *self._limits), channels, 'is saturated: less force, or another gain')
        faults += _named(self._dead(samples, elapsed_s), channels, 'is dead: it does not change; check its wiring')
        if unloaded and self.baseline is not None:
            faults += self._drift_faults(samples, channels, drift_limit)
        return faults

    def _dead(self, samples: NDArray[np.float32], elapsed_s: float) -> Flags:
        """Return which channels hold no valid sample, or have not changed for long while most of the stream has."""
        invalid = np.isnan(samples).all(axis=0)
        if len(self._still_s) != samples.shape[1]:
            self._still_s, self._last = np.zeros(samples.shape[1]), samples[0]
        changed = (samples != self._last).any(axis=0)
        self._last = samples[-1]
        self._still_s = np.where(changed, 0.0, self._still_s + elapsed_s)
        still: Flags = self._still_s >= DEAD_S
        dead: Flags = invalid | (still & (2 * still.sum() < len(still)))
        return dead

    def _drift_faults(self, samples: NDArray[np.float32], channels: Sequence[str], limit: float) -> list[str]:
        assert self.baseline is not None
        drifts = self.baseline.drift(np.nanmean(samples, axis=0))
        self.drift = float(np.nanmax(drifts))
        self._drifts = self._drifts + 1 if self.drift > limit else 0
        self.drifted = self._drifts >= DRIFT_REVIEWS
        if not self.drifted:
            return []
        return _named(drifts > limit, channels, 'has drifted off its baseline; tare again without load')


def _named(found: Flags, channels: Sequence[str], what: str) -> list[str]:
    """Return a sentence on the channels that were found; none if there are none."""
    names = [name for name, has in zip(channels, found, strict=True) if has]
    if not names:
        return []
    more = f' and {len(names) - NAMED} more' if len(names) > NAMED else ''
    return [f'{", ".join(names[:NAMED])}{more} {what}']

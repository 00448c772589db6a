"""Labelled slides as arrays: all samples of one topic, and what the finger did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidData
from texture_core.exploration import ExplorationState
from texture_core.signal import NANOSECONDS
from texture_features.feature import WindowBatch
from texture_recordings.labelled_slide import LabelledSlide


@dataclass(frozen=True, eq=False)
class SlideSamples:
    """One slide.

    Parameters
    ----------
    slide
        Where it lies, its surface and number.
    before : (m, n_channels)
        Samples before the slide began, in contact; often none.
    samples : (n, n_channels)
        Samples of the covered time, evenly spaced.
    rate_hz, channels
        Of the samples.
    speed_m_s, force_n, direction_rad
        Means over the states of the slide (the first direction); NaN if unknown.

    Examples
    --------
    >>> from texture_recordings.slide_dataset import SlideDataset
    >>> dataset = SlideDataset.from_arrays({'signal': [np.ones((100, 1))]}, ['cork'], {'signal': 100.0}, speed_m_s=0.05)
    >>> [slide] = dataset.samples('signal')
    >>> slide.surface, slide.windows(count=50).samples.shape
    ('cork', (50, 1))
    """

    slide: LabelledSlide
    before: Array
    samples: Array
    rate_hz: float
    channels: tuple[str, ...]
    speed_m_s: float
    force_n: float
    direction_rad: float

    @property
    def surface(self) -> str:
        """The label."""
        return self.slide.surface

    @property
    def distance_m(self) -> float:
        """How far the finger slid; NaN if the speed is unknown."""
        return len(self.samples) / self.rate_hz * self.speed_m_s

    @classmethod
    def of(cls, slide: LabelledSlide, topic: str) -> SlideSamples:
        """Return the samples of one topic of a slide.

        Raises
        ------
        InvalidData
            If it has no samples of the topic or lost some.
        """
        batches, states = slide.signals.get(topic, ()), slide.sliding
        where = f"slide '{slide.name}' in '{slide.bag}'"
        if not batches or not states:
            raise InvalidData(f"{where} has no '{topic}' while sliding; name another topic")
        if any(after.first_sample != before.next_sample for before, after in pairwise(batches)):
            raise InvalidData(f'{where} has lost samples; use windows of it instead')
        rate_hz = batches[0].sampling_rate_hz
        samples = np.concatenate([batch.samples for batch in batches]).astype(np.float64)
        first, last = (round((at - batches[0].stamp_ns) * rate_hz / NANOSECONDS) for at in _covered(states))
        return cls(
            slide, samples[: max(first, 0)], samples[max(first, 0) : last], rate_hz, batches[0].channels,
            slide.speed_m_s, slide.force_n, slide.direction_rad,
        )  # fmt: skip

    def windows(self, start: int = 0, count: int | None = None, speed_m_s: float | None = None) -> WindowBatch:
        """Return a stretch of the slide, all of it by default, to be described; at another speed if one is given.

        Parameters
        ----------
        start
            Number of the first sample.
        count
            Number of samples; None for all from there on.
        speed_m_s
            Speed to which the stretch is resampled; None keeps that of the slide.

        Returns
        -------
        WindowBatch
            One window.
        """
        samples = self.samples[start : None if count is None else start + count]
        speed = self.speed_m_s if speed_m_s is None else speed_m_s
        return WindowBatch(samples, self.rate_hz, np.array(speed), np.array(self.force_n), channels=self.channels)


def _covered(states: Sequence[ExplorationState]) -> tuple[int, int]:
    return states[0].stamp_ns, max(state.stamp_ns + round(state.steady_s * NANOSECONDS) for state in states)

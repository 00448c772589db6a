# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Find the slides in a continuous recording: a threshold with hysteresis on the power of the vibration."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import percentile_filter, uniform_filter1d
from scipy.signal import savgol_filter

from texture_core.config import param
from texture_core.errors import InvalidParameter
from texture_core.types import NANOSECONDS, Array, ExplorationState, Phase, Samples, TactileSignal
from texture_features.windows import SampleBuffer

CELL_S = 0.005  # in which the power is computed
SMOOTHED_CELLS, SMOOTHED_PERCENTILE = 11, 70  # rest and sliding are distinguished over 55 ms; a knock lasts less
SMOOTH_S, SMOOTH_ORDER = 0.05, 3  # what follows a cubic over 50 ms is the load, not vibration
LEAST_S = 0.15  # a shorter slide is none
MAX_GAP_S = 0.06  # below the threshold, and still part of one slide; from the touch to the slide it takes longer
# The quietest tenth of the means of 55 ms, of which half are at rest, ends at 0.8 of the mean of rest.
REST_QUANTILE, REST_OVER_QUANTILE = 0.1, 1.25
MIN_REST = 1e-9  # fraction of the largest power: samples that do not change at all are no measure of the noise
WHOLE_S = 1e6  # so that a recording is kept as a whole
MOTION = 'detected'


@dataclass(frozen=True)
class SegmentationParams:
    """How sliding is found."""

    on: float = param(
        6.0, 'Start threshold: power over baseline power above which sliding is detected.', low=1.0, high=1e6
    )
    off: float = param(
        3.0, 'Stop threshold: power over baseline power below which sliding ends (hysteresis).', low=1.0, high=1e6
    )
    ramp_s: float = param(
        0.2, 'Acceleration and deceleration time of the robot: left out at both ends.', unit='s', low=0.0, high=10.0
    )
    noise_rms: float = param(
        0.0,
        'Baseline noise of the sensor, rms; 0 estimates it from the quietest tenth of the recording.',
        low=0.0,
    )

    def __post_init__(self) -> None:
        if self.off > self.on:
            raise InvalidParameter(
                f"'off' is {self.off:g} and 'on' is {self.on:g}; a slide ends below the power at which it starts: give "
                "an 'off' of at most 'on'"
            )


def cell_power(samples: Samples, rate_hz: float) -> Array:
    """Return the power of the vibration in cells of 5 ms, (n_cells, n_channels); what is not finite has none."""
    width, smoothed = max(1, round(CELL_S * rate_hz)), max(2 * round(0.5 * SMOOTH_S * rate_hz) + 1, SMOOTH_ORDER + 2)
    known = np.isfinite(samples)
    vibration = np.where(known, samples, 0.0)
    vibration -= np.where(known, vibration, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    if len(samples) <= smoothed:
        return np.empty((0, samples.shape[1]))
    vibration -= savgol_filter(vibration, smoothed, SMOOTH_ORDER, axis=0)
    vibration[~known] = 0.0
    count = len(samples) // width
    power: Array = np.square(vibration[: count * width]).reshape(count, width, -1).mean(axis=1)
    return power


def rest_power(power: Array) -> Array:
    """Return the power of each channel at rest, (n_channels,), from the quietest tenth of a recording."""
    smooth = uniform_filter1d(power, SMOOTHED_CELLS, axis=0)
    quiet = REST_OVER_QUANTILE * np.quantile(smooth, REST_QUANTILE, axis=0, method='lower')
    return np.maximum(np.maximum(quiet, MIN_REST * power.max(axis=0)), np.finfo(float).tiny)


def find_sliding(
    samples: Samples, rate_hz: float, params: SegmentationParams, rest: Array | None = None
) -> list[tuple[float, float]]:
    """Return where the finger slides at a steady speed, (start, end) in s from the first sample, in order.

    A finger at rest gives the sensor's noise, a sliding one vibration that grows with its speed: it slides where the
    mean power over that of rest passes `on` and stays above `off`, and at steady speed one ramp from both ends.
    """
    power = cell_power(samples, rate_hz)
    if len(power) < SMOOTHED_CELLS:
        return []
    rest = rest_power(power) if rest is None else rest
    rest = np.full(samples.shape[1], params.noise_rms**2) if params.noise_rms else rest
    ratio = percentile_filter((power / rest).mean(axis=1), SMOOTHED_PERCENTILE, SMOOTHED_CELLS, mode='nearest')
    cell_s = max(1, round(CELL_S * rate_hz)) / rate_hz
    edges = np.flatnonzero(np.diff(np.concatenate(([0], ratio > params.off, [0])))).reshape(-1, 2)
    runs: list[list[int]] = []
    for first, last in edges.tolist():
        if not (ratio[first:last] > params.on).any():
            continue
        if runs and (first - runs[-1][1]) * cell_s <= MAX_GAP_S:
            runs[-1][1] = last
        else:
            runs.append([first, last])
    # Sliding that continues before the first sample or after the last one has no ramp there.
    found = [
        (
            first * cell_s + (params.ramp_s if first else 0.0),
            last * cell_s - (params.ramp_s if last < len(power) else 0.0),
        )
        for first, last in runs
    ]
    return [(start_s, end_s) for start_s, end_s in found if end_s - start_s >= LEAST_S]


def segment_recording(
    signals: Iterable[TactileSignal], params: SegmentationParams, exploration_id: str = 'detected'
) -> list[ExplorationState]:
    """Return the states of the slides in a recording of vibration, a `slide` and a `lift` each.

    The sensor's noise is estimated at rest, so let the finger rest at first, or give `noise_rms`.
    """
    runs: list[SampleBuffer] = []
    for batch in sorted(signals, key=lambda batch: batch.stamp_ns):
        if runs and runs[-1].continued_by(batch):
            runs[-1].append(batch)
        elif len(batch.samples):
            runs.append(SampleBuffer(batch, WHOLE_S))
    whole = [run.take(run.first_sample, run.next_sample - run.first_sample) for run in runs]
    # A channel is as quiet as in its quietest run: one may hold little rest.
    rests: dict[int, Array] = {}
    for run, samples in zip(runs, whole, strict=True):
        if len(power := cell_power(samples, run.rate_hz)):
            known = rests.get(power.shape[1], rest_power(power))
            rests[power.shape[1]] = np.minimum(known, rest_power(power))
    states: list[ExplorationState] = []
    for run, samples in zip(runs, whole, strict=True):
        for interval in find_sliding(samples, run.rate_hz, params, rests.get(samples.shape[1])):
            start_ns, end_ns = (run.time_of(run.first_sample + at_s * run.rate_hz) for at_s in interval)
            start_ns = max(start_ns, states[-1].stamp_ns if states else 0)  # a sensor that starts again may be early
            if end_ns - start_ns < LEAST_S * NANOSECONDS:
                continue
            name = f'{exploration_id}/{len(states) // 2 + 1:03d}'
            steady_s = (end_ns - start_ns) / NANOSECONDS
            states.append(ExplorationState(start_ns, name, MOTION, Phase.SLIDE, steady_s=steady_s))
            states.append(ExplorationState(end_ns, name, MOTION, Phase.LIFT))
    return states

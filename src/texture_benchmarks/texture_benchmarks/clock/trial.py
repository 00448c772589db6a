"""Try the clock on a simulated stream, and tell how far its stamps are from the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.signal import NANOSECONDS
from texture_drivers.clock import StreamClock

START_NS = 1_700_000_000 * NANOSECONDS  # some day


@dataclass(frozen=True, eq=False)
class ClockErrors:
    """True time of each batch's first sample since the start, and the errors of three ways to stamp it, s.

    All arrays are of shape (n_batches,).
    """

    time_s: Array
    clock_error_s: Array  # of StreamClock
    arrival_error_s: Array  # of the time of arrival, less the length of the batch
    nominal_error_s: Array  # of counting from the first arrival at the nominal rate


def simulate_clock_errors(
    rng: np.random.Generator,
    *,
    duration_s: float = 600.0,
    rate_hz: float = 1000.0,
    batch: int = 10,
    drift: float = 50e-6,
    jitter_s: float = 5e-3,
) -> ClockErrors:
    """Return the errors of stamping a stream whose batches arrive late by an exponential delay of mean `jitter_s`.

    Parameters
    ----------
    rng
        Random numbers of the delays.
    duration_s
        Length of the stream.
    rate_hz
        Sampling rate.
    batch
        Samples of a batch.
    drift
        Relative error of the rate of the sensor's clock.
    jitter_s
        Mean delay of a batch.

    Returns
    -------
    ClockErrors
        Errors of the stamps over time, s.
    """
    last: AnyArray = np.arange(1, int(duration_s * rate_hz / batch) + 1) * batch - 1
    period_s = (1 + drift) / rate_hz
    # A line delivers in order: who is late holds up all behind.
    arrival_s = np.maximum.accumulate(last * period_s + rng.exponential(jitter_s, len(last)))
    first_s = (last - batch + 1) * period_s
    return ClockErrors(
        time_s=first_s,
        clock_error_s=_stamps_s(last, arrival_s, rate_hz, batch) - first_s,
        arrival_error_s=arrival_s - (batch - 1) / rate_hz - first_s,
        nominal_error_s=arrival_s[0] + (last - last[0]) / rate_hz - (batch - 1) / rate_hz - first_s,
    )


def _stamps_s(last: AnyArray, arrival_s: Array, rate_hz: float, batch: int) -> Array:
    clock = StreamClock(rate_hz)
    stamps = []
    for index, arrival_ns in zip(last.tolist(), START_NS + np.rint(arrival_s * NANOSECONDS).astype(int), strict=True):
        clock.observe(index, int(arrival_ns))
        stamps.append(clock.time_ns(index - batch + 1) - START_NS)
    return np.array(stamps) / NANOSECONDS

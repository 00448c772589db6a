"""What a driver does when its device is unplugged and comes back, and when it sends ten times too fast."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from texture_benchmarks.load.rig import Rig
from texture_core.signal import NANOSECONDS, TactileSignal

TOO_FAST = 10.0
BEFORE_S, AWAY_S, AFTER_S = 0.5, 0.3, 0.3


@dataclass(frozen=True)
class ReplugFigures:
    """A device that was away several times.

    Parameters
    ----------
    times
        How often.
    back_s
        Median and longest time from the plug to the first sample that the driver delivers.
    index_error_s
        Largest difference between the jump of the index and the time that passed by the stamps.
    out_of_order
        How often the index or a stamp went back.
    """

    times: int
    back_s: tuple[float, float]
    index_error_s: float
    out_of_order: int


@dataclass(frozen=True)
class FloodFigures:
    """A device that samples and sends ten times as fast as its nominal rate.

    Parameters
    ----------
    seconds
        How long it was read.
    samples_per_s
        Samples delivered.
    lost, unsent_bytes
        What the driver reports as lost, and what the emulated device could not send.
    out_of_order
        How often the index went back.
    stamp_error_s
        Difference between the last stamp and the host's clock.
    """

    seconds: float
    samples_per_s: float
    lost: int
    unsent_bytes: int
    out_of_order: int
    stamp_error_s: float


def replug(name: str, folder: Path, times: int) -> ReplugFigures:
    """Unplug a device and plug it in again so often, while its driver goes on reading.

    Parameters
    ----------
    name
        Of the sensor.
    folder
        For its device.
    times
        How often.

    Returns
    -------
    ReplugFigures
    """
    back_s, batches = [], []
    with Rig(name, folder / name) as rig:
        rig.sensor.open()
        batches += rig.signal_s(BEFORE_S)
        for _ in range(times):
            rig.run_locked(rig.device.unplug)
            rig.fault()
            time.sleep(AWAY_S)
            rig.run_locked(rig.device.plug)
            plugged_s = time.monotonic()
            batches += rig.signal_s(1 / rig.case.rate_hz)
            back_s.append(time.monotonic() - plugged_s)
            batches += rig.signal_s(AFTER_S)
        rate_hz = rig.case.rate_hz
    return ReplugFigures(
        times, (float(np.median(back_s)), max(back_s)), _index_error_s(batches, rate_hz), _out_of_order(batches)
    )


def flood(name: str, folder: Path, seconds: float) -> FloodFigures:
    """Read a device that is ten times too fast.

    Parameters
    ----------
    name
        Of the sensor.
    folder
        For its device.
    seconds
        How long.

    Returns
    -------
    FloodFigures
    """
    with Rig(name, folder / name, pace=TOO_FAST) as rig:
        rig.sensor.open()
        began_s = time.monotonic()
        batches = rig.signal_s(TOO_FAST * seconds)
        lasted_s = time.monotonic() - began_s
        return FloodFigures(
            lasted_s,
            sum(len(batch.samples) for batch in batches) / lasted_s,
            rig.sensor.counts['lost'],
            rig.device.dropped_bytes,
            _out_of_order(batches),
            (time.time_ns() - batches[-1].stamp_ns) / NANOSECONDS,
        )


def _index_error_s(batches: Sequence[TactileSignal], rate_hz: float) -> float:
    """Return by how much a jump of the index and the gap of the stamps differ at most."""
    gaps = [
        ((after.first_sample - before.next_sample) / rate_hz, (after.stamp_ns - before.end_ns) / NANOSECONDS)
        for before, after in pairwise(batches)
    ]
    return max(abs(jump_s - gap_s) for jump_s, gap_s in gaps)


def _out_of_order(batches: Sequence[TactileSignal]) -> int:
    return sum(after.first_sample < before.next_sample for before, after in pairwise(batches))

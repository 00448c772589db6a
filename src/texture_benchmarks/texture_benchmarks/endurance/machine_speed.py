"""Speed of the machine, measured by a fixed piece of work."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass

import numpy as np

ROUNDS = 300  # of the work: some 10 ms


@dataclass(frozen=True)
class MachineSpeed:
    """How quick the machine was: a virtual one, or one that grows warm, takes longer for the same work at times.

    Parameters
    ----------
    time_s
        When (monotonic clock).
    work_s
        Computing time of a fixed piece of work, of the kind that nodes do.
    """

    time_s: float
    work_s: float


def measure_machine_speed(time_s: float) -> MachineSpeed:
    """Do the fixed piece of work, text and small arrays, and return how long it took."""
    samples = np.arange(512.0)
    begin_s = time.thread_time()
    for number in range(ROUNDS):
        json.loads(json.dumps({'number': number, 'samples': samples[:16].tolist()}))
        np.abs(np.fft.rfft(samples - samples.mean())).sum()
    return MachineSpeed(time_s, time.thread_time() - begin_s)

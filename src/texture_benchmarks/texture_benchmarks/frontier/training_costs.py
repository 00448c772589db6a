"""What a training costs by its size: time and memory, each measured in a process of its own."""

from __future__ import annotations

import multiprocessing
import resource
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection

import numpy as np

from texture_estimation.learners.catalogue import LEARNERS
from texture_estimation.learners.learner import Learner

N_FEATURES = 68  # those of the default recipe
WINDOWS_PER_SLIDE = 5
# Distance of the classes from each other in every feature, in standard deviations within one.
SPREAD = 0.5
KIB = 1024.0


@dataclass(frozen=True)
class TrainingSize:
    """Of a training: how many windows, and of how many surfaces."""

    windows: int
    labels: int


@dataclass(frozen=True)
class Cost:
    """Computing time (s) of a training, and the memory (MiB) that it took beyond its examples."""

    seconds: float
    mebibytes: float


def costs(learner: str, sizes: Sequence[TrainingSize], limit_s: float, seed: int) -> Mapping[TrainingSize, Cost]:
    """Return the costs of rising sizes, up to the first that would take longer than the limit, in proportion.

    Parameters
    ----------
    learner
        Name of the learner.
    sizes
        Windows and labels of each training, rising.
    limit_s
        Longest training that is made.
    seed
        Seed of the examples.

    Returns
    -------
    mapping
        Cost of each training that was made.
    """
    found: dict[TrainingSize, Cost] = {}
    before: TrainingSize | None = None
    for size in sizes:
        if before is not None and found[before].seconds * size.windows / before.windows > limit_s:
            break
        found[size] = cost(LEARNERS[learner](), size, seed)
        before = size
    return found


def cost(learner: Learner, size: TrainingSize, seed: int) -> Cost:
    """Return what one training on artificial examples costs.

    Parameters
    ----------
    learner
        What is trained.
    size
        Windows and labels.
    seed
        Seed of the examples.

    Returns
    -------
    Cost
        Time in s and memory in MiB.
    """
    context = multiprocessing.get_context('fork')
    here, there = context.Pipe()
    process = context.Process(target=_measure, args=(learner, size, seed, there))
    process.start()
    there.close()
    try:
        result: Cost = here.recv()
    finally:
        process.join()
    return result


def _measure(learner: Learner, size: TrainingSize, seed: int, answer: Connection) -> None:
    rng = np.random.default_rng(seed)
    codes = np.arange(size.windows) % size.labels
    groups = codes + size.labels * (np.arange(size.windows) // (size.labels * WINDOWS_PER_SLIDE))
    centres = SPREAD * rng.standard_normal((size.labels, N_FEATURES))
    values = centres[codes] + rng.standard_normal((size.windows, N_FEATURES))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    learner.fit(values, codes, groups)
    taken = time.process_time() - start
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    answer.send(Cost(round(taken, 3), round(used / KIB, 1)))
    answer.close()

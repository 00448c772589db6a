"""Work on what lies in memory, one job on each core: workers are forked, so nothing is copied to them."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

from texture_estimation.search.parallel import single_blas_thread

Job = TypeVar('Job')
Out = TypeVar('Out')

_work: list[Callable[[Any], Any]] = []  # of a worker


def map_forked(work: Callable[[Job], Out], jobs: Sequence[Job]) -> list[Out]:
    """Return work(job) for each job, in their order.

    Parameters
    ----------
    work
        May hold as much as it likes, and need not be importable.
    jobs
        Sent to the workers, as what they return is sent back: both small, and such that pickle knows them.
    """
    context = multiprocessing.get_context('fork')
    with ProcessPoolExecutor(len(os.sched_getaffinity(0)), context, _begin, (work,)) as pool:
        return list(pool.map(_do, jobs))


def _begin(work: Callable[[Any], Any]) -> None:
    _work[:] = [work]


def _do(job: Any) -> Any:
    with single_blas_thread():
        return _work[0](job)

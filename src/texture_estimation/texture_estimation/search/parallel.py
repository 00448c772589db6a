"""Spread work over the cores of this machine, or over a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Any, Protocol, TypeVar

from joblib import Parallel, delayed, parallel_config  # type: ignore[import-untyped]
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from texture_core.errors import InvalidParameter

In = TypeVar('In')
Out = TypeVar('Out')
# For a scheduler to answer, and for its workers to come.
ANSWER_S, WORKERS_S = 20, 30
LOCAL, MAX_LOCAL_WORKERS = 'local:', 64


class ParallelMap(Protocol):
    """Apply a function to many items, somewhere; results come in the order of the items."""

    def __call__(self, function: Callable[[In], Out], items: Sequence[In]) -> list[Out]:
        """Return function(item) for each item."""


def serial_map(function: Callable[[In], Out], items: Sequence[In]) -> list[Out]:
    """Apply the function here, one after the other."""
    return [function(item) for item in items]


@contextmanager
def threaded_map(jobs: int = -1) -> Iterator[ParallelMap]:
    """Give what spreads work over so many cores; -1 for all.

    Threads, not processes: what takes the time (libsvm, products of arrays) lets go of Python's lock, and nothing is
    copied.
    """
    with single_blas_thread(), Parallel(n_jobs=jobs, backend='threading') as parallel:
        yield _Joblib(parallel)


@contextmanager
def dask_map(address: str) -> Iterator[ParallelMap]:
    """Give what spreads work over the workers of a Dask cluster; see `dask_backend`."""
    with dask_backend(address):
        yield _Joblib(Parallel())


@contextmanager
def dask_backend(address: str) -> Iterator[None]:
    """Have joblib use the workers of a Dask cluster, which have this suite installed, within a `with` block.

    Parameters
    ----------
    address
        Address of its scheduler, such as 'tcp://192.168.1.5:8786', or 'local:2' to start a cluster of two workers on
        this machine.

    Raises
    ------
    InvalidParameter
        If no scheduler answers there.
    """
    from distributed import Client, LocalCluster  # noqa: PLC0415  # takes a second

    if address.startswith(LOCAL):
        workers = address.removeprefix(LOCAL)
        if not workers.isdecimal() or not 1 <= int(workers) <= MAX_LOCAL_WORKERS:
            raise InvalidParameter(
                f"the local cluster has '{workers}' workers; 1 to {MAX_LOCAL_WORKERS} are allowed, such as '{LOCAL}2'"
            )
        cluster: Any = LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=int(workers), threads_per_worker=1, dashboard_address=None
        )
        with cluster, dask_backend(cluster.scheduler_address):
            yield
        return

    try:
        client: Any = Client(  # type: ignore[no-untyped-call]
            address, timeout=ANSWER_S, set_as_default=False
        )
    except (OSError, ValueError, TimeoutError) as error:
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise InvalidParameter(
            f"no Dask scheduler answers at '{address}' ({reason}); "
            "start one with 'dask scheduler', or leave '--dask' out to use this machine's cores"
        ) from error
    with client, client.as_current(), parallel_config(backend='dask', wait_for_workers_timeout=WORKERS_S):
        yield


class _Joblib:
    def __init__(self, parallel: Any) -> None:
        self._parallel = parallel

    def __call__(self, function: Callable[[In], Out], items: Sequence[In]) -> list[Out]:
        return list(self._parallel(delayed(_alone)(function, item) for item in items))


def _alone(function: Callable[[In], Out], item: In) -> Out:
    """Call the function; a worker elsewhere, too, gives each call one core."""
    with single_blas_thread():
        return function(item)


@contextmanager
def single_blas_thread() -> Iterator[None]:
    """Keep linear algebra from starting threads of its own: the cores are busy already."""
    with threadpool_limits(limits=1, user_api='blas'):
        yield


def parallel_map_for(jobs: int, dask: str) -> Callable[[], AbstractContextManager[ParallelMap]]:
    """Return what spreads over so many cores (-1: all), or over a Dask cluster if its address is given."""
    return (lambda: dask_map(dask)) if dask else (lambda: threaded_map(jobs))

# SPDX-License-Identifier: Apache-2.0
"""Spread work over the cores of this machine, or over a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from joblib import parallel_config

from texture_core.config import library
from texture_core.errors import InvalidParameter
from texture_estimation.search import single_blas_thread

ANSWER_S, WORKERS_S = 4, 4  # for a scheduler to answer, and for its first worker to come
# What scheduler and workers must have as this process has it: both unpack what is computed, and a scheduler that cannot
# says so in its own log alone, while everybody waits.
ON_CLUSTER = ('texture_core', 'texture_features', 'texture_estimation', 'texture_recordings', 'texture_evaluation')
CLUSTER_ADVICE = (
    'start both with `ros-run dask scheduler` and `ros-run dask worker ADDRESS`, or in shells that have sourced the '
    'suite'
)


@contextmanager
def workers(jobs: int = -1, dask: str = '') -> Iterator[None]:
    """Have joblib use so many cores (-1: all) within a `with` block, or the cluster whose address is given.

    Threads, not processes: what takes the time (libsvm, products of arrays) lets go of Python's lock, and nothing is
    copied.
    """
    spread = dask_backend(dask) if dask else parallel_config(backend='threading', n_jobs=jobs)
    with single_blas_thread(), spread:
        yield


@contextmanager
def dask_backend(address: str) -> Iterator[None]:
    """Have joblib use the workers of a Dask cluster, which have this suite installed, within a `with` block.

    Parameters
    ----------
    address
        Address of its scheduler, such as 'tcp://192.168.1.5:8786'.

    Raises
    ------
    InvalidParameter
        If no scheduler answers there, it has no worker, or one of them lacks the suite or has another version.
    """
    cluster_of = library('distributed', "Dask clusters ('--dask')", 'dask')

    try:
        client: Any = cluster_of.Client(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise InvalidParameter(
            f"no Dask scheduler answers at '{address}' ({reason}); {CLUSTER_ADVICE}, "
            "or leave '--dask' out to use this machine's cores"
        ) from error
    with client:
        _check_cluster(client, address)
        with client.as_current(), parallel_config(backend='dask'):
            yield


def _check_cluster(client: Any, address: str) -> None:
    """Raise InvalidParameter if a cluster has no worker, or not everywhere what this process has."""
    try:
        client.wait_for_workers(1, timeout=WORKERS_S)
    except TimeoutError as error:
        raise InvalidParameter(f"the Dask scheduler at '{address}' has no worker; {CLUSTER_ADVICE}") from error
    versions = client.get_versions(packages=ON_CLUSTER)
    own = versions['client']['packages']
    places = {f"the Dask scheduler at '{address}'": versions['scheduler']}
    places |= {f"the Dask worker '{worker}'": found for worker, found in versions['workers'].items()}
    for place, found in places.items():
        for name in ON_CLUSTER:
            has = found['packages'].get(name)
            if own[name] and has != own[name]:
                raise InvalidParameter(f'{place} has {has or "no"} {name}, {own[name]} is needed; {CLUSTER_ADVICE}')

import threading

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from texture_benchmarks.forked_map import map_forked
from texture_core.errors import InvalidData


def test_each_job_is_done_in_its_place_with_what_could_not_be_sent() -> None:
    lock = threading.Lock()  # pickle refuses it
    assert map_forked(lambda job: (job * job, lock.locked()), range(5)) == [(job * job, False) for job in range(5)]


def test_an_error_of_a_job_is_the_error_of_all() -> None:
    def work(job):
        if job == 1:
            raise InvalidData('job 1 has no slides')
        return job

    with pytest.raises(InvalidData, match='job 1 has no slides'):
        map_forked(work, [0, 1, 2])


def test_linear_algebra_keeps_to_one_thread_in_each() -> None:
    def threads(_job):
        np.ones((2, 2)) @ np.ones((2, 2))
        return {pool['num_threads'] for pool in threadpool_info() if pool['user_api'] == 'blas'}

    assert map_forked(threads, [0]) == [{1}]

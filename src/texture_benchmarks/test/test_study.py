# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Common to studies: data sets, work on all cores, intervals."""

import threading
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from texture_benchmarks.study import BenchmarkOptions, fraction_interval, map_forked, recorded, resumed
from texture_core.errors import InvalidData


def test_a_part_that_fails_leaves_the_others_and_none_is_computed_twice(tmp_path, capsys) -> None:
    jobs = {'one': 1, 'zero': 0, 'two': 2}
    assert resumed(lambda job: 1 / job, jobs, tmp_path / 'parts.jsonl') == {'one': 1.0, 'two': 0.5}
    assert 'zero failed: ZeroDivisionError' in capsys.readouterr().out
    found = resumed(lambda _job: 'again', jobs, tmp_path / 'parts.jsonl')
    assert found == {'one': 1.0, 'zero': 'again', 'two': 0.5}
    assert '2 parts are of an earlier run' in capsys.readouterr().out
    assert not (tmp_path / 'parts.jsonl').exists()


@pytest.mark.parametrize('line', ['{"part": "zero"', '{"name": "zero", "found": 1}', '{"part": "three", "found": 1}'])
def test_parts_of_an_older_version_are_not_mixed_with_new_ones(line, tmp_path) -> None:
    (tmp_path / 'parts.jsonl').write_text(line)
    with pytest.raises(InvalidData, match=r"parts.jsonl' is of a run with other parts .* remove it"):
        resumed(lambda job: job, {'zero': 0}, tmp_path / 'parts.jsonl')


@pytest.mark.parametrize('data', [True, False])
def test_what_is_missing_is_reported_by_the_benchmark_that_needs_it(tmp_path: Path, data: bool) -> None:
    options = BenchmarkOptions(tmp_path, tmp_path if data else None)
    with pytest.raises(InvalidData, match='ntp21/ with --data'):
        recorded(options, 'ntp21')


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


def test_an_interval_is_as_wide_as_surfaces_ask_for() -> None:
    assert fraction_interval([True] * 20, ['a', 'b'] * 10) == pytest.approx([0.05**0.5, 1.0])
    # One surface is right and one is wrong: any fraction is possible.
    assert fraction_interval([True] * 10 + [False] * 10, ['a'] * 10 + ['b'] * 10) == [0.0, 1.0]

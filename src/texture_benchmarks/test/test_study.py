# SPDX-License-Identifier: Apache-2.0
"""What studies share: data sets imported once, work on all cores."""

import threading
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from texture_benchmarks import study
from texture_benchmarks.study import BenchmarkOptions, imported, importing_once, map_forked, share_interval
from texture_core.errors import InvalidData


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list:
    """Return what is asked of an importer of one bag a material, for the data set 'wool', which is there."""
    calls = []

    def importer(source: Path, out: Path, slides: str = '', materials: tuple[str, ...] = ()) -> list[Path]:
        calls.append((source.name, slides, materials))
        bags = [Path(out) / name for name in materials or ('a', 'b')]
        for bag in bags:
            bag.mkdir(parents=True)
        return bags

    monkeypatch.setattr(study, 'IMPORTS', {'wool': importer, 'cork': importer})
    (tmp_path / 'wool').mkdir()
    return calls


def test_all_that_run_together_get_the_same_bags(asked, tmp_path: Path) -> None:
    with importing_once(BenchmarkOptions(tmp_path, tmp_path), ('wool', 'cork')) as options:
        for _ in range(2):
            with imported(options, 'wool') as bags:
                assert [bag.name for bag in bags] == ['a', 'b']
                assert all(bag.is_dir() for bag in bags)
    assert asked == [('wool', '', ())]
    assert not bags[0].exists()


def test_what_is_missing_is_reported_by_the_benchmark_that_needs_it(asked, tmp_path: Path) -> None:
    for data in (tmp_path, None):
        with (
            importing_once(BenchmarkOptions(tmp_path, data), ('cork',)) as options,
            pytest.raises(InvalidData, match='cork/ with --data'),
            imported(options, 'cork'),
        ):
            pass
    assert asked == []


def test_a_damaged_data_set_stops_no_benchmark_but_those_that_need_it(asked, monkeypatch, tmp_path: Path) -> None:
    good = study.IMPORTS['wool']

    def damaged(source: Path, out: Path, *_: object) -> list[Path]:
        (Path(out) / 'half').mkdir(parents=True)
        raise InvalidData('it is no file of this data set')

    monkeypatch.setattr(study, 'IMPORTS', {'cork': damaged, 'wool': good})
    (tmp_path / 'cork').mkdir()
    with importing_once(BenchmarkOptions(tmp_path, tmp_path), ('cork', 'wool')) as options:
        with imported(options, 'wool') as bags:
            assert len(bags) == 2
        with pytest.raises(InvalidData, match='no file of this data set'), imported(options, 'cork'):
            pass


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


def test_an_interval_is_as_wide_as_slides_and_surfaces_ask_for() -> None:
    assert share_interval([True] * 20, ['a', 'b'] * 10) == pytest.approx((0.8316, 1.0), abs=1e-4)  # 1 - 0.025^(1/20)
    low, high = share_interval([True] * 10 + [False] * 10, ['a'] * 10 + ['b'] * 10)
    assert (low, high) == (0.0, 1.0)  # one surface is right and one is wrong: any share may be

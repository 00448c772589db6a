# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from distributed import Client

from texture_bringup.command import main
from texture_simulation.offline import SlidePlan, write_simulated

SURFACES = ('glass', 'leather')


@pytest.fixture(scope='module')
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('bags')
    write_simulated(folder, SlidePlan(slides=4, slide_s=0.8), np.random.default_rng(0), surfaces=SURFACES)
    return folder


def test_a_recipe_is_cross_validated_from_the_command_line(bags: Path, tmp_path: Path, capsys) -> None:
    figures = tmp_path / 'figures.json'
    arguments = ['cross-validate', 'stratified:2', 'peaks-naive-bayes', str(bags), '--json', str(figures)]
    assert main(arguments) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "recipe 'peaks-naive-bayes', split stratified:2: 2 surfaces; same bag; place not compared"
    assert [line.split()[0] for line in lines[2:5]] == ['1', '2', 'all']
    written = json.loads(figures.read_text())
    [recipe] = written['recipes']
    assert (recipe['n_slides'], written['comparisons']) == (8, [])
    assert {name for fold in recipe['folds'] for name in fold['slides']} == {
        f'{surface}/{number}' for surface in SURFACES for number in range(1, 5)
    }


@contextmanager
def cluster(folder: Path, workers: int, *, with_suite: bool) -> Iterator[str]:
    """Run a Dask scheduler and workers as a user does, with the packages of the suite or without; give its address."""
    environment = dict(os.environ) if with_suite else {**os.environ, 'PYTHONPATH': ''}
    facts = folder / 'scheduler.json'
    common = ['--scheduler-file', str(facts), '--no-dashboard']
    commands = [['scheduler', '--host', '127.0.0.1', '--port', '0', *common]]
    commands += [['worker', '--nthreads', '1', '--host', '127.0.0.1', *common]] * workers
    with ExitStack() as running:
        for command in commands:
            process = subprocess.Popen(
                [sys.executable, '-m', 'dask', *command], env=environment, cwd=folder,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            running.callback(process.wait)
            running.callback(process.kill)
            deadline_s = time.monotonic() + 60.0
            while not facts.exists():
                assert time.monotonic() < deadline_s
                time.sleep(0.1)
        address = json.loads(facts.read_text())['address']
        with Client(address, timeout=60, set_as_default=False) as client:
            if workers:
                client.wait_for_workers(workers, timeout=60)
        yield address


@pytest.mark.realtime
def test_a_cluster_that_lacks_the_suite_or_workers_is_refused_at_once_with_what_to_do(
    bags: Path, tmp_path: Path, capsys
) -> None:
    for workers, sentence in (
        (0, 'has no worker; start both'),
        (1, 'has no texture_core, 0.1.0 is needed'),
    ):
        (tmp_path / str(workers)).mkdir()
        with cluster(tmp_path / str(workers), workers, with_suite=False) as address:
            begin_s = time.monotonic()
            given = ['stratified:2', 'peaks-naive-bayes', str(bags), '--dask', address]
            assert main(['cross-validate', *given]) == 2
            assert time.monotonic() - begin_s < 10.0
        said = capsys.readouterr().err
        assert sentence in said
        assert 'ros-run dask scheduler' in said


@pytest.mark.realtime
def test_two_workers_of_a_cluster_give_the_figures_of_one_process(bags: Path, tmp_path: Path) -> None:
    files = [tmp_path / name for name in ('one.json', 'cluster.json')]
    arguments = ['cross-validate', 'stratified:2', 'peaks-naive-bayes', str(bags), '--json']
    assert main([*arguments, str(files[0])]) == 0
    with cluster(tmp_path, 2, with_suite=True) as address:
        assert main([*arguments, str(files[1]), '--dask', address]) == 0
    assert files[0].read_text() == files[1].read_text()

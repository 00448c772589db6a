# SPDX-License-Identifier: Apache-2.0
import json
from pathlib import Path

import numpy as np
import pytest

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
    arguments = ['evaluate', '--cross-validate', 'stratified:2', 'peaks-naive-bayes', str(bags), '--json', str(figures)]
    assert main(arguments) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "recipe 'peaks-naive-bayes', split stratified:2: 2 surfaces"
    assert [line.split()[0] for line in lines[2:5]] == ['1', '2', 'all']
    written = json.loads(figures.read_text())
    assert written['n_slides'] == 8
    assert {name for fold in written['folds'] for name in fold['slides']} == {
        f'{surface}/{number}' for surface in SURFACES for number in range(1, 5)
    }


@pytest.mark.parametrize(
    ('split', 'sentence'),
    [
        ('stratified:5', 'has 4 slides, too few for 5 folds'),
        ('folds:5', "no split 'folds'"),
        ('leave-one-out:colour', 'leave one of speed, force'),
    ],
)
def test_a_split_that_cannot_be_made_gets_one_sentence(split: str, sentence: str, bags: Path, capsys) -> None:
    assert main(['evaluate', '--cross-validate', split, 'default', str(bags)]) != 0
    assert sentence in capsys.readouterr().err


@pytest.mark.benchmark
def test_a_local_cluster_of_two_workers_cross_validates_and_searches_as_one_core_does(
    bags: Path, tmp_path: Path
) -> None:
    files = [tmp_path / name for name in ('one.json', 'cluster.json')]
    for file, where in zip(files, ([], ['--dask', 'local:2']), strict=True):
        split = ['evaluate', '--cross-validate', 'stratified:2', 'peaks-naive-bayes', str(bags)]
        assert main([*split, '--json', str(file), *where]) == 0
    assert files[0].read_text() == files[1].read_text()
    recipes = [tmp_path / name for name in ('one.yaml', 'cluster.yaml')]
    size = ['--population', '4', '--generations', '2', '--halves', '2']
    for file, where in zip(recipes, (['--jobs', '1'], ['--dask', 'local:2']), strict=True):
        assert main(['optimise', 'ets-linear-svm', str(bags), '-o', str(file), *size, *where]) == 0
    assert recipes[0].read_text() == recipes[1].read_text()

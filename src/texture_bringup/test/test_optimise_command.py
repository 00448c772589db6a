# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
from pathlib import Path

import numpy as np
import pytest

from texture_bringup.command import main
from texture_estimation.recipe import load_recipe
from texture_simulation.offline import SlidePlan, write_simulated


def test_a_recipe_is_tuned_from_the_command_line_and_the_search_is_reported_line_by_line(
    tmp_path: Path, capsys
) -> None:
    bags, out = tmp_path / 'bags', tmp_path / 'best.yaml'
    write_simulated(bags, SlidePlan(slides=4, slide_s=0.8), np.random.default_rng(0), surfaces=('glass', 'leather'))
    size = ['--population', '4', '--generations', '2', '--halves', '2', '--jobs', '1']
    assert main(['optimise', 'ets-linear-svm', str(bags), '-o', str(out), *size]) == 0
    said = capsys.readouterr()
    generations = [line.split(':')[0] for line in said.err.splitlines() if line.startswith('generation')]
    assert generations == ['generation 1 of 2', 'generation 2 of 2']
    assert said.out.startswith(f'{out}: fitness ')
    assert load_recipe(str(out)).learner_name == 'texture_papers.roberge:SvmPairs'


@pytest.mark.parametrize(
    ('arguments', 'sentence'),
    [
        (['--population', '1'], 'population'),
        (['--grades', 'ets_roughness', '--per-pair'], 'leave --per-pair or --grades out'),
        (['-o', '/nowhere/at/all.yaml'], "there is no folder '/nowhere/at'"),
        (['--search', 'ets-ann'], "the recipe has no 'learner/texture_papers.roberge:AnnPairs/hidden'"),
    ],
)
def test_a_mistake_is_answered_with_one_sentence(arguments, sentence, tmp_path: Path, capsys) -> None:
    assert main(['optimise', 'ets-linear-svm', str(tmp_path), '-o', str(tmp_path / 'x.yaml'), *arguments]) == 2
    said = capsys.readouterr().err
    assert sentence in said
    assert said.count('\n') == 1

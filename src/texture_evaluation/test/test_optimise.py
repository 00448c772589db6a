# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import re
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidParameter, TextureError
from texture_estimation.model import load_model
from texture_estimation.recipe import load_recipe
from texture_estimation.search import SearchParams
from texture_evaluation import optimise
from texture_evaluation.evaluate import evaluate
from texture_evaluation.optimise import checkpoint_of, optimise_from_bags
from texture_evaluation.train import train_from_bags

SMALL = SearchParams(population=5, generations=2, halves=3)


def test_what_is_written_is_a_recipe_that_train_uses(simulated: Path, tmp_path: Path) -> None:
    out = tmp_path / 'best.yaml'
    said: list[int] = []
    files, _lines = optimise_from_bags(
        'ets-linear-svm',
        [simulated],
        SMALL,
        out,
        tell=lambda _, generation: said.append(generation.number),
    )
    assert said == [1, 2]
    assert files == (out, tmp_path / 'best.search.json', tmp_path / 'best.png')
    assert all(path.is_file() for path in files)
    first, second, *_ = out.read_text().splitlines()
    assert 'texture optimise ets-linear-svm' in first
    assert re.fullmatch(r'# fitness \d+\.\d %: training .* over 3 halves\.', second)
    assert load_recipe(str(out)).learner_name == 'texture_papers.roberge:SvmPairs'
    model = train_from_bags(str(out), [simulated])
    assert model.labels == ('glass', 'leather', 'ridge_2mm_deep')


def test_the_same_seed_writes_the_same_recipe_and_resuming_evaluates_nothing_again(
    simulated: Path, tmp_path: Path
) -> None:
    texts, evaluated = [], []
    for name, resume in (('a', False), ('b', False), ('a', True)):
        out = tmp_path / f'{name}.yaml'
        optimise_from_bags(
            'ets-linear-svm', [simulated], SMALL, out,
            resume=resume, tell=lambda _, generation: evaluated.append(generation.evaluated),
        )  # fmt: skip
        texts.append(out.read_text())
    assert texts[0] == texts[1] == texts[2]
    assert evaluated[-1] == 0 < evaluated[0]


def test_the_variables_of_all_pairs_are_trained_as_one_model(simulated: Path, tmp_path: Path) -> None:
    optimise_from_bags('ets-linear-svm', [simulated], SMALL, tmp_path / 'best.yaml', per_pair=True)
    model = load_model(train_from_bags(str(tmp_path / 'best.yaml'), [simulated]).save(tmp_path / 'model'))
    assert model.recipe.learner_name == 'texture_papers.roberge:TunedPairs'
    assert '3 of 3 pairs have variables of their own' in model.training['calibration']
    assert evaluate(model, [simulated]).as_json()['window_accuracy'] > 0.9


def test_pairs_that_cannot_be_joined_are_written_alone_and_it_is_said_why(
    simulated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise InvalidParameter("the pairs differ in 'windows'")

    monkeypatch.setattr(optimise, 'joined_recipe', refuse)
    _files, lines = optimise_from_bags('ets-linear-svm', [simulated], SMALL, tmp_path / 'best.yaml', per_pair=True)
    assert not (tmp_path / 'best.yaml').exists()
    assert (tmp_path / 'best-glass-vs-leather.yaml').is_file()
    assert lines[-1] == "no recipe of all pairs was written: the pairs differ in 'windows'"


def test_grades_are_tuned_by_a_roughness_recipe(simulated: Path, tmp_path: Path) -> None:
    table = tmp_path / 'grades.csv'
    table.write_text('texture,grade\nglass,1\nleather,3\nridge_2mm_deep,5\n')
    out = tmp_path / 'rough.yaml'
    files, _lines = optimise_from_bags('ets-roughness-svm5', [simulated], SMALL, out, grades=str(table))
    assert 'Svm5' in files[0].read_text()


@pytest.mark.parametrize(
    ('recipe', 'options', 'sentence'),
    [
        ('hu-pca-svm', {}, 'has no search space of its own'),
        ('ets-linear-svm', {'search_space': 'ets-svn'}, "did you mean 'ets-svm'"),
        ('ets-linear-svm', {'resume': True}, 'there is no checkpoint'),
    ],
)
def test_mistakes_are_named(recipe, options, sentence, simulated: Path, tmp_path: Path) -> None:
    with pytest.raises(TextureError, match=sentence):
        optimise_from_bags(recipe, [simulated], SMALL, tmp_path / 'best.yaml', **options)
    assert not np.any([path.exists() for path in (tmp_path / 'best.yaml', checkpoint_of(tmp_path / 'best.yaml'))])

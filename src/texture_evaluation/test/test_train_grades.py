import json

import pytest

from texture_core.errors import UnknownName
from texture_estimation.roughness import load_roughness_model
from texture_evaluation.train import train_grades_from_bags
from texture_features.feature_set import read_recipe

GRADES = ('texture,grade', 'glass,1', 'leather,3', 'ridge_2mm_deep,5')


def table(folder, lines):
    path = folder / 'grades.csv'
    path.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return path


def test_bags_and_grades_make_a_model_whose_card_says_from_what(simulated, tmp_path) -> None:
    train_grades_from_bags('roughness', [simulated], table(tmp_path, GRADES), '1-4', tmp_path / 'rough.skops')
    model = load_roughness_model(tmp_path / 'rough')
    assert model.name == 'rough'
    assert model.grades == {'glass': 1.0, 'leather': 3.0, 'ridge_2mm_deep': 5.0}
    card = json.loads((tmp_path / 'rough.json').read_text(encoding='utf-8'))
    assert card['data']['slides'] == '1-4'
    assert card['training']['slides'] == 12


def test_both_files_of_a_model_report_the_extractor_how_to_describe(simulated, tmp_path) -> None:
    train_grades_from_bags('roughness', [simulated], table(tmp_path, GRADES), '1-2', tmp_path / 'rough')
    by_card, by_model = (read_recipe(str(tmp_path / name))[1] for name in ('rough.json', 'rough.skops'))
    assert by_card == by_model
    assert 'inputs' in by_card


def test_a_surface_without_a_grade_is_named(simulated, tmp_path) -> None:
    with pytest.raises(UnknownName, match="grade for the texture 'leather'"):
        train_grades_from_bags('roughness', [simulated], table(tmp_path, [GRADES[0], GRADES[1], GRADES[3]]))

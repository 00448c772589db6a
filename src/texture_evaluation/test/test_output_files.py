from pathlib import Path

import pytest

from texture_core.config import refuse_inputs
from texture_core.errors import InvalidParameter
from texture_estimation.model_files import both_files
from texture_evaluation.charts import refuse_chart_format


@pytest.mark.parametrize('model', ['m1', 'm1.skops', 'm1.json'])
@pytest.mark.parametrize('output', ['m1.json', './m1.json', 'm1.skops', 'sub/../m1.json'])
def test_the_files_of_a_model_that_is_read_are_not_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, model: str, output: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'sub').mkdir()
    with pytest.raises(InvalidParameter, match='would overwrite'):
        refuse_inputs([output], both_files(model))


def test_a_recipe_that_is_read_is_not_overwritten_and_another_file_may_be(tmp_path: Path) -> None:
    with pytest.raises(InvalidParameter, match='would overwrite'):
        refuse_inputs([tmp_path / 'own.yaml'], [tmp_path / 'own.yaml', tmp_path / 'bags'])
    refuse_inputs([tmp_path / 'figures.json', None], [*both_files('m1'), tmp_path / 'bags'])


@pytest.mark.parametrize('name', ['figures.yaml', 'figures', 'figures.json'])
def test_a_chart_of_another_format_is_refused_with_those_allowed(name: str) -> None:
    with pytest.raises(InvalidParameter, match=r'\.png, \.svg or \.pdf'):
        refuse_chart_format(name)


@pytest.mark.parametrize('name', ['figures.png', 'figures.SVG', 'figures.pdf'])
def test_a_chart_may_be_a_png_svg_or_pdf(name: str) -> None:
    refuse_chart_format(name)

import argparse
import json
from pathlib import Path

import numpy as np
import pytest
from foreign_tables import MAPPING, recordings, write_csv

from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import TextureEstimate
from texture_evaluation.commands import evaluate
from texture_evaluation.cross_validation import CrossValidation, FoldResult, compare, compare_all, mcnemar
from texture_evaluation.metrics import SlideResult
from texture_recordings.tables import import_tables, load_mapping

SMALL = """
windows: {length_s: 0.5, hop_s: 0.25}
inputs: {signal: {features: [%s]}}
learner: {sklearn: {estimator: 'sklearn.naive_bayes:GaussianNB'}}
"""


def cross_validation(recipe: str, *folds: list[bool]) -> CrossValidation:
    """Return results in which slide number k of a fold is right or not; its two windows are as the slide."""
    made = []
    for fold, right in enumerate(folds, 1):
        results = {
            f'cork/{number}': SlideResult('cork', [label] * 2, [TextureEstimate(0, 'e', label)])
            for number, one in enumerate(right, 1)
            for label in ['cork' if one else 'felt']
        }
        made.append(FoldResult(str(fold), (), results, None, 0.0))
    return CrossValidation(recipe, ('cork', 'felt'), tuple(made))


def test_the_exact_test_gives_the_binomial_probability() -> None:
    # Of 8 coins at most one, or at least seven, shows heads: 2·(1 + 8)/2⁸.
    assert mcnemar(1, 7) == pytest.approx(18 / 256)
    assert mcnemar(7, 1) == mcnemar(1, 7)
    assert mcnemar(0, 0) == mcnemar(5, 5) == 1.0


def test_a_comparison_counts_the_slides_that_the_one_alone_recognises() -> None:
    one = compare(
        cross_validation('a', [True] * 2 + [False] * 8), cross_validation('b', [False] + [True] * 8 + [False])
    )
    assert (one.only_first, one.only_second, one.n_slides) == (1, 7, 10)
    assert one.p_value == pytest.approx(18 / 256)
    assert one.slide_difference == one.window_difference == pytest.approx(0.6)
    low, high = one.slide_interval
    assert 0.0 < low < 0.6 < high <= 1.0


def test_the_interval_of_the_difference_is_that_of_pairs() -> None:
    """Slides that both recognise, or both do not, say nothing of the difference and widen it little."""
    common = [True, False] * 50
    one = compare(cross_validation('a', common), cross_validation('b', common))
    assert one.slide_interval == (0.0, 0.0)
    assert one.p_value == 1.0


def test_a_slide_of_several_folds_counts_once_by_their_majority() -> None:
    one = compare(cross_validation('a', [True], [False], [False]), cross_validation('b', [True], [True], [False]))
    assert (one.n_slides, one.only_first, one.only_second) == (1, 0, 1)


def test_p_values_of_several_comparisons_are_adjusted() -> None:
    base, half = [False] * 10, [True] * 6 + [False] * 4
    compared = compare_all([cross_validation(name, right) for name, right in (('a', base), ('b', half), ('c', base))])
    assert [one.p_value for one in compared] == pytest.approx([2 / 64, 1.0])
    assert [one.p_value_adjusted for one in compared] == pytest.approx([4 / 64, 1.0])


def test_recipes_without_a_slide_in_common_are_refused() -> None:
    with pytest.raises(InvalidData, match="no slide was tested by 'a' and by 'b'"):
        compare(cross_validation('a', [True]), cross_validation('b'))


def test_recipes_come_before_bags(tmp_path: Path) -> None:
    bags = str(tmp_path)
    assert evaluate.recipes_and_bags(['default', bags, 'fast']) == (['default'], [bags, 'fast'])
    assert evaluate.recipes_and_bags(['default', 'fast', 'my/own.yaml', bags]) == (
        ['default', 'fast', 'my/own.yaml'],
        [bags],
    )
    assert evaluate.recipes_and_bags(['default', 'one.mcap']) == (['default'], ['one.mcap'])
    with pytest.raises(InvalidParameter, match='default, fast are recipes; name the bags behind them'):
        evaluate.recipes_and_bags(['default', 'fast'])


def test_a_csv_of_others_becomes_a_table_a_comparison_and_a_chart(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / 'mapping.yaml').write_text(MAPPING)
    import_tables(load_mapping(tmp_path / 'mapping.yaml'), write_csv(tmp_path / 'in', recordings()), tmp_path / 'bags')
    names = []
    for name, feature in (('bands', 'log_bands'), ('level', 'mean')):
        (tmp_path / f'{name}.yaml').write_text(SMALL % feature)
        names.append(str(tmp_path / f'{name}.yaml'))
    parser = argparse.ArgumentParser()
    evaluate.configure(parser)
    evaluate.run(
        parser.parse_args([
            '--cross-validate', 'leave-one-out:session', *names, str(tmp_path / 'bags'),
            '--json', str(tmp_path / 'figures.json'), '--chart', str(tmp_path / 'figures.png'),
        ])
    )  # fmt: skip
    said = capsys.readouterr().out
    assert "recipe 'bands', split leave-one-out:session: 3 surfaces" in said
    assert "'level' against 'bands' on 18 slides" in said
    figures = json.loads((tmp_path / 'figures.json').read_text())
    assert (figures['split'], figures['seed'], figures['channels']) == ('leave-one-out:session', 0, 'all')
    assert figures['bags'] == [str(tmp_path / 'bags')]
    assert [recipe['recipe'] for recipe in figures['recipes']] == ['bands', 'level']
    assert figures['recipes'][0]['slide_accuracy'] == 1.0
    assert figures['comparisons'][0]['slide_difference'] < 0
    assert (tmp_path / 'figures.png').stat().st_size > 10_000
    assert np.isfinite(figures['comparisons'][0]['p_value'])

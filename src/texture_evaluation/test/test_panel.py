# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import json
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import InvalidData, InvalidParameter
from texture_evaluation.panel import (
    Ratings,
    agreement,
    intraclass_correlation,
    krippendorff_alpha,
    one_against_rest,
    protocol_violations,
    read_ratings,
    write_panel,
)

# Shrout & Fleiss 1979, table 2: six targets, four classifies; the ICCs of table 4.
SHROUT_FLEISS = np.array(
    [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]], dtype=float
)


def write(path: Path, *lines: str) -> Path:
    path.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return path


def panel(grades: np.ndarray) -> Ratings:
    raters, textures = grades.shape
    return Ratings(tuple(f'p{k}' for k in range(raters)), tuple(f't{k}' for k in range(textures)), grades.astype(float))


def even_panel(seed: int = 0, raters: int = 8) -> Ratings:
    """Return people who spread 25 textures evenly and mostly agree."""
    rng = np.random.default_rng(seed)
    measured = np.linspace(0.0, 4.0, 25) + 0.6 * rng.normal(size=(raters, 25))
    return panel(1 + measured.argsort(axis=1).argsort(axis=1) // 5)


def test_the_intraclass_correlations_are_those_of_shrout_and_fleiss() -> None:
    single, mean = intraclass_correlation(SHROUT_FLEISS)
    assert (round(single, 2), round(mean, 2)) == (0.29, 0.62)


def test_alpha_is_one_for_full_agreement_and_that_of_krippendorffs_example() -> None:
    assert krippendorff_alpha(np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0]])) == pytest.approx(1.0)
    # Krippendorff 2011, "Computing Krippendorff's alpha-reliability", section C: four observers, 0.849 for intervals.
    nan = np.nan
    observers = np.array(
        [
            [1, 2, 3, 3, 2, 1, 4, 1, 2, nan, nan, nan],
            [1, 2, 3, 3, 2, 2, 4, 1, 2, 5, nan, 3],
            [nan, 3, 3, 3, 2, 3, 4, 2, 2, 5, 1, nan],
            [1, 2, 3, 3, 2, 4, 4, 1, 2, 5, 1, nan],
        ]
    )
    assert krippendorff_alpha(observers) == pytest.approx(0.849, abs=5e-4)


def test_one_person_is_compared_with_the_mean_of_the_others() -> None:
    error, correlation = one_against_rest(np.array([[1.0, 3.0, 5.0], [1.0, 3.0, 5.0], [2.0, 3.0, 4.0]]))
    # The first two are 1/2·(1 - 1.5)… away from their rests: (0.5 + 0 + 0.5) / 3 each; the third (1 + 0 + 1) / 3.
    assert error == pytest.approx((1 / 3 + 1 / 3 + 2 / 3) / 3)
    assert correlation == pytest.approx(1.0)


def test_an_even_panel_keeps_the_protocol_and_an_uneven_one_is_named() -> None:
    assert protocol_violations(even_panel()) == []
    grades = even_panel().grades.copy()
    grades[2] = 3.0
    grades[3, 0] = 2.5
    grades[4, 1] = np.nan
    missing, broken, uneven = protocol_violations(panel(grades))[:3]
    assert 'of rater p4' in missing
    assert '1 grades are not whole' in broken
    assert 'rater p2' in uneven
    assert '4 to 6 a grade' in uneven


def test_votes_are_counted_and_the_report_can_be_read(tmp_path: Path) -> None:
    ratings = even_panel()
    assert ratings.votes.sum() == 8 * 25
    figures, table, *charts = write_panel(ratings, tmp_path / 'new')
    content = json.loads(figures.read_text())
    assert content['textures']['t0']['votes'] == ratings.votes[0].tolist()
    assert table.read_text().splitlines()[0] == 'texture,grade,std'
    assert all(path.stat().st_size > 5000 for path in charts)


def test_other_scales_are_mapped_to_grades_and_empty_cells_are_missing(tmp_path: Path) -> None:
    lines = ('texture,Rater,rating', 'cork,a,0', 'cork,b,10', 'wood,a,5', 'wood,b,')
    ratings = read_ratings(write(tmp_path / 'r.csv', *lines), (0.0, 10.0))
    np.testing.assert_array_equal(ratings.grades, [[1.0, 3.0], [5.0, np.nan]])
    assert 'mapped linearly' in ratings.note


@pytest.mark.parametrize(
    ('lines', 'sentence'),
    [
        (['rater,texture', 'a,cork'], 'no grade'),
        (['rater;texture;grade', 'a;cork;1'], "but no .*; it may separate by ';': save it with commas"),
        (['rater,texture,grade'], 'holds no rating'),
        (['rater,texture,grade', 'a,cork,6', 'b,cork,1'], "line 2: the grade is '6'; a number from 1 to 5"),
        (['rater,texture,grade', 'a,cork,rough', 'b,cork,1'], "the grade is 'rough'"),
        (['rater,texture,grade', 'a,cork,1', 'a,cork,2'], "graded 'cork' before"),
        (['rater,texture,grade', 'a,cork,1', 'a,wood,2'], 'single rater'),
        (['rater,texture,grade', 'a,cork,1', 'b,cork,2', 'a,wood,'], "nobody graded 'wood'"),
        (['rater,texture,grade', 'a', 'b,cork,2'], 'line 2'),
        (['rater,texture,grade', *(f'r{n},t{n},1' for n in range(1001))], 'their product may be 1000000'),
    ],
)
def test_ratings_that_cannot_be_used_get_a_sentence(lines: list[str], sentence: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidData, match=sentence):
        read_ratings(write(tmp_path / 'r.csv', *lines))


def test_a_missing_file_and_a_scale_upside_down_get_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(InvalidData, match='cannot be read'):
        read_ratings(tmp_path / 'none.csv')
    (tmp_path / 'picture.png').write_bytes(b'\x89PNG')
    with pytest.raises(InvalidData, match='cannot be read: it is no text in UTF-8; give a CSV file of ratings'):
        read_ratings(tmp_path / 'picture.png')
    with pytest.raises(InvalidParameter, match='smooth end first'):
        read_ratings(write(tmp_path / 'r.csv', 'rater,texture,grade', 'a,cork,1'), (5.0, 1.0))


def test_the_viper_panel_agrees_as_published(data: Path) -> None:
    found = agreement(read_ratings(data / 'roughness_ratings' / 'viper_roughness.csv', (0.0, 10.0)).grades)
    assert found['one_against_rest_r'] == pytest.approx(0.60, abs=0.005)
    assert found['one_against_rest_error'] == pytest.approx(0.82, abs=0.005)

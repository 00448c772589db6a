"""A human panel: people who grade textures from 1 (smooth) to 5 (rough), and how far they agree.

The protocol is that of Rispal, Rana & Duchaine, "Texture roughness estimation using dynamic tactile sensing", section
III: each person gives every texture a whole grade from 1 to 5 and spreads the textures evenly, 4 to 6 a grade for 25.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.files import writing
from texture_estimation.roughness.ratings import GRADES, Ratings
from texture_evaluation.agreement import intraclass_correlation, krippendorff_alpha, one_against_rest

TEXTURES_PER_GRADE = (4, 6)  # of the paper's 25; other numbers of textures in proportion
PAPERS_TEXTURES = 25


@dataclass(frozen=True, eq=False)
class PanelReport:
    """What a panel says, and how far it can be believed.

    Parameters
    ----------
    ratings
        What was examined.
    alpha
        Krippendorff's alpha for intervals: 1 is full agreement, 0 that of chance.
    icc_single, icc_mean
        Intraclass correlation of one person, and of the mean of all, over the textures that everybody graded.
    error, correlation
        One person against the mean of the others, in the mean over the people: absolute difference in grades, and
        Pearson's r. An estimate closer to the panel than this error is as consistent as a person.
    violations
        Where the protocol was not kept, in sentences.
    """

    ratings: Ratings
    alpha: float
    icc_single: float
    icc_mean: float
    error: float
    correlation: float
    violations: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the figures; null for what cannot be said."""
        ratings = self.ratings
        figures = {
            'krippendorff_alpha': self.alpha,
            'icc_single': self.icc_single,
            'icc_mean': self.icc_mean,
            'one_against_rest_error': self.error,
            'one_against_rest_r': self.correlation,
        }
        rows = zip(ratings.textures, ratings.means, ratings.deviations, ratings.votes, strict=True)
        return {
            'raters': len(ratings.raters),
            'textures': {
                name: {'mean': float(mean), 'std': _or_none(float(std)), 'votes': votes.tolist()}
                for name, mean, std, votes in rows
            },
            **{name: _or_none(value) for name, value in figures.items()},
            'protocol_violations': list(self.violations),
            'note': ratings.note,
        }

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Write panel.json, and grades.csv that training takes; InvalidParameter if one cannot be written."""
        ratings = self.ratings
        with writing(folder, 'folder'):
            folder.mkdir(parents=True, exist_ok=True)
            report, table = folder / 'panel.json', folder / 'grades.csv'
            report.write_text(json.dumps(self.as_json(), indent=1, ensure_ascii=False) + '\n', encoding='utf-8')
            with table.open('w', newline='', encoding='utf-8') as file:
                writer = csv.writer(file)
                writer.writerow(('texture', 'grade', 'std'))
                rows = zip(ratings.textures, ratings.means, ratings.deviations, strict=True)
                writer.writerows((name, f'{mean:.3f}', f'{std:.3f}') for name, mean, std in rows)
        return report, table


def examine(ratings: Ratings) -> PanelReport:
    """Return what a panel says and how far its people agree."""
    alpha = krippendorff_alpha(ratings.grades)
    single, mean = intraclass_correlation(ratings.grades.T)
    error, correlation = one_against_rest(ratings.grades)
    return PanelReport(ratings, alpha, single, mean, error, correlation, tuple(protocol_violations(ratings)))


def protocol_violations(ratings: Ratings) -> list[str]:
    """Return, one sentence each, where a panel did not keep to whole grades, all given and evenly spread."""
    found = []
    counts = ~np.isnan(ratings.grades)
    if not counts.all():
        who = [name for name, given in zip(ratings.raters, counts, strict=True) if not given.all()]
        found.append(f'{int((~counts).sum())} grades are missing (of rater {", ".join(who)})')
    given = ratings.grades[counts]
    if (given != np.rint(given)).any():
        found.append(f'{int((given != np.rint(given)).sum())} grades are not whole; the votes count them rounded')
    return [*found, *_uneven_raters(ratings)]


def _uneven_raters(ratings: Ratings) -> Iterator[str]:
    low, high = _allowed_a_grade(len(ratings.textures))
    for name, row in zip(ratings.raters, ratings.grades, strict=True):
        used = (np.rint(row)[:, None] == GRADES).sum(axis=0)
        if used.min() < low or used.max() > high:
            shown = ', '.join(f'{count} × {grade}' for grade, count in zip(GRADES, used, strict=True))
            yield f'rater {name} did not spread the textures evenly: {shown}; {low} to {high} a grade are asked'


def _allowed_a_grade(n_textures: int) -> tuple[int, int]:
    low, high = (number * n_textures / PAPERS_TEXTURES for number in TEXTURES_PER_GRADE)
    return math.floor(low), math.ceil(high)


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value

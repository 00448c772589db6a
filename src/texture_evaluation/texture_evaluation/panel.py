# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Human panels: agreement between people, and with a model."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.config import write_json, writing
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import AnyArray, Array
from texture_estimation.roughness import ROUGH, SMOOTH, checked_grade, read_rows
from texture_evaluation.charts import COLOURS, chart

# --------------------
# Ratings from 1 (smooth) to 5 (rough) that people gave textures, and the table they are read from.

RATINGS_GRADES = np.arange(1, 6)
MAX_CELLS = 1_000_000  # people × textures
COLUMNS = ('rater', 'texture', 'grade')


@dataclass(frozen=True, eq=False)
class Ratings:
    """Grades of each person for each texture."""

    raters: tuple[str, ...]
    textures: tuple[str, ...]
    grades: Array
    note: str = ''

    @property
    def means(self) -> Array:
        """Mean grade of each texture, (n_textures,)."""
        return np.asarray(np.nanmean(self.grades, axis=0))

    @property
    def deviations(self) -> Array:
        """Standard deviation of the grades of each texture over the people, (n_textures,)."""
        return np.asarray(np.nanstd(self.grades, axis=0, ddof=1))

    @property
    def votes(self) -> AnyArray:
        """How many people gave each texture each grade, (n_textures, 5); what lies between is rounded."""
        return np.asarray((np.rint(self.grades)[:, :, None] == RATINGS_GRADES).sum(axis=0))


def read_ratings(path: str | Path, scale: tuple[float, float] = (SMOOTH, ROUGH)) -> Ratings:
    """Read a CSV file with a line for each rating: columns `rater`, `texture` and `grade` (or `rating`)."""
    low, high = scale
    if not low < high:
        raise InvalidParameter(f'the scale goes from {low:g} to {high:g}; give the smooth end first, then a larger one')
    given: dict[tuple[str, str], float] = {}
    for line, row in read_rows(Path(path), COLUMNS, 'rating'):
        where, key = f"'{path}', line {line}", (row['rater'], row['texture'])
        if not all(key) or row['grade'] is None:
            raise InvalidData(f'{where}: rater or texture is missing; write rater,texture,grade')
        if not math.isnan(given.get(key, math.nan)):
            raise InvalidData(f"{where}: rater '{key[0]}' graded '{key[1]}' before; give one grade each")
        given[key] = math.nan
        if row['grade'].strip():
            rating = checked_grade(row['grade'], where, scale, ', or name another scale with --scale')
            given[key] = SMOOTH + (ROUGH - SMOOTH) * (rating - low) / (high - low)
    raters, textures = (tuple(dict.fromkeys(names)) for names in zip(*given, strict=True))
    if len(raters) * len(textures) > MAX_CELLS:
        raise InvalidData(
            f"'{path}' has {len(raters)} raters and {len(textures)} textures; their product may be {MAX_CELLS}"
        )
    grades = np.array([[given.get((rater, texture), math.nan) for texture in textures] for rater in raters])
    empty = np.isnan(grades).all(axis=0)
    if empty.any():
        raise InvalidData(f"'{path}': nobody graded '{textures[int(empty.argmax())]}'; leave it out or grade it")
    if len(raters) < 2:
        raise InvalidData(f"'{path}' has a single rater, '{raters[0]}'; a panel needs two or more")
    note = '' if scale == (SMOOTH, ROUGH) else f'ratings from {low:g} to {high:g} were mapped linearly to 1 to 5'
    return Ratings(raters, textures, grades, note)


# --------------------
# Agreement of people who graded the same things.


def krippendorff_alpha(grades: Array) -> float:
    """Return Krippendorff's alpha for intervals of grades (n_raters, n_textures); NaN if all are the same.

    Source: Krippendorff 1980, chapter 12.
    """
    # Squared differences of all pairs are twice the variance; a texture that one rater graded alone has no pair.
    compared = grades[:, (~np.isnan(grades)).sum(axis=0) > 1]
    counts = (~np.isnan(compared)).sum(axis=0)
    if not counts.size or np.nanmin(compared) == np.nanmax(compared):
        return math.nan
    within = (counts * np.nanvar(compared, axis=0, ddof=1)).sum() / counts.sum()
    return float(1 - within / np.nanvar(compared, ddof=1))


def intraclass_correlation(table: Array) -> tuple[float, float]:
    """Return ICC(2,1) and ICC(2,k): how far one rater, and the mean of k, agrees with others of their kind.

    Source: Shrout & Fleiss 1979, two-way random effects.
    """
    table = table[~np.isnan(table).any(axis=1)]  # the analysis of variance needs a full table
    targets, raters = table.shape
    if min(targets, raters) < 2:
        return math.nan, math.nan
    mean = table.mean()
    between_targets = raters * ((table.mean(axis=1) - mean) ** 2).sum() / (targets - 1)
    between_raters = targets * ((table.mean(axis=0) - mean) ** 2).sum() / (raters - 1)
    total = ((table - mean) ** 2).sum()
    degrees = (targets - 1) * (raters - 1)
    rest = (total - between_targets * (targets - 1) - between_raters * (raters - 1)) / degrees
    signal, bias = between_targets - rest, (between_raters - rest) / targets
    single = between_targets + (raters - 1) * rest + raters * bias
    joint = between_targets + bias
    if not single > 0 or not joint > 0:  # without variance between the targets there is nothing to agree on
        return math.nan, math.nan
    return float(signal / single), float(signal / joint)


def one_against_rest(grades: Array) -> tuple[float, float]:
    """Return mean absolute difference and mean correlation of each person with the mean of the others."""
    errors, correlations = [], []
    for index, grades_of_one in enumerate(grades):
        others = np.delete(grades, index, axis=0)
        shared = ~np.isnan(grades_of_one) & ~np.isnan(others).all(axis=0)
        if not shared.any():
            continue
        rest = np.nanmean(others[:, shared], axis=0)
        errors.append(float(np.abs(grades_of_one[shared] - rest).mean()))
        if grades_of_one[shared].std() > 0 and rest.std() > 0:  # a rater with one grade for all has no correlation
            correlations.append(float(np.corrcoef(grades_of_one[shared], rest)[0, 1]))
    error, correlation = (float(np.mean(found)) if found else math.nan for found in (errors, correlations))
    return error, correlation


# --------------------
# A human panel: people who grade textures from 1 (smooth) to 5 (rough), and how far they agree.
#
# The protocol is that of Rispal, Rana & Duchaine, "Texture roughness estimation using dynamic tactile sensing", section
# III: each person gives every texture a whole grade from 1 to 5 and spreads the textures evenly, 4 to 6 a grade for 25.

TEXTURES_PER_GRADE = (4, 6)  # of the paper's 25; other numbers of textures in proportion
PAPERS_TEXTURES = 25


def agreement(grades: Array) -> dict[str, float]:
    """Return how far people agree whose grades are (n_raters, n_textures): the figures of the report; NaN if unknown.

    Krippendorff's alpha is 1 for full agreement, 0 for that of chance. The intraclass correlations are of one person,
    and of the mean of all, over the textures that everybody graded. One person is compared with the mean of the others:
    an estimate closer to the panel than this error is as consistent as a person.
    """
    single, mean = intraclass_correlation(grades.T)
    error, correlation = one_against_rest(grades)
    return {
        'krippendorff_alpha': krippendorff_alpha(grades),
        'icc_single': single,
        'icc_mean': mean,
        'one_against_rest_error': error,
        'one_against_rest_r': correlation,
    }


def report_of(ratings: Ratings) -> dict[str, Any]:
    """Return the results and the agreement of a panel, as panel.json holds them; null for what is undefined."""
    rows = zip(ratings.textures, ratings.means, ratings.deviations, ratings.votes, strict=True)
    return {
        'raters': len(ratings.raters),
        'textures': {
            name: {'mean': float(mean), 'std': _or_none(float(std)), 'votes': votes.tolist()}
            for name, mean, std, votes in rows
        },
        **{name: _or_none(value) for name, value in agreement(ratings.grades).items()},
        'protocol_violations': protocol_violations(ratings),
        'note': ratings.note,
    }


def write_panel(ratings: Ratings, folder: Path) -> list[Path]:
    """Write panel.json, grades.csv that training takes, and the charts; InvalidParameter if one cannot be written."""
    with writing(folder, 'folder'):
        folder.mkdir(parents=True, exist_ok=True)
        write_json(report_of(ratings), folder / 'panel.json')
        with (folder / 'grades.csv').open('w', newline='', encoding='utf-8') as file:
            writer = csv.writer(file)
            writer.writerow(('texture', 'grade', 'std'))
            rows = zip(ratings.textures, ratings.means, ratings.deviations, strict=True)
            writer.writerows((name, f'{mean:.3f}', f'{std:.3f}') for name, mean, std in rows)
    charts = votes_chart(ratings, folder / 'votes.png'), deviations_chart(ratings, folder / 'grades.png')
    return [folder / 'panel.json', folder / 'grades.csv', *charts]


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
    low, high = (number * len(ratings.textures) / PAPERS_TEXTURES for number in TEXTURES_PER_GRADE)
    low, high = math.floor(low), math.ceil(high)
    for name, row in zip(ratings.raters, ratings.grades, strict=True):
        used = (np.rint(row)[:, None] == RATINGS_GRADES).sum(axis=0)
        if used.min() < low or used.max() > high:
            shown = ', '.join(f'{count} × {grade}' for grade, count in zip(RATINGS_GRADES, used, strict=True))
            found.append(
                f'rater {name} did not spread the textures evenly: {shown}; {low} to {high} a grade are required'
            )
    return found


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value


# --------------------
# The two pictures of a human panel: votes per grade, and mean with standard deviation.

MIN_FRACTION = 4 / 30  # the paper leaves out grades that got fewer than 4 of 30 votes
MANY = 40  # more textures than this: small names
LARGEST_DOT = 220.0


def votes_chart(ratings: Ratings, path: str | Path) -> Path:
    """Draw how many people gave each texture each grade, textures from smooth to rough (the paper's Fig. 3)."""
    order = np.argsort(ratings.means, kind='stable')
    votes = ratings.votes[order]
    least = max(1, round(MIN_FRACTION * len(ratings.raters)))
    with chart(path, _size(ratings)) as figure:
        axes = figure.subplots()
        texture, grade = np.nonzero(votes >= least)
        numbers = votes[texture, grade]
        axes.scatter(
            texture,
            RATINGS_GRADES[grade],
            s=LARGEST_DOT * numbers / len(ratings.raters),
            color=COLOURS[0],
            alpha=0.8,
            zorder=3,
        )
        axes.scatter(np.arange(len(order)), ratings.means[order], marker='_', color=COLOURS[5], s=80, zorder=4)
        _axes(axes, ratings, order)
        hidden = f', fewer than {least} are not shown' if least > 1 else ''
        axes.set_title(f'Votes per grade of {len(ratings.raters)} people: larger dots have more{hidden}; lines: means')
    return Path(path)


def deviations_chart(ratings: Ratings, path: str | Path) -> Path:
    """Draw mean grade plus and minus one standard deviation over the people (the paper's Fig. 4)."""
    order = np.argsort(ratings.means, kind='stable')
    means, deviations = ratings.means[order], np.nan_to_num(ratings.deviations[order])
    with chart(path, _size(ratings)) as figure:
        axes = figure.subplots()
        places = np.arange(len(order))
        axes.bar(places, 2 * deviations, bottom=means - deviations, width=0.6, color=COLOURS[4], zorder=2)
        axes.scatter(places, means, marker='_', color=COLOURS[0], s=80, zorder=3)
        _axes(axes, ratings, order)
        axes.set_title(f'Grade of {len(ratings.raters)} people: mean ± standard deviation')
    return Path(path)


def _axes(axes: Any, ratings: Ratings, order: AnyArray) -> None:
    names = [ratings.textures[index] for index in order]
    small = len(names) > MANY
    axes.set_xticks(range(len(names)), names, rotation=90, fontsize=5 if small else 8)
    axes.set(
        xlabel='texture, from smooth to rough',
        ylabel='roughness grade (1 to 5)',
        ylim=(0.5, 5.5),
        yticks=RATINGS_GRADES,
    )
    axes.set_xlim(-0.8, len(names) - 0.2)
    axes.grid(visible=False, axis='x')


def _size(ratings: Ratings) -> tuple[float, float]:
    return max(7.0, 0.13 * len(ratings.textures)), 4.2

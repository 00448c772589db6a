"""A human panel: people who grade textures from 1 (smooth) to 5 (rough), and how far they agree.

The protocol is that of Rispal, Rana & Duchaine, "Texture roughness estimation using dynamic tactile sensing", section
III: each person gives every texture a whole grade from 1 to 5 and spreads the textures evenly, 4 to 6 a grade for 25.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData, InvalidParameter

SMOOTH, ROUGH = 1.0, 5.0
GRADES = np.arange(1, 6)
TEXTURES_A_GRADE = (4, 6)  # of the paper's 25; other numbers of textures in proportion
PAPERS_TEXTURES = 25
COLUMNS = ('rater', 'texture', 'grade')
SYNONYMS = {'rating': 'grade'}


@dataclass(frozen=True, eq=False)
class Ratings:
    """What each person says of each texture.

    Parameters
    ----------
    raters, textures
        Names, in the order of their first appearance.
    grades : (n_raters, n_textures)
        1 to 5; NaN where a person did not grade a texture.
    note
        How the grades were made from what was read; '' if they stood there.
    """

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
        return np.asarray((np.rint(self.grades)[:, :, None] == GRADES).sum(axis=0))


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
        return {
            'raters': len(ratings.raters),
            'textures': {
                name: {'mean': float(mean), 'std': _or_none(float(std)), 'votes': votes.tolist()}
                for name, mean, std, votes in zip(
                    ratings.textures, ratings.means, ratings.deviations, ratings.votes, strict=True
                )
            },
            **{name: _or_none(value) for name, value in figures.items()},
            'protocol_violations': list(self.violations),
            'note': ratings.note,
        }

    def write(self, folder: Path) -> tuple[Path, Path]:
        """Write panel.json, and grades.csv that training takes; return their paths."""
        ratings = self.ratings
        try:
            folder.mkdir(parents=True, exist_ok=True)
            report, table = folder / 'panel.json', folder / 'grades.csv'
            report.write_text(json.dumps(self.as_json(), indent=1, ensure_ascii=False) + '\n', encoding='utf-8')
            with table.open('w', newline='', encoding='utf-8') as file:
                writer = csv.writer(file)
                writer.writerow(('texture', 'grade', 'std'))
                rows = zip(ratings.textures, ratings.means, ratings.deviations, strict=True)
                writer.writerows((name, f'{mean:.3f}', f'{std:.3f}') for name, mean, std in rows)
        except OSError as error:
            raise InvalidParameter(f"'{folder}' cannot be written: {error.strerror}; name another folder") from error
        return report, table


def read_ratings(path: str | Path, scale: tuple[float, float] = (SMOOTH, ROUGH)) -> Ratings:
    """Read a CSV file with a line for each rating: columns `rater`, `texture` and `grade` (or `rating`).

    Parameters
    ----------
    path
        Of the file; other columns are left alone, and an empty grade means that there is none.
    scale
        Smoothest and roughest rating allowed; mapped linearly to 1 and 5.

    Raises
    ------
    InvalidData
        With the line, if the file cannot be read as such.
    """
    rows = _read_rows(Path(path))
    raters = tuple(dict.fromkeys(row['rater'] for _, row in rows))
    textures = tuple(dict.fromkeys(row['texture'] for _, row in rows))
    rater_at = {name: index for index, name in enumerate(raters)}
    texture_at = {name: index for index, name in enumerate(textures)}
    grades = np.full((len(raters), len(textures)), np.nan)
    for line, row in rows:
        at = rater_at[row['rater']], texture_at[row['texture']]
        if not np.isnan(grades[at]):
            raise InvalidData(
                f"'{path}', line {line}: rater '{row['rater']}' graded '{row['texture']}' before; give one grade each"
            )
        grades[at] = _grade(row['grade'], scale, f"'{path}', line {line}")
    _check_filled(raters, textures, grades, path)
    low, high = scale
    note = '' if scale == (SMOOTH, ROUGH) else f'ratings from {low:g} to {high:g} were mapped linearly to 1 to 5'
    return Ratings(raters, textures, grades, note)


def examine(ratings: Ratings) -> PanelReport:
    """Return what a panel says and how far its people agree."""
    single, mean = intraclass_correlation(ratings.grades.T)
    error, correlation = one_against_rest(ratings.grades)
    return PanelReport(
        ratings, krippendorff_alpha(ratings), single, mean, error, correlation, tuple(protocol_violations(ratings))
    )


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
    low, high = _allowed_a_grade(len(ratings.textures))
    for name, row in zip(ratings.raters, ratings.grades, strict=True):
        used = (np.rint(row)[:, None] == GRADES).sum(axis=0)
        if used.min() < low or used.max() > high:
            shown = ', '.join(f'{count} × {grade}' for grade, count in zip(GRADES, used, strict=True))
            found.append(f'rater {name} did not spread the textures evenly: {shown}; {low} to {high} a grade are asked')
    return found


def krippendorff_alpha(ratings: Ratings) -> float:
    """Return Krippendorff's alpha for intervals; NaN if all grades are the same.

    Source: Krippendorff 1980, chapter 12; as `nltk` computes it.
    """
    from nltk.metrics import interval_distance  # type: ignore[import-untyped]  # noqa: PLC0415  # slow to import
    from nltk.metrics.agreement import AnnotationTask  # type: ignore[import-untyped]  # noqa: PLC0415

    given = np.argwhere(~np.isnan(ratings.grades))
    triples = [(int(rater), int(texture), float(ratings.grades[rater, texture])) for rater, texture in given]
    if len({grade for _, _, grade in triples}) < 2:
        return math.nan
    return float(AnnotationTask(triples, distance=interval_distance).alpha())


def intraclass_correlation(table: Array) -> tuple[float, float]:
    """Return ICC(2,1) and ICC(2,k): how far one rater, and the mean of k, agrees with others of their kind.

    Parameters
    ----------
    table : (n_targets, n_raters)
        Targets with a NaN are left out; both are NaN if fewer than two are left, or for a single rater.

    Source: Shrout & Fleiss 1979, two-way random effects.
    """
    table = table[~np.isnan(table).any(axis=1)]
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
    if not single > 0 or not joint > 0:
        return math.nan, math.nan
    return float(signal / single), float(signal / joint)


def one_against_rest(grades: Array) -> tuple[float, float]:
    """Return mean absolute difference and mean correlation of each person with the mean of the others.

    Parameters
    ----------
    grades : (n_raters, n_textures)
        NaN where missing. Both are NaN for a single rater.
    """
    errors, correlations = [], []
    for index, own in enumerate(grades):
        others = np.delete(grades, index, axis=0)
        shared = ~np.isnan(own) & ~np.isnan(others).all(axis=0)
        if not shared.any():
            continue
        rest = np.nanmean(others[:, shared], axis=0)
        errors.append(float(np.abs(own[shared] - rest).mean()))
        if own[shared].std() > 0 and rest.std() > 0:
            correlations.append(float(np.corrcoef(own[shared], rest)[0, 1]))
    return (
        float(np.mean(errors)) if errors else math.nan,
        float(np.mean(correlations)) if correlations else math.nan,
    )


def _allowed_a_grade(n_textures: int) -> tuple[int, int]:
    low, high = (number * n_textures / PAPERS_TEXTURES for number in TEXTURES_A_GRADE)
    return math.floor(low), math.ceil(high)


def _read_rows(path: Path) -> list[tuple[int, Mapping[str, str]]]:
    """Return number and columns of each line."""
    try:
        with path.open(newline='', encoding='utf-8-sig') as file:
            reader = csv.DictReader(file)
            names = [SYNONYMS.get(name.strip().lower(), name.strip().lower()) for name in reader.fieldnames or ()]
            reader.fieldnames = names
            rows: list[tuple[int, Mapping[str, str]]] = [(reader.line_num, row) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InvalidData(f"'{path}' cannot be read: {error}; give a CSV file of ratings") from error
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise InvalidData(
            f"'{path}' has the columns {', '.join(names) or 'none'} but no {', '.join(missing)}; "
            'write one rating a line under rater,texture,grade'
        )
    if not rows:
        raise InvalidData(f"'{path}' holds no rating; write one a line under rater,texture,grade")
    for line, row in rows:
        if any(row[name] is None for name in COLUMNS) or not row['rater'] or not row['texture']:
            raise InvalidData(f"'{path}', line {line}: rater or texture is missing; write rater,texture,grade")
    return rows


def _grade(text: str, scale: tuple[float, float], where: str) -> float:
    low, high = scale
    if not low < high:
        raise InvalidParameter(f'the scale goes from {low:g} to {high:g}; give the smooth end first, then a larger one')
    if not text.strip():
        return math.nan
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise InvalidData(
            f"{where}: the grade is '{text}'; a number from {low:g} to {high:g} is needed, "
            'or name another scale with --scale'
        )
    return SMOOTH + (ROUGH - SMOOTH) * (value - low) / (high - low)


def _check_filled(raters: Sequence[str], textures: Sequence[str], grades: Array, path: str | Path) -> None:
    empty = np.isnan(grades).all(axis=0)
    if empty.any():
        raise InvalidData(f"'{path}': nobody graded '{textures[int(empty.argmax())]}'; leave it out or grade it")
    if len(raters) < 2:
        raise InvalidData(f"'{path}' has a single rater, '{raters[0]}'; a panel needs two or more")


def _or_none(value: float) -> float | None:
    return None if math.isnan(value) else value

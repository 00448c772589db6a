"""Grades from 1 (smooth) to 5 (rough) that people gave textures, and the table they are read from."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.files import MB, read_text
from texture_estimation.roughness.regressor import ROUGH, SMOOTH

GRADES = np.arange(1, 6)
MAX_BYTES = 1 * MB
MAX_CELLS = 1_000_000  # people × textures
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

    Examples
    --------
    >>> ratings = Ratings(('anna', 'ben'), ('silk', 'jute'), np.array([[1.0, 4.0], [2.0, 5.0]]))
    >>> ratings.means.tolist(), ratings.votes[0].tolist()
    ([1.5, 4.5], [1, 1, 0, 0, 0])
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
    if len(raters) * len(textures) > MAX_CELLS:
        raise InvalidData(
            f"'{path}' has {len(raters)} raters and {len(textures)} textures; their product may be {MAX_CELLS}"
        )
    grades = _grades(rows, raters, textures, scale, path)
    _check_filled(raters, textures, grades, path)
    low, high = scale
    note = '' if scale == (SMOOTH, ROUGH) else f'ratings from {low:g} to {high:g} were mapped linearly to 1 to 5'
    return Ratings(raters, textures, grades, note)


def _read_rows(path: Path) -> list[tuple[int, Mapping[str, str]]]:
    """Return number and columns of each line."""
    try:
        reader = csv.DictReader(io.StringIO(read_text(path, MAX_BYTES, 'utf-8-sig'), newline=''))
        names = [SYNONYMS.get(name.strip().lower(), name.strip().lower()) for name in reader.fieldnames or ()]
        reader.fieldnames = names
        rows: list[tuple[int, Mapping[str, str]]] = [(reader.line_num, row) for row in reader]
    except (OSError, ValueError, csv.Error) as error:
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


def _grades(
    rows: Sequence[tuple[int, Mapping[str, str]]],
    raters: Sequence[str],
    textures: Sequence[str],
    scale: tuple[float, float],
    path: str | Path,
) -> Array:
    """Return the grades, (n_raters, n_textures), NaN where there is none."""
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
    return grades


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
        needed = f'a number from {low:g} to {high:g} is needed, or name another scale with --scale'
        raise InvalidData(f"{where}: the grade is '{text}'; {needed}")
    return SMOOTH + (ROUGH - SMOOTH) * (value - low) / (high - low)


def _check_filled(raters: Sequence[str], textures: Sequence[str], grades: Array, path: str | Path) -> None:
    empty = np.isnan(grades).all(axis=0)
    if empty.any():
        raise InvalidData(f"'{path}': nobody graded '{textures[int(empty.argmax())]}'; leave it out or grade it")
    if len(raters) < 2:
        raise InvalidData(f"'{path}' has a single rater, '{raters[0]}'; a panel needs two or more")

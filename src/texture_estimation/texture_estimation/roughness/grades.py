"""Grades that people gave to textures: a table in a CSV file."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidData
from texture_core.files import MB, read_text
from texture_core.resources import find_file
from texture_estimation.roughness.regressor import ROUGH, SMOOTH

MAX_BYTES = 1 * MB
TRAIN, TEST = 'train', 'test'


@dataclass(frozen=True)
class Grades:
    """The grade of each texture, and for which each is meant.

    A grade is an opinion; the physical roughness of a surface stands elsewhere.

    Parameters
    ----------
    grades
        From 1 (smooth) to 5 (rough), by texture.
    splits
        'train' or 'test', by texture; empty if the table does not say.

    Examples
    --------
    >>> grades = Grades({'silk': 1.2, 'jute': 4.6}, {'silk': 'train', 'jute': 'test'})
    >>> grades.of('jute'), grades.used_for('train')
    (4.6, ('silk',))
    """

    grades: Mapping[str, float]
    splits: Mapping[str, str] = field(default_factory=dict)

    def of(self, texture: str) -> float:
        """Return a texture's grade; UnknownName with the nearest if it has none."""
        if texture not in self.grades:
            raise unknown_name(texture, self.grades, 'grade for the texture')
        return self.grades[texture]

    def used_for(self, split: str) -> tuple[str, ...]:
        """Return the textures meant to 'train' or to 'test', in their order."""
        return tuple(texture for texture in self.grades if self.splits.get(texture) == split)


def read_grades(path: str | Path) -> Grades:
    """Read a CSV file with the columns `texture` and `grade`, and if wanted `split`; others are left alone.

    Parameters
    ----------
    path
        Of the file, or the name of a table that the suite ships, such as 'ets_roughness'.

    Raises
    ------
    InvalidData, UnknownName
        If there is no such file, or with the line that cannot be used.
    """
    place = find_file(str(path), 'texture_simulation', 'config/grades', 'table of grades', '.csv')
    try:
        file = io.StringIO(read_text(place, MAX_BYTES, 'utf-8-sig'), newline='')
        reader = csv.DictReader(line for line in file if not line.startswith('#'))
        rows = list(enumerate(reader, 2))
        columns = tuple(reader.fieldnames or ())
    except (OSError, ValueError, csv.Error) as error:
        raise InvalidData(f"'{place}' cannot be read: {error}; give a CSV file of grades") from error
    if not {'texture', 'grade'} <= set(columns):
        raise InvalidData(f"'{place}' has the columns {', '.join(columns) or 'none'}; texture and grade are needed")
    grades: dict[str, float] = {}
    splits: dict[str, str] = {}
    for line, row in rows:
        texture, where = row['texture'], f"'{place}', line {line}"
        if not texture or texture in grades:
            raise InvalidData(f"{where}: the texture is '{texture}'; name each once")
        grades[texture] = _grade(row['grade'], where)
        if row.get('split'):
            splits[texture] = _split(row['split'], where)
    if not grades:
        raise InvalidData(f"'{place}' holds no grade; write one a line under texture,grade")
    return Grades(grades, splits)


def _grade(text: str | None, where: str) -> float:
    try:
        grade = float(text or '')
    except ValueError:
        grade = math.nan
    if not SMOOTH <= grade <= ROUGH:
        raise InvalidData(f"{where}: the grade is '{text}'; a number from 1 to 5 is needed")
    return grade


def _split(text: str, where: str) -> str:
    if text not in (TRAIN, TEST):
        raise InvalidData(f"{where}: the split is '{text}'; '{TRAIN}' or '{TEST}' is needed")
    return text

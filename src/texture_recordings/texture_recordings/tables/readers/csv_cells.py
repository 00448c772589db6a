"""Read the lines of a CSV file as cells."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData
from texture_core.files import FileRefused, open_regular
from texture_recordings.tables.table_columns import FileFormat

DELIMITERS = (',', ';', '\t', '|', ' ')
MAX_LINE = 1_000_000  # characters; a longer line is cut and thereby malformed


Line = tuple[int, str]  # its number in the file, from 1


def fill_gaps(texts: AnyArray) -> AnyArray:
    """Return texts in which a malformed row has the one before it: no border is seen there.

    Parameters
    ----------
    texts : (n,)
        None where the row is malformed.

    Returns
    -------
    (n,) str
    """
    known = np.array([text is not None for text in texts])
    if not known.any():
        return np.full(len(texts), '', dtype=str)
    last = np.maximum.accumulate(np.where(known, np.arange(len(texts)), -1))
    last[last < 0] = int(np.argmax(known))
    filled: AnyArray = texts[last].astype(str)
    return filled


@contextmanager
def open_lines(path: Path, place: str, form: FileFormat) -> Iterator[Iterator[Line]]:
    """Give the lines that are neither empty nor comments, each with its number.

    Parameters
    ----------
    path
        Path of the file.
    place
        Name of the file in messages.
    form
        Lines to skip and the sign of comments.

    Returns
    -------
    context manager
        Gives an iterator over (number from 1, line).

    Raises
    ------
    InvalidData
        If the file cannot be read.
    """
    try:
        with open_regular(path) as opened, io.TextIOWrapper(opened, 'utf-8-sig', 'replace', newline=None) as text:
            yield _kept(text, form)
    except (OSError, FileRefused) as error:
        raise InvalidData(f"'{place}' cannot be read: {error}; give a text file") from error


def _kept(text: io.TextIOWrapper, form: FileFormat) -> Iterator[Line]:
    for number, line in enumerate(iter(partial(text.readline, MAX_LINE), ''), 1):
        bare = line.rstrip('\r\n')
        if number > form.skip_rows and bare.strip() and not (form.comment and bare.startswith(form.comment)):
            yield number, bare


def likely_delimiter(line: str) -> str:
    """Return the character that parts the cells of a line."""
    counts = {delimiter: line.count(delimiter) for delimiter in DELIMITERS}
    return next((delimiter for delimiter in DELIMITERS[:-1] if counts[delimiter]), ' ' if counts[' '] else ',')


def split_cells(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line without blanks around them; none if its quotes cannot be read."""
    if delimiter == ' ':
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    except csv.Error:
        return []

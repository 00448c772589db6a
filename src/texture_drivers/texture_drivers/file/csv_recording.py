"""Read a recording from a table of text."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from typing import BinaryIO, TextIO

import numpy as np

from texture_core.arrays import Array
from texture_drivers.file.file_recording import FileRecording

TIME_COLUMNS = ('time_s', 'time', 't')
MAX_COLUMNS = 10_000


MAX_LINE = 16 * MAX_COLUMNS
UNEVEN = 0.1  # deviation of a time step from their median above which a recording is not evenly sampled


def load_csv(file: BinaryIO) -> FileRecording:
    """Return a table: one column for each channel, comma, semicolon or blanks between, names in the first line or none.

    A column `time_s` gives the rate and is no channel. Lines with # are passed over.

    Raises
    ------
    ValueError
        If names and numbers do not fit, or times are uneven.
    """
    text = io.TextIOWrapper(file, encoding='utf-8-sig')
    first = next(_lines(text), '')
    delimiter = next((sign for sign in ',;' if sign in first), None)
    names = [name.strip().strip('"') for name in first.strip().split(delimiter)]
    named = not all(_is_number(name) for name in names)
    text.seek(0)
    lines = _lines(text)
    if named:
        next(lines, None)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # an empty table is refused below, in our words
        table = np.loadtxt(lines, delimiter=delimiter, ndmin=2, dtype=np.float64)
    if not named:
        return FileRecording(table)
    if table.size and table.shape[1] != len(names):
        raise ValueError(f'its first line has {len(names)} names and the others {table.shape[1]} numbers')
    time = next((i for i, name in enumerate(names) if name.lower() in TIME_COLUMNS), None)
    if time is None or not table.size:
        return FileRecording(table, None, tuple(names))
    del names[time]
    return FileRecording(np.delete(table, time, axis=1), rate_from_times(table[:, time]), tuple(names))


def _lines(text: TextIO) -> Iterator[str]:
    """Yield the lines of a table that hold something; one that never ends is refused while it is read."""
    while line := text.readline(MAX_LINE + 1):
        if len(line) > MAX_LINE:
            raise ValueError(f'it has a line of more than {MAX_LINE} characters; that is no table')
        if line.strip() and not line.startswith('#'):
            yield line


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def rate_from_times(time_s: Array) -> float:
    """Return the rate of evenly spaced times, (n,); ValueError if they are not.

    Parameters
    ----------
    time_s : (n,)
        Rising.

    Raises
    ------
    ValueError
        If they do not rise or are not evenly spaced.
    """
    steps = np.diff(time_s)
    if not len(steps) or not np.median(steps) > 0:
        raise ValueError('its times do not rise; leave the column out and set `rate_hz`')
    if np.abs(steps / np.median(steps) - 1).max() > UNEVEN:
        raise ValueError(
            f'its times are uneven (steps of {steps.min():.4g} to {steps.max():.4g} s); resample it, or leave the '
            'column out and set `rate_hz`'
        )
    return float(len(steps) / (time_s[-1] - time_s[0]))

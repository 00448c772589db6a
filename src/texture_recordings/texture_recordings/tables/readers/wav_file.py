"""Sound files: .wav with integers or floats; full scale is 1."""

from __future__ import annotations

import io
import struct
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from texture_core.errors import InvalidData
from texture_core.files import read_bounded
from texture_core.signal import MAX_HZ
from texture_recordings.tables.mapping import TableMapping
from texture_recordings.tables.readers.arrays import tables_of
from texture_recordings.tables.table import MAX_VALUES, Table

# What scipy raises, depending on what is wrong.
BROKEN = (OSError, ValueError, EOFError, struct.error, TypeError, LookupError, ArithmeticError, UnboundLocalError)


def read_wav(path: Path, place: str, mapping: TableMapping) -> Iterator[Table]:
    """Yield the one table of a sound file, whose columns count from 0."""
    from scipy.io import wavfile  # noqa: PLC0415 – recording needs no scipy

    try:
        content = read_bounded(path, 4 * MAX_VALUES)
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # chunks that it does not know
            rate_hz, samples = wavfile.read(io.BytesIO(content))
    except BROKEN as error:
        raise InvalidData(f"'{place}' cannot be read as a sound file: {error}; save it as WAV again") from error
    if not 0 < rate_hz <= MAX_HZ:
        raise InvalidData(f"'{place}' has a sampling rate of {rate_hz} Hz; above 0 and at most {MAX_HZ:g} is allowed")
    if samples.dtype.kind == 'u':
        samples = (samples.astype(np.float64) - 128.0) / 128.0
    elif samples.dtype.kind == 'i':
        samples = samples / -float(np.iinfo(samples.dtype).min)
    for table in tables_of([''], lambda _: samples, place, mapping):
        yield replace(table, rate_hz=float(rate_hz))

"""Write labelled slides as a Parquet file, a row for each sample."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.files import writing
from texture_recordings.optional_library import library
from texture_recordings.slide_samples import SlideSamples

FACTS = ('slide', 'surface', 'number', 'session', 'speed_m_s', 'force_n', 'direction_rad', 'time_s')


def write_parquet(slides: Sequence[SlideSamples], path: str | Path) -> None:
    """Write the samples of slides, one group of rows for each slide.

    Parameters
    ----------
    slides
        With the same channels.
    path
        File to write; its columns are those of `FACTS`, then the channels.

    Raises
    ------
    InvalidData
        If the slides differ in channels, a channel is named as a column of `FACTS`, or pyarrow is not installed.
    InvalidParameter
        If the file exists or cannot be written.
    """
    arrow = library('pyarrow', 'Parquet files', 'parquet')
    parquet = library('pyarrow.parquet', 'Parquet files', 'parquet')
    channels = slides[0].channels
    other = next((slide for slide in slides if slide.channels != channels), None)
    if other or set(channels) & set(FACTS):
        place = f"slide '{other.slide.name}' has {', '.join(other.channels)}" if other else ', '.join(FACTS)
        raise InvalidData(f'the channels are {", ".join(channels)}, but {place}; export slides of one sensor')
    if Path(path).exists():
        raise InvalidParameter(f"'{path}' exists already; name another file or remove it")
    first = arrow.table(_rows(arrow, slides[0]))
    with writing(path), parquet.ParquetWriter(path, first.schema) as writer:
        for slide in slides:
            writer.write_table(arrow.table(_rows(arrow, slide)))


def _rows(arrow: Any, samples: SlideSamples) -> dict[str, Any]:
    count, slide = len(samples.samples), samples.slide
    facts: dict[str, AnyArray] = {
        'number': np.full(count, slide.number),
        'speed_m_s': np.full(count, samples.speed_m_s),
        'force_n': np.full(count, samples.force_n),
        'direction_rad': np.full(count, samples.direction_rad),
        'time_s': np.arange(count) / samples.rate_hz,
    }
    texts = {'slide': slide.name, 'surface': slide.surface, 'session': slide.session}
    columns = {name: facts[name] if name in facts else _repeated(arrow, texts[name], count) for name in FACTS}
    return {**columns, **dict(zip(samples.channels, samples.samples.astype(np.float32).T, strict=True))}


def _repeated(arrow: Any, text: str, count: int) -> Any:
    return arrow.DictionaryArray.from_arrays(np.zeros(count, dtype=np.int32), [text])

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write labelled slides as Parquet: a file for each stream, a row for each sample, and the mapping that reads it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.config import library, writing, yaml_text
from texture_core.errors import InvalidData, InvalidParameter, counted
from texture_core.types import AnyArray
from texture_recordings.bags import new_folder
from texture_recordings.dataset import SlideDataset
from texture_recordings.mapping import CONDITION_COLUMNS, UNITS
from texture_recordings.slides import STREAMS, SlideSamples

FACTS = ('slide', 'surface', 'number', 'session', *CONDITION_COLUMNS.values(), 'time_s')


def export_slides(dataset: SlideDataset, out: str | Path) -> list[str]:
    """Write every stream of the slides of a data set into a new folder; those that lost samples are counted."""
    folder = Path(out)
    streams: dict[str, list[SlideSamples]] = {}
    lines, reason = [], 'they have no stream'
    for topic in STREAMS:
        having, lost = [slide for slide in dataset if slide.signals.get(topic)], 0
        for slide in having:
            try:
                streams.setdefault(topic, []).append(SlideSamples.of(slide, topic))
            except InvalidData as error:  # noqa: PERF203 – the slides are few
                lost, reason = lost + 1, str(error)
        lines += [f"{lost} slides lost samples of '{topic}' and were left out of it"] * bool(lost)
    if not any(streams.values()):
        raise InvalidData(f'none of the {len(dataset)} slides can be exported: {reason}')
    with new_folder(folder):
        for topic, samples in streams.items():
            write_parquet(samples, folder / f'{topic}.parquet')
            (folder / f'{topic}.yaml').write_text(yaml_text(_mapping(topic, samples)), encoding='utf-8')
            surfaces = len({one.surface for one in samples})
            lines.append(
                f"{counted(len(samples), 'slide')} over {counted(surfaces, 'surface')} in '{folder / topic}.parquet'; "
                f'{topic}.yaml is the mapping by which `texture import table` reads it back'
            )
    return lines


def write_parquet(slides: Sequence[SlideSamples], path: str | Path) -> None:
    """Write the samples of one stream of slides, one group of rows for each slide.

    Parameters
    ----------
    slides
        With the same rate and channels.
    path
        File to write; its columns are those of `FACTS`, then the channels.

    Raises
    ------
    InvalidData
        If the slides differ in rate or channels, or a channel is named as a column of `FACTS`.
    InvalidParameter
        If the file exists or cannot be written.
    MissingLibrary
        If pyarrow is missing.
    """
    arrow, parquet = (library(name, 'Parquet files', 'parquet') for name in ('pyarrow', 'pyarrow.parquet'))
    first = slides[0]
    for slide in slides:
        if slide.channels != first.channels or slide.rate_hz != first.rate_hz or set(slide.channels) & set(FACTS):
            raise InvalidData(
                f"slide '{slide.slide.name}' has {', '.join(slide.channels)} at {slide.rate_hz:g} Hz, "
                f"'{first.slide.name}' {', '.join(first.channels)} at {first.rate_hz:g} Hz, and {', '.join(FACTS)} are "
                'other columns; export slides of one sensor'
            )
    if Path(path).exists():
        raise InvalidParameter(f"'{path}' exists already; name another file or remove it")
    with writing(path), parquet.ParquetWriter(path, arrow.table(_rows(arrow, first)).schema) as writer:
        for slide in slides:
            writer.write_table(arrow.table(_rows(arrow, slide)))


def _rows(arrow: Any, samples: SlideSamples) -> dict[str, Any]:
    count, slide = len(samples.samples), samples.slide
    texts = {'slide': slide.name, 'surface': slide.surface, 'session': slide.session}
    numbers: dict[str, AnyArray] = {
        'number': np.full(count, slide.number),
        **{name: np.full(count, getattr(samples, name)) for name in CONDITION_COLUMNS.values()},
        'time_s': np.arange(count) / samples.rate_hz,
    }
    zeros = np.zeros(count, dtype=np.int32)
    columns = {
        name: arrow.DictionaryArray.from_arrays(zeros, [texts[name]]) if name in texts else numbers[name]
        for name in FACTS
    }
    return {**columns, **dict(zip(samples.channels, samples.samples.astype(np.float32).T, strict=True))}


def _mapping(topic: str, samples: Sequence[SlideSamples]) -> Mapping[str, Any]:
    """Return the mapping of an exported file for `texture import table`."""
    first, batch = samples[0], samples[0].slide.signals[topic][0]
    known = {
        name: {'column': column}
        for name, column in CONDITION_COLUMNS.items()
        if any(math.isfinite(getattr(one, column)) for one in samples)
    }
    channels = list(first.channels)
    names = {one.surface: one.surface for one in samples}  # also those that differ in case alone
    stream = {
        'columns': channels, 'channels': channels, 'rate_hz': first.rate_hz, 'samples_per_row': 1,
        'unit': batch.common_unit if batch.common_unit in UNITS else '',
    }  # fmt: skip
    return {
        'files': f'{topic}.parquet', 'streams': {topic: stream}, 'label': {'column': 'surface', 'names': names},
        'slides': {'by': 'column', 'column': 'slide', 'min_s': 0.0}, 'conditions': known,
        'session': 'session' if all(one.slide.session for one in samples) else '',
        'sensor': first.slide.sensor, 'motion': first.slide.motion_name,
    }  # fmt: skip

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Write labelled slides as others read them: Parquet, HDF5, a LeRobot data set; and cards for data sets and models."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from texture_core.config import find, library, parse_json, read_bounded, write_json, writing
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import AnyArray, Array
from texture_recordings.dataset import STREAMS, SlideDataset, SlideSamples

Slides = Mapping[str, Sequence[SlideSamples]]  # by topic: the same slides in the same order
CONDITION_COLUMNS = {'speed': 'speed_m_s', 'force': 'force_n', 'direction': 'direction_rad'}
FACTS = ('slide', 'surface', 'number', 'session', *CONDITION_COLUMNS.values(), 'time_s')


def export_slides(dataset: SlideDataset, out: str | Path, kind: str, licence: str = 'other') -> list[str]:
    """Write the slides of a data set, all streams that each slide has, into a new folder with a data card."""
    write = find(KINDS, kind, 'format')
    slides, lost = _whole(dataset)
    folder = Path(out)
    if folder.exists():
        raise InvalidParameter(f"'{out}' exists already; nothing is overwritten, name another folder or remove it")
    with writing(folder, 'folder'):
        folder.mkdir(parents=True)
        further = write(slides, folder)
        (folder / 'README.md').write_text(data_card(slides, kind, licence), encoding='utf-8')
    first = next(iter(slides.values()))
    told = [f"{len(first)} slides over {len({one.surface for one in first})} surfaces in '{folder}'", *further]
    return told + [f'{lost} slides with lost samples were left out'] * bool(lost)


def _whole(dataset: SlideDataset) -> tuple[Slides, int]:
    """Return the samples of the slides that lost none, and the number of the others."""
    topics = [topic for topic in STREAMS if all(slide.signals.get(topic) for slide in dataset)]
    slides: dict[str, list[SlideSamples]] = {topic: [] for topic in topics}
    reason = 'they have no stream in common'
    for slide in dataset if topics else ():
        try:
            own = {topic: SlideSamples.of(slide, topic) for topic in topics}
        except InvalidData as error:
            reason = str(error)
            continue
        for topic, one in own.items():
            slides[topic].append(one)
    if not topics or not slides[topics[0]]:
        raise InvalidData(f'none of the {len(dataset)} slides can be exported: {reason}')
    for topic, samples in slides.items():
        first = samples[0]
        for one in samples:
            if one.channels != first.channels or not 0.95 < one.rate_hz / first.rate_hz < 1.05:
                raise InvalidData(
                    f"'{topic}' of slide '{one.slide.name}' has {len(one.channels)} channels at {one.rate_hz:g} Hz, "
                    f"that of '{first.slide.name}' {len(first.channels)} at {first.rate_hz:g} Hz; "
                    'export the slides of one sensor'
                )
    return slides, len(dataset) - len(slides[topics[0]])


# --------------------
# Parquet: a row for each sample, one file for each stream; and HDF5: a group for each slide.


def write_parquet(slides: Sequence[SlideSamples], path: str | Path) -> None:
    """Write the samples of one stream of slides, one group of rows for each slide.

    Parameters
    ----------
    slides
        With the same channels.
    path
        File to write; its columns are those of `FACTS`, then the channels.

    Raises
    ------
    InvalidData
        If the slides differ in channels, or a channel is named as a column of `FACTS`.
    InvalidParameter
        If the file exists or cannot be written.
    MissingLibrary
        If pyarrow is missing.
    """
    arrow, parquet = (library(name, 'Parquet files', 'parquet') for name in ('pyarrow', 'pyarrow.parquet'))
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


def _write_parquet(slides: Slides, folder: Path) -> list[str]:
    for topic, samples in slides.items():
        write_parquet(samples, folder / f'{topic}.parquet')
        borders = {'by': 'column', 'column': 'slide', 'min_s': 0.0}
        mapping = _mapping({topic: samples}, f'{topic}.parquet', {topic: list(samples[0].channels)})
        _write_mapping({**mapping, 'slides': borders}, folder / f'{topic}.yaml')
    return [f'{topic}.parquet, and {topic}.yaml, by which `texture import table` reads it back' for topic in slides]


def _write_hdf5(slides: Slides, folder: Path) -> list[str]:
    h5py = library('h5py', 'HDF5 files', 'hdf5')
    with h5py.File(folder / 'slides.h5', 'w') as file:
        for topic, samples in slides.items():
            for one in samples:
                group = file.require_group(f'{one.surface}/{one.slide.number:05d}')
                stream = group.create_dataset(topic, data=one.samples.astype(np.float32), compression='gzip')
                stream.attrs.update({'rate_hz': one.rate_hz, 'channels': list(one.channels), 'unit': _unit(one, topic)})
                facts = {'session': one.slide.session, **{name: getattr(one, name) for name in FACTS[4:7]}}
                for name, value in facts.items():
                    if name not in group:
                        group[name] = value
    columns = {topic: [topic if len(one[0].channels) == 1 else f'{topic}.*'] for topic, one in slides.items()}
    mapping = {**_mapping(slides, 'slides.h5', columns), 'tables': '{surface}/{number}', 'slides': {'min_s': 0.0}}
    _write_mapping(mapping, folder / 'slides.yaml')
    return ['slides.h5, and slides.yaml, by which `texture import table` reads it back']


def _mapping(slides: Slides, file: str, columns: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """Return what `texture import table` must be told of exported files."""
    first = next(iter(slides.values()))
    known = {
        name: {'column': column}
        for name, column in CONDITION_COLUMNS.items()
        if all(math.isfinite(getattr(one, column)) for one in first)
    }
    streams = {
        topic: {
            'columns': list(columns[topic]),
            'channels': list(samples[0].channels),
            'unit': _unit(samples[0], topic),
            'rate_hz': samples[0].rate_hz,
        }
        for topic, samples in slides.items()
    }
    slide = first[0].slide
    origin = {'session': 'session', 'sensor': slide.sensor, 'motion': slide.motion_name}
    return {'files': file, 'streams': streams, 'label': {'column': 'surface'}, 'conditions': known, **origin}


def _unit(samples: SlideSamples, topic: str) -> str:
    return samples.slide.signals[topic][0].common_unit


def _write_mapping(mapping: Mapping[str, Any], path: Path) -> None:
    path.write_text(yaml.safe_dump(dict(mapping), sort_keys=False, allow_unicode=True), encoding='utf-8')


# --------------------
# A LeRobot data set, version 3.0: a slide is an episode, its surface the task.
#
# All columns of that format share one frame rate, and touch has several. So a frame holds as many samples of a stream
# as fall into it, (samples of a frame, channels), and meta/info.json gives the rate of each: nothing is resampled where
# the rates have a common divisor. Layout: https://huggingface.co/docs/lerobot/lerobot-dataset-v3

LEROBOT_VERSION = 'v3.0'
FRAME_RATES_HZ = (10, 200)  # lowest and highest of a frame
PLACE = {'chunk_index': 0, 'file_index': 0}
FILE = 'chunk-{chunk_index:03d}/file-{file_index:03d}.parquet'
INDICES = ('frame_index', 'episode_index', 'index', 'task_index')


def frame_rate_hz(rates_hz: Sequence[float]) -> int:
    """Return the frames a second in which streams of these rates have whole numbers of samples, or 50."""
    if any(rate_hz != round(rate_hz) for rate_hz in rates_hz):
        return 50
    common = math.gcd(*map(round, rates_hz))
    lowest, highest = FRAME_RATES_HZ
    return next((rate for rate in range(highest, lowest - 1, -1) if common % rate == 0), 50)


def _write_lerobot(slides: Slides, folder: Path) -> list[str]:
    arrow, parquet = (library(name, 'LeRobot data sets', 'parquet') for name in ('pyarrow', 'pyarrow.parquet'))
    fps = frame_rate_hz([samples[0].rate_hz for samples in slides.values()])
    first = next(iter(slides.values()))
    tasks = list(dict.fromkeys(f'slide over {one.surface}' for one in first))
    features, further = _features(slides, fps)
    conditions = 'observation.state' in features
    episodes: dict[str, list[Any]] = {}
    written: dict[str, list[AnyArray]] = {}
    start, n_episode = 0, 0
    for own in zip(*slides.values(), strict=True):
        frames = {
            f'observation.{topic}': _frames(samples, fps, features[f'observation.{topic}']['shape'])
            for topic, samples in zip(slides, own, strict=True)
        }
        count = min(map(len, frames.values()))
        if not count:
            further.append(f"slide '{own[0].slide.name}' is shorter than a frame of {1 / fps:g} s, left out")
            continue
        task = tasks.index(f'slide over {own[0].surface}')
        columns = {name: array[:count] for name, array in frames.items()}
        if conditions:
            state = [getattr(own[0], name) for name in CONDITION_COLUMNS.values()]
            columns['observation.state'] = np.tile(np.array(state, dtype=np.float32), (count, 1))
        columns['timestamp'] = (np.arange(count) / fps).astype(np.float32)
        numbers = (np.arange(count), np.full(count, n_episode), start + np.arange(count), np.full(count, task))
        columns |= dict(zip(INDICES, numbers, strict=True))
        for name, array in columns.items():
            written.setdefault(name, []).append(array)
        facts = {'episode_index': n_episode, 'tasks': [tasks[task]], 'length': count,
                 'dataset_from_index': start, 'dataset_to_index': start + count,
                 'slide': own[0].slide.name, 'session': own[0].slide.session,
                 **{f'{kind}/{key}': 0 for kind in ('data', 'meta/episodes') for key in PLACE}}  # fmt: skip
        for name, value in facts.items():
            episodes.setdefault(name, []).append(value)
        start, n_episode = start + count, n_episode + 1
    if not n_episode:
        raise InvalidData(f'no slide is as long as a frame of {1 / fps:g} s; record longer slides')
    data = {name: np.concatenate(arrays) for name, arrays in written.items()}
    files = {
        'data/' + FILE.format(**PLACE): arrow.table({name: _column(arrow, array) for name, array in data.items()}),
        'meta/episodes/' + FILE.format(**PLACE): arrow.table(episodes),
        'meta/tasks.parquet': _tasks(arrow, tasks),
    }
    for name, table in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(table, folder / name)
    info = {
        'codebase_version': LEROBOT_VERSION,
        'robot_type': first[0].slide.sensor or 'unknown',
        'total_episodes': n_episode,
        'total_frames': start,
        'total_tasks': len(tasks),
        'chunks_size': 1000,
        'data_files_size_in_mb': 100,
        'video_files_size_in_mb': 200,
        'fps': fps,
        'splits': {'train': f'0:{n_episode}'},
        'data_path': f'data/{FILE}',
        'video_path': None,
        'features': features,
    }
    write_json(info, folder / 'meta' / 'info.json')
    write_json({name: _statistics(array) for name, array in data.items()}, folder / 'meta' / 'stats.json')
    return [f'{n_episode} episodes of {start} frames at {fps} Hz, each with all samples of its time', *further]


def _features(slides: Slides, fps: int) -> tuple[dict[str, Any], list[str]]:
    """Return the features as meta/info.json lists them, and what is to be said of their rates."""
    features: dict[str, Any] = {}
    told = []
    for topic, (one, *_) in slides.items():
        per_frame = max(1, round(one.rate_hz / fps))
        shape = [per_frame, len(one.channels)] if per_frame > 1 else [len(one.channels)]
        info = {'rate_hz': one.rate_hz, 'samples_per_frame': per_frame, 'unit': _unit(one, topic)}
        if per_frame * fps != one.rate_hz:
            info['interpolated_to_hz'] = per_frame * fps
            told.append(f"'{topic}' was interpolated from {one.rate_hz:g} to {per_frame * fps} Hz")
        names = list(one.channels) if per_frame == 1 else ['sample', 'channel']
        features[f'observation.{topic}'] = {
            'dtype': 'float32', 'shape': shape, 'names': names, 'channels': list(one.channels), 'info': info,
        }  # fmt: skip
    first = next(iter(slides.values()))
    if all(math.isfinite(getattr(one, name)) for one in first for name in CONDITION_COLUMNS.values()):
        names = list(CONDITION_COLUMNS.values())
        features['observation.state'] = {'dtype': 'float32', 'shape': [len(names)], 'names': names}
    features['timestamp'] = {'dtype': 'float32', 'shape': [1], 'names': None}
    features |= {name: {'dtype': 'int64', 'shape': [1], 'names': None} for name in INDICES}
    return features, told


def _frames(samples: SlideSamples, fps: int, shape: Sequence[int]) -> AnyArray:
    """Return the samples of a stream in whole frames, (n_frames, *shape)."""
    per_frame = shape[0] if len(shape) > 1 else 1
    values: Array = samples.samples
    if per_frame * fps != samples.rate_hz:
        times = np.arange(int(len(values) / samples.rate_hz * per_frame * fps)) / (per_frame * fps)
        known = np.arange(len(values)) / samples.rate_hz
        values = np.stack([np.interp(times, known, channel) for channel in values.T], axis=1)
    count = len(values) // per_frame
    return values[: count * per_frame].reshape(count, *shape).astype(np.float32)


def _column(arrow: Any, array: AnyArray) -> Any:
    """Return an array as a column: lists of as many levels as a row has axes."""
    column = arrow.array(array.ravel())
    for length in reversed(array.shape[1:]):
        column = arrow.FixedSizeListArray.from_arrays(column, length)
    return column


def _tasks(arrow: Any, tasks: Sequence[str]) -> Any:
    """Return the table of tasks; pandas, with which it is read, takes the texts for the index."""
    index = '__index_level_0__'
    columns: list[dict[str, Any]] = [
        {'name': 'task_index', 'field_name': 'task_index', 'pandas_type': 'int64', 'numpy_type': 'int64'},
        {'name': None, 'field_name': index, 'pandas_type': 'unicode', 'numpy_type': 'object'},
    ]
    facts = {'index_columns': [index], 'columns': [{**one, 'metadata': None} for one in columns]}
    facts |= {'column_indexes': [], 'pandas_version': '2.0.0'}
    table = arrow.table({'task_index': np.arange(len(tasks)), index: list(tasks)})
    return table.replace_schema_metadata({'pandas': json.dumps(facts)})


def _statistics(array: AnyArray) -> dict[str, Any]:
    """Return what policies are normalised with; a sample that is missing counts for nothing."""
    values = array.reshape(len(array), -1).astype(np.float64)
    shape = array.shape[1:] or (1,)
    kinds = (('min', np.nanmin), ('max', np.nanmax), ('mean', np.nanmean), ('std', np.nanstd))
    found = {name: function(values, axis=0).reshape(shape).tolist() for name, function in kinds}
    return {**found, 'count': [len(array)]}


KINDS: Mapping[str, Callable[[Slides, Path], list[str]]] = {
    'parquet': _write_parquet,
    'hdf5': _write_hdf5,
    'lerobot': _write_lerobot,
}

# --------------------
# Cards as hubs expect them: Markdown with facts for machines in front (YAML).

SIZES = ((1_000, 'n<1K'), (10_000, '1K<n<10K'), (100_000, '10K<n<100K'))
CONFIGS: Mapping[str, Callable[[Slides], list[dict[str, str]]]] = {
    'parquet': lambda slides: [{'config_name': topic, 'data_files': f'{topic}.parquet'} for topic in slides],
    'hdf5': lambda slides: [],
    'lerobot': lambda slides: [{'config_name': 'default', 'data_files': 'data/*/*.parquet'}],
}
FORMS = {
    'parquet': 'One Parquet file for each stream, a row for each sample.',
    'hdf5': 'One HDF5 file, a group SURFACE/NUMBER for each slide.',
    'lerobot': (
        'A LeRobot data set: a slide is an episode, its surface the task. A frame holds all samples of its time, so '
        'that each stream keeps its rate: (samples of a frame, channels); see `info` of each feature.'
    ),
}


def data_card(slides: Slides, kind: str, licence: str) -> str:
    """Return the card of an exported data set."""
    first = next(iter(slides.values()))
    facts: dict[str, Any] = {
        'license': licence,
        'task_categories': ['robotics'],
        'tags': ['tactile', 'texture', *['LeRobot'] * (kind == 'lerobot')],
        'size_categories': [next((name for most, name in SIZES if len(first) < most), 'n>100K')],
    }
    if configs := CONFIGS[kind](slides):
        facts['configs'] = configs
    surfaces = Counter(one.surface for one in first)
    lines = [f'A tactile finger slides over {len(surfaces)} surfaces, {len(first)} times. {FORMS[kind]}', '']
    lines += ['| stream | sensor | rate (Hz) | channels | unit |', '|---|---|---|---|---|']
    for topic, (one, *_) in slides.items():
        sensor = one.slide.signals[topic][0].sensor
        lines.append(f'| `{topic}` | {sensor} | {one.rate_hz:g} | {len(one.channels)} | {_unit(one, topic) or "–"} |')
    lines += ['', '| condition | lowest | highest |', '|---|---|---|']
    for name in CONDITION_COLUMNS.values():
        values = np.array([getattr(one, name) for one in first])
        known = values[np.isfinite(values)]
        lines.append(f'| `{name}` | {known.min():.3g} | {known.max():.3g} |' if len(known) else f'| `{name}` | – | – |')
    lines += ['', '| surface | slides |', '|---|---|', *(f'| {name} | {n} |' for name, n in sorted(surfaces.items()))]
    sessions = sorted({one.slide.session for one in first})
    lines += [
        '',
        f'Recordings: {", ".join(sessions)}. Slides of one recording were made in one session: test on recordings that '
        'a model was not trained on, or the figures hold for the same session alone.',
    ]
    return _card(facts, 'Slides of a tactile finger', lines)


def model_card(path: str | Path, licence: str = 'other') -> str:
    """Return the card of a trained model of the suite, from its JSON card."""
    try:
        card = parse_json(read_bounded(Path(path), MAX_CARD_BYTES).decode())
        labels, recipe, training = (card[name] for name in ('labels', 'recipe', 'training'))
        domain = card['acceptance']['domain']
        rows = [
            ('surfaces', ', '.join(labels)),
            ('features', card['feature_set']),
            ('trained on', f'{training["slides"]} slides, {training["windows"]} windows'),
            ('sensors', ', '.join(domain['sensors'])),
            ('motions', ', '.join(domain['motions'])),
            ('speed (m/s)', _range(domain['speed_m_s'])),
            ('force (N)', _range(domain['force_n'])),
        ]
        reach = {name: min(one[name] for one in domain['reach'].values()) for name in ('sessions', 'places', 'fingers')}
        rows.append(('at least, of each surface', ', '.join(f'{count} {name}' for name, count in reach.items())))
        accuracy = float(training['held_out_window_accuracy'])
        description, name = str(recipe['description']), str(card['name'])
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        reason = 'it is not text' if isinstance(error, UnicodeDecodeError) else error
        raise InvalidData(f"'{path}' is not the card of a texture model: {reason}; give MODEL.json") from error
    facts = {'license': licence, 'library_name': 'tactile-texture', 'tags': ['tactile', 'texture', 'robotics']}
    lines = [description, '', '| | |', '|---|---|', *(f'| {key} | {value} |' for key, value in rows), '']
    lines += [
        f'Single windows right, in slides held out of the training: {100 * accuracy:.1f} %. These slides are of the '
        'same recordings; on another place, day or finger the figure is lower unless several of each were trained.',
        '',
        'An estimate outside the ranges above is rejected. Use: `texture launch replay bag:=BAG model:=MODEL.npz`.',
    ]
    return _card(facts, f'Texture model {name}', lines)


MAX_CARD_BYTES = 5_000_000


def _range(edges: Sequence[float] | None) -> str:
    return '{:g} to {:g}'.format(*edges) if edges else '–'


def _card(facts: Mapping[str, Any], title: str, lines: Sequence[str]) -> str:
    front = yaml.safe_dump(dict(facts), sort_keys=False, allow_unicode=True)
    return '\n'.join(['---', front + '---', '', f'# {title}', '', *lines, ''])

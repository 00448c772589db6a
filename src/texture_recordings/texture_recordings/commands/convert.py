# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The sub-commands of `texture` that turn recordings into others: `import`, `segment` and `export`."""

from __future__ import annotations

import argparse
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

from texture_core.cli import Command, add_bag_namespace, add_parameters, add_slides, parameters_from, progress, task
from texture_core.config import find
from texture_core.errors import InvalidData, InvalidParameter, counted
from texture_core.types import ExplorationState, Phase, TactileSignal, needed_label
from texture_features.segmentation import SegmentationParams, segment_recording
from texture_recordings.bags import EXPLORATION, BagPaths, BagWriter, find_bags, new_folder, read_bag, read_named
from texture_recordings.dataset import SlideDataset
from texture_recordings.export import export_slides
from texture_recordings.mapping import load_mapping
from texture_recordings.public_sets import IMPORTS
from texture_recordings.readers import MAPPED
from texture_recordings.tables import import_tables

FAST_TOPIC = 'signal'
NO_SLIDE = 'lower --on and --off, or --ramp-s, or give the noise at rest as --noise-rms'
USAGE = 'texture import DATA_SET SOURCE OUT, or texture import {table,bag} MAPPING SOURCE OUT'


def _configure_import(parser: argparse.ArgumentParser) -> None:
    parser.usage = f'{USAGE} [options]'
    parser.add_argument('data_set', help=f'one of {", ".join(IMPORTS)}; or {" or ".join(MAPPED)}, with a mapping')
    parser.add_argument(
        'places', nargs='+', metavar='PLACE', help='the mapping file, if there is one; the source; the folder for bags'
    )
    parser.add_argument('--dry-run', action='store_true', help='only print what a mapping would import; no OUT')


def _import(options: argparse.Namespace) -> int:
    """Import, and name the bags."""
    mapped = options.data_set in MAPPED
    importer: Any = find({**IMPORTS, **MAPPED}, options.data_set, 'data set or kind of source')
    if options.dry_run and mapped and len(options.places) == 2:
        options.places.append('')
    if len(options.places) != 2 + mapped:
        raise InvalidParameter(f'after {options.data_set} came {counted(len(options.places), "place")}; write {USAGE}')
    if options.dry_run and not mapped:
        raise InvalidParameter(f'--dry-run prints what a mapping means; {options.data_set} has none, leave it out')
    for bag in _import_mapped(options) if mapped else importer(*options.places):
        print(bag)
    return 0


def _import_mapped(options: argparse.Namespace) -> list[Path]:
    mapping, source, out = options.places
    out = None if options.dry_run else out
    if out is not None and Path(source).resolve() in (Path(out).resolve(), *Path(out).resolve().parents):
        raise InvalidParameter(f"'{out}' lies in '{source}', among the files that are read; name a folder elsewhere")
    report = import_tables(load_mapping(mapping), source, out, MAPPED[options.data_set])
    for line in report.lines():
        print(line)
    stems = Counter(re.sub(r'[ _-]?\d+$', '', name) for name in report.slides)
    if numbered := [name for name in report.slides if stems[re.sub(r'[ _-]?\d+$', '', name)] > 1]:
        print(
            f'surfaces that differ by a number alone: {", ".join(numbered)}; if it belongs to no label, give it a '
            'separate field in `files` of the mapping, such as {material}_{run:d}'
        )
    return report.bags


def segment_bags(
    bags: BagPaths, out: Path, params: SegmentationParams, surface: str, namespace: str | None = None
) -> dict[Path, int]:
    """Copy bags with the slides found in their signals, or with a label for those that have none; return their numbers.

    All other messages are copied as they are. InvalidData if a bag has labelled slides, or no bag has a slide.
    """
    surface, paths = needed_label(surface), find_bags(bags)
    with new_folder(out):
        found = {
            out / path.name: _with_slides(path, out / path.name, params, surface, namespace)
            for path in progress(paths, 'segmenting bags', len(paths))
        }
        if not any(found.values()):
            raise InvalidData(
                f'no slide was found at a power of {params.on:g} times that of rest, longer than two ramps of '
                f'{params.ramp_s:g} s; {NO_SLIDE}'
            )
        return found


def _with_slides(path: Path, out: Path, params: SegmentationParams, surface: str, namespace: str | None) -> int:
    signals, explored = list[TactileSignal](), list[ExplorationState]()
    for topic, _, value in read_bag(path, (FAST_TOPIC, EXPLORATION), namespace):
        if topic == FAST_TOPIC:
            signals.append(value)
        elif value.phase is Phase.SLIDE and value.surface:
            raise InvalidData(
                f"the bag '{path}' has slides already, the first over '{value.surface}'; use it as it is, and give "
                'only bags without labelled slides here'
            )
        else:
            explored.append(value)
    if not signals:
        raise InvalidData(f"the bag '{path}' has no '{FAST_TOPIC}' to find slides in; also record the vibration")
    if any(state.phase is Phase.SLIDE for state in explored):
        states = [state for state in explored if state.exploration_id]
    else:
        states = segment_recording(signals, params, exploration_id=path.name)
    with BagWriter(out) as bag:
        prefix = ''
        for name, message in read_named(path, namespace):
            if name != EXPLORATION:
                bag.write_raw(message)
            if message.topic != '/diagnostics':
                prefix = message.topic.removesuffix(f'/{name}')
        for state in states:
            bag.write(f'{prefix}/{EXPLORATION}', replace(state, surface=surface), state.stamp_ns)
    return len({state.exploration_id for state in states if state.phase is Phase.SLIDE})


def _configure_segment(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('bags', nargs='+', help='bags, or folders of bags')
    parser.add_argument('--out', required=True, metavar='DIR', help='folder for the copies with the states found')
    parser.add_argument('--surface', required=True, metavar='NAME', help='label of all slides')
    add_bag_namespace(parser)
    add_parameters(parser, SegmentationParams)


def _segment(options: argparse.Namespace) -> int:
    """Write the copies, and name them with the number of their slides."""
    params = parameters_from(options, SegmentationParams)
    found = segment_bags(options.bags, Path(options.out), params, options.surface, options.namespace)
    for path, slides in found.items():
        print(f'{path}: {counted(slides, "slide")}' + f'; {NO_SLIDE}, or leave it out' * (not slides))
    return 0


def _configure_export(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('bags', nargs='+', help='bags, or folders of bags')
    parser.add_argument('-o', '--out', required=True, metavar='DIR', help='folder to make')
    add_bag_namespace(parser)
    add_slides(parser)


def _export(options: argparse.Namespace) -> int:
    """Write slides as Parquet."""
    dataset = SlideDataset.from_bags(options.bags, options.slides, options.namespace)
    with task(f"writing '{options.out}'"):
        lines = export_slides(dataset, options.out)
    print('\n'.join(lines))
    return 0


export = Command('write labelled slides as Parquet, a row for each sample', _configure_export, _export)
import_ = Command('convert third-party recordings into labelled bags', _configure_import, _import)
segment = Command(
    'find slides in bags without explorations, or label those without a surface', _configure_segment, _segment
)

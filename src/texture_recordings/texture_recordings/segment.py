# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Find the exploration states of a bag from its signals, for bags without them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from texture_core.cli import progress
from texture_core.errors import InvalidData
from texture_core.types import Phase, TactileSignal
from texture_features.segmentation import SegmentationParams, segment_recording
from texture_recordings.bags import EXPLORATION, BagPaths, BagWriter, find_bags, new_folder, read_bag, read_named

FAST_TOPIC = 'signal'


def segment_bags(
    bags: BagPaths, out: Path, params: SegmentationParams, surface: str, namespace: str | None = None
) -> dict[Path, int]:
    """Copy bags, their exploration states replaced by those found in the signals; return the slides in each copy.

    All other messages are copied as they are. InvalidData if a bag has slides already.
    """
    paths = find_bags(bags)
    with new_folder(out):
        return {
            out / path.name: _segment(path, out / path.name, params, surface, namespace)
            for path in progress(paths, 'segmenting bags', len(paths))
        }


def _segment(path: Path, out: Path, params: SegmentationParams, surface: str, namespace: str | None) -> int:
    signals: list[TactileSignal] = []
    for topic, _, value in read_bag(path, (FAST_TOPIC, EXPLORATION), namespace):
        if topic == FAST_TOPIC:
            signals.append(value)
        elif value.phase is Phase.SLIDE:
            raise InvalidData(
                f"the bag '{path}' has slides already, the first over '{value.surface}'; use it as it is, and give "
                'only bags without exploration states here'
            )
    if not signals:
        raise InvalidData(f"the bag '{path}' has no '{FAST_TOPIC}' to find slides in; also record the vibration")
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
    return sum(state.phase is Phase.SLIDE for state in states)

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Find the exploration states of a bag from its signals: for bags without them, or with wrong ones."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from texture_core.cli import progress
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import ExplorationState, Phase, TactileSignal
from texture_features.segmentation import SegmentationParams, segment_recording
from texture_recordings.bags import EXPLORATION, BagWriter, find_bags, read_bag, read_named

FAST_TOPIC = 'signal'


def segment_bags(
    bags: Iterable[str | Path], out: Path, params: SegmentationParams, surface: str = '', namespace: str | None = None
) -> dict[Path, int]:
    """Copy bags, their exploration states replaced by those found in the signals; return the slides in each copy.

    Surface, speed and force of a slide are those of the last state before its middle, if there is one. All other
    messages are copied as they are.
    """
    paths = find_bags(bags)
    if out.exists():
        raise InvalidParameter(f"'{out}' exists already; nothing is overwritten, name another folder or remove it")
    return {
        out / path.name: _segment(path, out / path.name, params, surface, namespace)
        for path in progress(paths, 'segmenting bags', len(paths))
    }


def _segment(path: Path, out: Path, params: SegmentationParams, surface: str, namespace: str | None) -> int:
    signals: list[TactileSignal] = []
    reported: list[ExplorationState] = []
    for topic, _, value in read_bag(path, (FAST_TOPIC, EXPLORATION), namespace):
        (reported if topic == EXPLORATION else signals).append(value)
    if not signals:
        raise InvalidData(f"the bag '{path}' has no '{FAST_TOPIC}' to find slides in; also record the vibration")
    found = segment_recording(signals, params, exploration_id=path.name)
    states = _labelled(found, sorted(reported, key=lambda state: state.stamp_ns), surface)
    with BagWriter(out) as bag:
        prefix = ''
        for name, message in read_named(path, namespace):
            if name != EXPLORATION:
                bag.write_raw(message)
            if message.topic != '/diagnostics':
                prefix = message.topic.removesuffix(f'/{name}')
        for state in states:
            bag.write(f'{prefix}/{EXPLORATION}', state, state.stamp_ns)
    return sum(state.phase is Phase.SLIDE for state in states)


def _labelled(
    found: Sequence[ExplorationState], reported: Sequence[ExplorationState], surface: str
) -> list[ExplorationState]:
    """Return the states found, with what was known of the motion at the middle of each slide."""
    states: list[ExplorationState] = []
    known = ExplorationState(0, '', '', Phase.IDLE)
    for state in found:
        middle_ns = state.stamp_ns + round(state.steady_s * 5e8)
        if state.phase is Phase.SLIDE:
            known = next((item for item in reversed(reported) if item.stamp_ns <= middle_ns), known)
        states.append(
            replace(
                state,
                surface=surface or known.surface,
                speed_m_s=known.speed_m_s,
                force_n=known.force_n,
                direction_rad=known.direction_rad,
            )
        )
    return states

"""Slides over the surfaces of a simulated scene, as labelled bags: no recording is needed, and any number is had."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.exploration import ExplorationState
from texture_core.parameters import param
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_recordings.bag_writer import BagWriter
from texture_simulation.offline import simulate_exploration
from texture_simulation.scene import Scene, load_scene

START_NS = 1_000_000_000 * NANOSECONDS
PAUSE_NS = NANOSECONDS
DELAY_NS = 100_000  # a batch is logged this long after its last sample, a state at its stamp
Logged = tuple[int, str, Any]


@dataclass(frozen=True)
class SlidePlan:
    """How each surface is explored."""

    slides: int = param(10, 'Sets the number of slides over each surface.', low=1, high=100_000)
    speed_m_s: float = param(
        0.1,
        'Sets the speed along the surface; a higher speed raises all frequencies of the signal.',
        unit='m/s',
        low=0.001,
        high=1.0,
    )
    force_n: float = param(
        2.0, 'Sets the normal force; a larger force gives a stronger signal.', unit='N', low=0.05, high=20.0
    )
    slide_s: float = param(3.0, 'Sets the duration of the steady part of a slide.', unit='s', low=0.1, high=600.0)
    direction_rad: float = param(
        0.0, 'Sets the direction of travel, from +x towards +y.', unit='rad', low=-10.0, high=10.0
    )
    fingers: int = param(
        1,
        "Sets the number of fingers that slide together; the topics of several are 'finger0/signal' and so on.",
        low=1,
        high=5,
    )


def write_simulated(
    out: str | Path,
    plan: SlidePlan,
    rng: np.random.Generator,
    scene: str = 'twelve_textures',
    surfaces: Sequence[str] = (),
) -> list[Path]:
    """Write one bag a surface, named after it, and return their paths.

    Parameters
    ----------
    out
        Folder for the bags; made if missing.
    plan
        How many slides, how fast, how hard and which way.
    rng
        Decides where the surfaces are touched, errors and noise.
    scene, surfaces
        Name or file of the scene, and which of its surfaces; all if none is named.

    Returns
    -------
    list of Path
        Of the bags.
    """
    table = load_scene(scene)
    chosen = [table.surface(name).name for name in surfaces] or list(table.surfaces)
    start_ns = START_NS
    for surface in chosen:
        start_ns = _write_surface(Path(out) / surface, table, plan, start_ns, rng)
    return [Path(out) / surface for surface in chosen]


def _write_surface(path: Path, scene: Scene, plan: SlidePlan, start_ns: int, rng: np.random.Generator) -> int:
    """Write the bag of one surface, named as the path; return when the next one may start."""
    first: dict[str, int] = {}
    with BagWriter(path) as bag:
        for number in range(1, plan.slides + 1):
            states, signals = _slide(scene, plan, start_ns, f'{path.name}/slide{number:02d}', rng)
            streams = {topic: _running_on(batches, first, topic) for topic, batches in signals.items()}
            for log_ns, topic, value in _in_order(states, streams):
                bag.write(topic, value, log_ns)
            start_ns = log_ns + PAUSE_NS
    return start_ns


def _slide(
    scene: Scene, plan: SlidePlan, start_ns: int, exploration_id: str, rng: np.random.Generator
) -> tuple[list[ExplorationState], dict[str, Iterable[TactileSignal]]]:
    """Return the states of a slide, and the signals of all its fingers by topic, each finger with traits of its own."""
    surface = exploration_id.rpartition('/')[0]
    signals: dict[str, Iterable[TactileSignal]] = {}
    for finger in reversed(range(plan.fingers)):
        states, of_finger = simulate_exploration(
            scene, surface, plan.speed_m_s, plan.force_n, plan.slide_s,
            start_ns=start_ns, exploration_id=exploration_id, rng=rng,
            direction_rad=plan.direction_rad, finger=finger,
        )  # fmt: skip
        prefix = f'finger{finger}/' if plan.fingers > 1 else ''
        signals |= {f'{prefix}{topic}': batches for topic, batches in of_finger.items()}
    return states, signals


def _running_on(batches: Iterable[TactileSignal], first: dict[str, int], topic: str) -> list[TactileSignal]:
    """Number the samples of a slide on from those of the slide before, as a driver does that is not restarted."""
    offset = first.get(topic, 0)
    moved = [replace(batch, first_sample=batch.first_sample + offset) for batch in batches]
    first[topic] = moved[-1].next_sample
    return moved


def _in_order(states: Iterable[Any], streams: dict[str, list[TactileSignal]]) -> Iterator[Logged]:
    tracks: list[Iterable[Logged]] = [[(state.stamp_ns, 'exploration', state) for state in states]]
    for topic, batches in streams.items():
        tracks.append([(batch.end_ns + DELAY_NS, topic, batch) for batch in batches])
    return heapq.merge(*tracks, key=lambda logged: logged[0])

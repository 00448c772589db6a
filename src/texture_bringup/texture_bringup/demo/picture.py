"""The picture of the demonstration: one recognised slide from touch to decision."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from texture_bringup.demo.slide_overview_chart import SlideOverview, picture
from texture_core.arrays import Array
from texture_core.estimates import TextureEstimate
from texture_core.exploration import ExplorationState, Phase
from texture_core.signal import TactileSignal
from texture_evaluation.evaluate import EvaluationReport
from texture_recordings.bags import read_bag


def draw(bag: Path, surface: str, report: EvaluationReport, source: str, path: Path, *, note: str = '') -> Path:
    """Draw an exploration of a surface, and the confusion of all explorations in the bag.

    Parameters
    ----------
    bag
        With the signal, the states and the live estimates.
    surface
        Of which surface: the exploration in which most was trained on the way.
    report
        Of the model on this bag.
    source
        Where the signal comes from, in words.
    note
        Lines below the panels.
    path
        File that is written.

    Returns
    -------
    Path
        Of the file.
    """
    states, estimates, batches = _gather(bag)
    candidates = [name for name in estimates if states[name][0].surface == surface]
    name = min(candidates, key=lambda each: _first_share(estimates[each]))
    samples, rate_hz, unit = _sliding_part(states[name], batches)
    others = {states[each][0].surface: _sliding_part(states[each], batches)[0] for each in estimates}
    del others[surface]
    overview = SlideOverview(
        source, surface, samples, rate_hz, unit, estimates[name], report.labels, report.confusion, others, note
    )
    return picture(overview, path)


def _first_share(estimates: Sequence[TextureEstimate]) -> float:
    """Return how probable the final label was at first."""
    return estimates[0].probabilities[estimates[0].labels.index(estimates[-1].label)]


def _gather(
    bag: Path,
) -> tuple[Mapping[str, list[ExplorationState]], Mapping[str, list[TextureEstimate]], list[TactileSignal]]:
    """Return the slide states and the estimates with evidence of each exploration, and all vibration batches."""
    states: defaultdict[str, list[ExplorationState]] = defaultdict(list)
    estimates: defaultdict[str, list[TextureEstimate]] = defaultdict(list)
    batches: list[TactileSignal] = []
    for _, _, value in read_bag(bag, ('exploration', 'signal', 'texture')):
        if isinstance(value, TactileSignal):
            batches.append(value)
        elif isinstance(value, TextureEstimate) and value.probabilities:
            estimates[value.exploration_id].append(value)
        elif isinstance(value, ExplorationState) and value.phase is Phase.SLIDE:
            states[value.exploration_id].append(value)
    return states, estimates, batches


def _sliding_part(states: Sequence[ExplorationState], batches: Sequence[TactileSignal]) -> tuple[Array, float, str]:
    """Return the samples while the finger slid, (n_samples,), with their rate and unit."""
    start_ns, end_ns = states[0].stamp_ns, states[-1].stamp_ns
    inside = [batch for batch in batches if start_ns <= batch.stamp_ns and batch.end_ns <= end_ns]
    samples: Array = np.concatenate([batch.samples[:, 0] for batch in inside]).astype(np.float64)
    return samples, inside[0].sampling_rate_hz, inside[0].common_unit

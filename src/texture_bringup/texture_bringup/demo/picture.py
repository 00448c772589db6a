"""The picture of the demonstration: one recognised slide from touch to decision."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from texture_bringup.demo.slide_overview_chart import GrowingEvidence, SlideOverview, picture
from texture_core.arrays import Array
from texture_core.estimates import TextureEstimate
from texture_core.exploration import ExplorationState, Phase
from texture_core.features import FeatureVector
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_estimation.classification.evidence_rules import running_means
from texture_estimation.model import TextureModel
from texture_evaluation.evaluate import EvaluationReport
from texture_recordings.bags import read_bag

SOURCE = 'simulated Robotiq TSF-85'


def draw(bag: Path, surface: str, model: TextureModel, report: EvaluationReport, path: Path, *, note: str = '') -> Path:
    """Draw an exploration of a surface, and the confusion of all explorations in the bag.

    Parameters
    ----------
    bag
        With the signal, the states, the features and the live estimates.
    surface
        Of which surface: the exploration in which the evidence was weakest at first.
    model
        That recognised the slides.
    report
        Of the model on this bag.
    path
        File that is written.
    note
        Lines below the panels.

    Returns
    -------
    Path
        Of the file.
    """
    found = _gather(bag)
    evidence = {name: _growing(model, found, name) for name in found.estimates}
    candidates = [name for name in evidence if found.states[name][0].surface == surface]
    name = min(candidates, key=lambda each: np.sort(evidence[each].log_odds[0])[1])
    samples, rate_hz, unit = _sliding_part(found.states[name], found.batches)
    others = {
        found.states[each][0].surface: _sliding_part(found.states[each], found.batches)[0] for each in found.estimates
    }
    del others[surface]
    overview = SlideOverview(
        SOURCE, surface, samples, rate_hz, unit, evidence[name], report.labels, report.confusion, others, note
    )
    return picture(overview, path)


@dataclass(frozen=True, eq=False)
class _Recorded:
    """What a bag holds: slide states, windows and the newest estimate of each exploration, all vibration batches."""

    states: defaultdict[str, list[ExplorationState]] = field(default_factory=lambda: defaultdict(list))
    windows: defaultdict[str, list[FeatureVector]] = field(default_factory=lambda: defaultdict(list))
    estimates: dict[str, TextureEstimate] = field(default_factory=dict)
    batches: list[TactileSignal] = field(default_factory=list)


def _growing(model: TextureModel, found: _Recorded, name: str) -> GrowingEvidence:
    """Return the evidence of one exploration after each of its windows, as the classifier has it."""
    windows, final, rule = found.windows[name], found.estimates[name], model.recipe.evidence
    scores = rule.window_evidence(model.predict_log_proba(np.array([window.values for window in windows])))
    length_s = windows[0].window_s
    seconds = length_s + np.array([window.start_ns - windows[0].start_ns for window in windows]) / NANOSECONDS
    effective = seconds / length_s
    means = running_means(rule, scores, effective)
    posterior = rule.log_posterior(means, effective[:, None], model.tempering_exponent)
    best = model.labels.index(final.label)
    return GrowingEvidence(final.label, seconds, model.labels, posterior[:, [best]] - posterior, final.confidence)


def _gather(bag: Path) -> _Recorded:
    """Return what the bag holds."""
    found = _Recorded()
    for _, _, value in read_bag(bag, ('exploration', 'signal', 'features', 'texture')):
        if isinstance(value, TactileSignal):
            found.batches.append(value)
        elif isinstance(value, FeatureVector) and not value.last:
            found.windows[value.exploration_id].append(value)
        elif isinstance(value, TextureEstimate) and value.probabilities:
            found.estimates[value.exploration_id] = value
        elif isinstance(value, ExplorationState) and value.phase is Phase.SLIDE:
            found.states[value.exploration_id].append(value)
    return found


def _sliding_part(states: Sequence[ExplorationState], batches: Sequence[TactileSignal]) -> tuple[Array, float, str]:
    """Return the samples while the finger slid, (n_samples,), with their rate and unit."""
    start_ns, end_ns = states[0].stamp_ns, states[-1].stamp_ns
    inside = [batch for batch in batches if start_ns <= batch.stamp_ns and batch.end_ns <= end_ns]
    samples: Array = np.concatenate([batch.samples[:, 0] for batch in inside]).astype(np.float64)
    return samples, inside[0].sampling_rate_hz, inside[0].common_unit

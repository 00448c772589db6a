"""How well the beginning and the end of sliding are found: simulated slides, whose phases are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from texture_core.exploration import ExplorationState, Phase
from texture_core.signal import NANOSECONDS, TactileSignal
from texture_features.segmentation.cell_power import baseline_power, cell_power
from texture_features.segmentation.segments import SegmentationParams
from texture_features.segmentation.slide_segmenter import segment_recording
from texture_simulation.offline import simulate_exploration
from texture_simulation.scene import Scene

FORCE_N = 2.0
# What the vibration channel of a sensor model measures; see
# `texture_features.segmentation.cell_power.MEASURED_QUANTITIES`.
MEASURED_QUANTITIES = {
    'tsf85': 'change',
    'tsf85_3x4': 'change',
    'biotac': 'force',
    'daq': 'force',
    'pvdf': 'force',
    'anyskin': 'force',
    'papillarray': 'force',
}


@dataclass(frozen=True)
class SegmentationTrial:
    """One simulated slide and what was found; errors in s, later is above 0, NaN if not exactly one slide was found.

    `strength` is the power of the true slide in that of the sensor's noise.
    """

    surface: str
    speed_m_s: float
    strength: float
    found: int
    start_error_s: float
    end_error_s: float


def try_slide(
    scene: Scene, surface: str, speed_m_s: float, slide_s: float, rng: np.random.Generator
) -> SegmentationTrial:
    """Return how well one slide is found from its signals alone.

    Parameters
    ----------
    scene
        Surfaces, sensor and effects.
    surface
        Name of the surface.
    speed_m_s
        Speed of the finger.
    slide_s
        Length of the steady part.
    rng
        Places, effects and noise.

    Returns
    -------
    SegmentationTrial
        Errors of start and end, s.
    """
    states, signals = simulate_exploration(
        scene, surface, speed_m_s, FORCE_N, slide_s, start_ns=0, exploration_id='trial', rng=rng
    )
    params = replace(SegmentationParams(), quantity=MEASURED_QUANTITIES[scene.sensor])
    found, true = _spans(segment_recording(signals, params)), _spans(states)[0]
    errors = [found[0][i] - true[i] for i in (0, 1)] if len(found) == 1 else [np.nan, np.nan]
    strength = _strength(signals['signal'], true, params.cell_s)
    return SegmentationTrial(surface, speed_m_s, strength, len(found), float(errors[0]), float(errors[1]))


def _spans(states: Sequence[ExplorationState]) -> list[tuple[float, float]]:
    """Return begin and end of each slide, s."""
    begun: dict[str, int] = {}
    ended: dict[str, int] = {}
    for state in states:
        if state.phase is Phase.SLIDE:
            begun.setdefault(state.exploration_id, state.stamp_ns)
        elif state.phase is Phase.LIFT:
            ended[state.exploration_id] = state.stamp_ns
    return [(begun[name] / NANOSECONDS, ended[name] / NANOSECONDS) for name in begun]


def _strength(batches: Sequence[TactileSignal], true: tuple[float, float], cell_s: float) -> float:
    samples = np.concatenate([batch.samples for batch in batches]).astype(np.float64)
    cell_s, powers = cell_power(samples, batches[0].sampling_rate_hz, cell_s)
    first, last = (round(at_s / cell_s) for at_s in true)
    return float(np.nanmean(powers[first:last] / baseline_power(powers)))

"""How well start and end of sliding are found from the signals alone, and what is found in recordings."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.segmentation.chart import DetectedSlides, error_strength_chart, found_chart
from texture_benchmarks.segmentation.trial import SegmentationTrial, try_slide
from texture_core.arrays import Samples
from texture_features.segmentation.cell_power import baseline_power, cell_power
from texture_features.segmentation.segments import SegmentationParams, find_sliding
from texture_recordings.bags import read_bag
from texture_recordings.importers.biotac20 import import_biotac20
from texture_simulation.scene import load_scene

SCENES = ('ets_linear', 'ets_circular', 'ets_fine', 'jamali', 'kaboli', 'hu', 'roughness')
SPEEDS_M_S = (0.05, 0.1, 0.15, 0.2)
REPEATS, SLIDE_S = 3, 1.0
TARGET_S = 0.02
STRONG, FAST_M_S = 10.0, 0.1
MATERIALS = ('material01', 'material02', 'material03', 'material09', 'material14', 'material20')
SHOWN_SLIDE = '5'
# At 20 mm/s most of the vibration lies below 20 Hz, and it comes in longer bursts.
SLOW_SMOOTH_S, SLOW_BRIDGE_S = 0.2, 0.5


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Find simulated slides, and some that were recorded."""
    rng = np.random.default_rng(options.seed)
    scenes, speeds = (SCENES[2:4], SPEEDS_M_S[2:3]) if options.quick else (SCENES, SPEEDS_M_S)
    trials = {name: _trials(name, speeds, 1 if options.quick else REPEATS, rng) for name in scenes}
    charts = [error_strength_chart(trials, TARGET_S, options.out / 'segmentation.png')]
    source = options.data / 'biotac20' if options.data else None
    if source is not None and source.is_dir():
        title = (
            f'BioTac, recorded slide {SHOWN_SLIDE} of {len(MATERIALS)} materials: PAC (counts) and the sliding found'
        )
        charts.append(found_chart(_recordings(source), title, options.out / 'segmentation_recorded.png'))
    everything = [trial for listed in trials.values() for trial in listed]
    return BenchmarkResult(
        name='segmentation',
        measured='share of slides found as exactly one, and errors of start and end of steady sliding against the true '
        f'phases, ms (median and 95 % of their sizes); strong: at least {STRONG:g} times the power of the noise',
        data=f'simulated slides of {SLIDE_S:g} s over all surfaces of {len(scenes)} scenes at {list(speeds)} m/s',
        split='none: nothing is trained; the plan (ramp, time to press) and the kind of sensor are known',
        numbers={
            'target_ms': 1000 * TARGET_S,
            'all': _numbers(everything),
            'strong': _numbers([trial for trial in everything if trial.strength >= STRONG]),
            f'strong, from {FAST_M_S:g} m/s on': _numbers(
                [trial for trial in everything if trial.strength >= STRONG and trial.speed_m_s >= FAST_M_S]
            ),
            'scenes': {
                name: {f'{speed:g} m/s': _numbers([t for t in listed if t.speed_m_s == speed]) for speed in speeds}
                for name, listed in trials.items()
            },
        },
        charts=tuple(charts),
    )


def _trials(name: str, speeds: Sequence[float], repeats: int, rng: np.random.Generator) -> list[SegmentationTrial]:
    scene = load_scene(name)
    return [
        try_slide(scene, surface, speed, SLIDE_S, rng)
        for speed in speeds
        for surface in scene.surfaces
        for _ in range(repeats)
    ]


def _numbers(trials: Sequence[SegmentationTrial]) -> Mapping[str, Any]:
    once = [trial for trial in trials if trial.found == 1]
    numbers: dict[str, Any] = {'slides': len(trials), 'found': round(len(once) / max(len(trials), 1), 3)}
    for name in ('start', 'end'):
        errors = 1000 * np.array([getattr(trial, f'{name}_error_s') for trial in once])
        if len(errors):
            median, most = np.percentile(np.abs(errors), (50, 95))
            numbers[f'{name}_ms'] = {'median': round(float(median), 1), '95 %': round(float(most), 1)}
    return numbers


def _recordings(source: Path) -> dict[str, DetectedSlides]:
    """Return one recorded slide of some materials.

    They lie in contact from end to end: the load tells nothing, and the noise is taken from the quietest of them.
    """
    with tempfile.TemporaryDirectory() as folder:
        bags = import_biotac20(source, Path(folder), slides=SHOWN_SLIDE, materials=MATERIALS)
        signals = {bag.name: _vibration(bag) for bag in bags}
    params = SegmentationParams(quantity='force', smooth_s=SLOW_SMOOTH_S, max_gap_s=SLOW_BRIDGE_S)
    rest = min(
        (baseline_power(cell_power(*signal, params.cell_s, params.smooth_s)[1]) for signal in signals.values()),
        key=lambda power: float(power.sum()),
    )
    found = {}
    for name, (fast, rate_hz) in signals.items():
        spans = find_sliding(fast, rate_hz, params, rest=rest)
        found[name] = DetectedSlides(fast[:, 0], rate_hz, [(span.start_s, span.end_s) for span in spans])
    return found


def _vibration(bag: Path) -> tuple[Samples, float]:
    batches = [value for _, _, value in read_bag(bag, ('signal',))]
    return np.concatenate([batch.samples for batch in batches]).astype(np.float64), batches[0].sampling_rate_hz

"""Recognition at held-out speeds, forces and directions, on two recorded taxel arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from texture_benchmarks.imported_data import imported
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.speed_force.chart import held_out_chart, spectra_chart, window_chart
from texture_benchmarks.speed_force.fabricslide import COMPLETE, Fabricslide
from texture_benchmarks.speed_force.held_out import HeldOutResult
from texture_benchmarks.speed_force.ntp21 import TRAINED, Ntp21
from texture_estimation.learners.svm_rbf import SvmRbf
from texture_recordings.slide_dataset import SlideDataset

GOALS = {
    'ntp21': {'one speed out': 0.96, 'one force out': 0.98, 'slow to fast': 0.85},
    'fabricslide': {'one force out': 0.90, 'one speed out': 0.98, 'one direction out': 0.92},
}
WINDOW_GOAL = 0.85
MEASURED = 'all distances, speed measured'
SHOWN = 'texture12'  # whose spectra are drawn
QUICK_TEXTURES = ('texture03', SHOWN)
QUICK_SLIDES = '1-3,5-7,9-11,13-15'  # three forces of each speed
# Three fast speeds at three forces, down and up, once each.
QUICK_RUNS = ','.join(f'{force + run}' for force in (0, 24, 48, 60, 84, 108) for run in (7, 9, 11))
QUICK_TRAINED = ('same distance',)
QUICK_NTP21: Mapping[str, Any] = {'learner': SvmRbf(folds=2), 'candidates': [(16, 1e-7), (32, 1e-7)]}
QUICK_FABRICSLIDE: Mapping[str, Any] = {'learner': SvmRbf(folds=2, common_scale=True), 'energies': (0.0, 0.9)}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Leave out speeds, forces and directions of both data sets."""
    slides, surfaces = (QUICK_SLIDES, QUICK_TEXTURES) if options.quick else ('', ())
    with imported(options, 'ntp21', slides, surfaces) as textures:
        ntp21 = Ntp21(
            SlideDataset.from_bags(textures, topics=['signal']),
            **(QUICK_NTP21 if options.quick else {}),
        )
    with imported(options, 'fabricslide', QUICK_RUNS if options.quick else '', COMPLETE) as fabrics:
        fabricslide = Fabricslide(
            SlideDataset.from_bags(fabrics),
            **(QUICK_FABRICSLIDE if options.quick else {}),
        )
    estimated, speed_errors = ntp21.whole_without_speed()
    textures_known = {
        'taxel average, waves per metre': ntp21.whole(),
        'the same, speed measured by the array': estimated,
        'each taxel by itself': ntp21.whole_with_pattern(),
        'taxel average, waves per second': ntp21.whole_over_time(),
    }
    windows = {trained: ntp21.windows(trained) for trained in (QUICK_TRAINED if options.quick else TRAINED)}
    windows[MEASURED], window_errors = ntp21.windows_without_speed()
    fabrics_known = {
        'shares of the load, turn taken out': fabricslide.loads(),
        'shares of the load': fabricslide.loads_as_they_are(),
        'taxel average, waves per metre': fabricslide.bands(),
    }
    panels = {
        f'{_count(ntp21.dataset)} textures, 9 taxels (ntp21)': (textures_known, GOALS['ntp21']),
        f'{_count(fabricslide.dataset)} fabrics, 16 slow taxels (fabricslide)': (
            fabrics_known,
            GOALS['fabricslide'],
        ),
    }
    shown = [slide for slide in ntp21.samples if slide.surface == SHOWN]
    return BenchmarkResult(
        name='speed_force',
        measured='share recognised; mean over what is left out in turn',
        data='ntp21: MEMS array of 9 taxels at 320 Hz, one slide for each of 4 speeds and 4 forces; '
        'fabricslide: 16 capacitive taxels at 35.7 Hz, 5 forces, 6 speeds, 2 directions, 2 repeats; both recorded',
        split='each speed, force or direction left out in turn; slow to fast: 20-60 mm/s trained, 100 mm/s tested; '
        'what is chosen is chosen by leaving conditions out within the training',
        numbers={
            'goals': {**GOALS, 'ntp21 windows': WINDOW_GOAL},
            'ntp21': {'whole': _numbers(textures_known), 'windows': {k: v.numbers() for k, v in windows.items()}},
            'speed_felt': {'whole': speed_errors, 'windows_median_error': window_errors},
            'fabricslide': _numbers(fabrics_known),
        },
        charts=(
            held_out_chart(panels, options.out / 'speed_force.png'),
            window_chart(windows, WINDOW_GOAL, options.out / 'speed_force_windows.png'),
            spectra_chart(shown, options.out / 'speed_force_spectra.png'),
        ),
    )


def _count(dataset: SlideDataset) -> int:
    return len(set(dataset.labels))


def _numbers(methods: Mapping[str, Mapping[str, HeldOutResult]]) -> Mapping[str, Any]:
    return {
        method: {name: outcome.numbers() for name, outcome in outcomes.items()} for method, outcomes in methods.items()
    }

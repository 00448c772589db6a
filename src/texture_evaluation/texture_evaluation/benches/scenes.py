"""What simulated scenes cost, and what each of their terms is worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from texture_evaluation.ablation import CONFIDENCE, TOUCHINGS, Ablation, Difference, ablate, completed, timed
from texture_evaluation.ablation_charts import ablation_chart, cost_chart
from texture_evaluation.benches.result import Bench, BenchResult
from texture_evaluation.scene_costs import MANY, SCAN_S, Load, ScanCost, live_load, scan_cost, stuck_surfaces
from texture_simulation.scene import load_scene

TARGET_MS = {False: 1.0, True: 10.0}  # without and with stick-slip
TARGET_CPU = 0.25
FEWER = 5
# Of each kind of sensor, and of stick-slip, a surface for the emulated device.
DRIVEN: Mapping[str, str] = {
    'bench': 'ridge_2mm_deep',
    'ets_linear': 'ridge_2a',
    'jamali': 'carpet_1',
    'kaboli': 'rough_star',
    'hu': 'linen_1',
    'sticky': 'dry_glass',
}


@dataclass(frozen=True)
class Size:
    """How much is measured."""

    scenes: tuple[str, ...] = tuple(TOUCHINGS)
    slides: int = 240
    repeats: int = 5
    scan_repeats: int = 15
    many: int = MANY
    live_s: float = 5.0
    timed: int = 10
    timed_repeats: int = 7


WHOLE = Size()
QUICK = Size(
    ('ets_linear', 'sticky'), slides=32, repeats=2, scan_repeats=2, many=10, live_s=0.5, timed=4, timed_repeats=1
)


def run(bench: Bench) -> BenchResult:
    """Time slides and emulated devices, and remove each term of each scene in turn."""
    size = QUICK if bench.quick else WHOLE
    costs = _costs(size)
    loads = {name: live_load(name, surface, size.live_s) for name, surface in DRIVEN.items() if name in size.scenes}
    ablations = [_ablation(name, size, bench.seed) for name in size.scenes]
    return report(bench, size, costs, loads, ablations)


def report(
    bench: Bench,
    size: Size,
    costs: Mapping[tuple[str, bool], ScanCost],
    loads: Mapping[str, Load],
    ablations: Sequence[Ablation],
) -> BenchResult:
    """Draw what was measured and return it."""
    charts = (
        cost_chart(costs, TARGET_MS, loads, TARGET_CPU, bench.out / 'scenes_cost.png'),
        ablation_chart(ablations, bench.out / 'scenes_ablation.png'),
    )
    return BenchResult(
        name='scenes',
        measured=f'ms of computing for a slide of {SCAN_S} s with all channels, alone and as one of {size.many} at '
        'once, median over surfaces; computing time of emulated devices in real time, in share of one core, with '
        'moving the finger and reading the line; accuracy of a linear discriminant (shrunk covariance) on the '
        'logarithm of 24 bands of the spectrum of each channel, with and without each term',
        data='simulated scenes; slides of 2 and 3 s are cut to 1 s; terms that left a scene are put back for it',
        split=f'{size.slides} slides learnt, others tested, {size.repeats} times anew; intervals of {CONFIDENCE:.0%}',
        numbers={
            'target_ms': {'without stick-slip': TARGET_MS[False], 'with': TARGET_MS[True]},
            'scan_ms': {_kind(*key): asdict(cost) for key, cost in costs.items()},
            'target_cpu': TARGET_CPU,
            'live': {name: asdict(load) for name, load in loads.items()},
            'terms': {ablation.scene: _terms(ablation) for ablation in ablations},
        },
        charts=charts,
    )


def _costs(size: Size) -> dict[tuple[str, bool], ScanCost]:
    """Return the costs by scene and whether the skin sticks and slips."""
    costs = {}
    for name in size.scenes:
        scene = load_scene(name)
        for sticks, surfaces in stuck_surfaces(scene).items():
            if surfaces:
                costs[name, sticks] = scan_cost(scene, surfaces, size.scan_repeats, size.many)
    return costs


def _ablation(name: str, size: Size, seed: int) -> Ablation:
    touching = TOUCHINGS[name]
    scene = completed(load_scene(name), touching)
    # Stick-slip costs ten times as much, and decides so clearly that few slides will do.
    slides = size.slides // FEWER if stuck_surfaces(scene)[True] else size.slides
    done = ablate(scene, touching, slides, size.repeats, seed)
    return timed(done, scene, touching, size.timed, size.timed_repeats)


def _kind(name: str, sticks: bool) -> str:
    return f'{name}, stick-slip' if sticks else name


def _terms(ablation: Ablation) -> dict[str, Any]:
    worths = {
        worth.term: {
            'accuracy_without': _numbers(worth.easier),
            'accuracy_learnt_without': _numbers(worth.unprepared),
            'decisions_changed': _numbers(worth.changed),
            'time_share': round(worth.time_share, 3),
            'idle': worth.idle,
        }
        for worth in ablation.worths
    }
    return {'accuracy': round(ablation.accuracy, 4), 'tested': ablation.tested, **worths}


def _numbers(difference: Difference) -> dict[str, float]:
    return {'change': round(difference.mean, 4), 'half_interval': round(difference.half, 4)}

"""What simulated scenes cost, and what each of their terms contributes."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.scenes.chart import ablation_chart, cost_chart
from texture_benchmarks.scenes.costs import MANY, SCAN_S, DeviceLoad, ScanCost, live_load, scan_cost, stuck_surfaces
from texture_benchmarks.scenes.paper_ablation import with_paper
from texture_benchmarks.scenes.tables import added_table, cost_table, term_table
from texture_benchmarks.scenes.touch_protocols import HOST, TOUCH_PROTOCOLS, completed, with_one_more
from texture_benchmarks.scenes.trial import CONFIDENCE, Ablation, MeanDifference, TermEffect, ablate, timed
from texture_simulation.effects.catalogue import EFFECTS
from texture_simulation.scene import Scene, load_scene

TARGET_MS = {False: 1.0, True: 10.0}  # without and with stick-slip
TARGET_CPU = 0.25
# Dear scenes are measured less often: stick-slip costs ten times as much, eight channels five times.
FEWER: Mapping[str, int] = {'sticky': 5, 'jamali': 3}
# Of each kind of sensor, and of stick-slip, a surface for the emulated device.
DRIVEN: Mapping[str, str] = {
    'twelve_textures': 'ridge_2mm_deep',
    'ets_linear': 'ridge_2a',
    'jamali': 'carpet_1',
    'kaboli': 'rough_star',
    'hu': 'linen_1',
    'sticky': 'dry_glass',
}
Costs = Mapping[tuple[str, bool], ScanCost]  # by scene, and whether the skin sticks and slips
Weighed = tuple[Sequence[Ablation], Sequence[Ablation]]  # the terms of the scenes, and what none of them names


@dataclass(frozen=True)
class SceneBenchmarkSize:
    """How much is measured."""

    scenes: tuple[str, ...] = tuple(TOUCH_PROTOCOLS)
    slides: int = 240
    repeats: int = 5
    paper_repeats: int = 3
    scan_repeats: int = 15
    many: int = MANY
    live_s: float = 4.0
    timed: int = 10
    timed_repeats: int = 5


WHOLE = SceneBenchmarkSize()
QUICK = SceneBenchmarkSize(
    ('ets_linear', 'sticky'),
    slides=32,
    repeats=2,
    paper_repeats=1,
    scan_repeats=2,
    many=10,
    live_s=0.5,
    timed=4,
    timed_repeats=1,
)


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Time slides and emulated devices, remove each term of each scene in turn, and add what none of them names."""
    size = QUICK if options.quick else WHOLE
    costs = _costs(size)
    loads = {name: live_load(name, surface, size.live_s) for name, surface in DRIVEN.items() if name in size.scenes}
    ablations = [
        with_paper(_ablation(name, size, options.seed), size.paper_repeats, 1000 + options.seed, quick=options.quick)
        for name in size.scenes
    ]
    return _report(options, size, costs, loads, (ablations, _added(size, options.seed)))


def _report(
    options: BenchmarkOptions, size: SceneBenchmarkSize, costs: Costs, loads: Mapping[str, DeviceLoad], weighed: Weighed
) -> BenchmarkResult:
    """Draw what was measured, write it as tables, and return it."""
    ablations, added = weighed
    charts = (
        cost_chart(costs, TARGET_MS, loads, TARGET_CPU, options.out / 'scenes_cost.png'),
        ablation_chart([*ablations, _together(added)], options.out / 'scenes_ablation.png'),
    )
    tables = (cost_table(costs, TARGET_MS, loads), added_table(added), term_table(ablations))
    (options.out / 'scenes.md').write_text('\n'.join(tables), encoding='utf-8')
    return BenchmarkResult(
        name='scenes',
        measured=f'ms of computing for a slide of {SCAN_S} s with all channels, alone and as one of {size.many} at '
        'once, median over surfaces; computing time of emulated devices in real time, in share of one core, with '
        'moving the finger and reading the line; accuracy of a linear discriminant (shrunk covariance) on the '
        'logarithm of 24 bands of the spectrum of each channel, with and without each term; the effects that no scene '
        f"names are put into '{HOST}' one at a time, as strong as the catalogue has them",
        data='simulated scenes; slides of 2 and 3 s are cut to 1 s; terms that left a scene are put back for it',
        split=f'{size.slides} slides for training (jamali a third, sticky a fifth), others for test, '
        f"{size.repeats} repetitions; the papers' methods on "
        f'{size.paper_repeats} sets of slides as many as in the paper; '
        f'intervals of {CONFIDENCE:.0%}',
        numbers={
            'target_ms': {'without stick-slip': TARGET_MS[False], 'with': TARGET_MS[True]},
            'scan_ms': {_kind(*key): asdict(cost) for key, cost in costs.items()},
            'target_cpu': TARGET_CPU,
            'live': {name: asdict(load) for name, load in loads.items()},
            'terms': {ablation.scene: _terms(ablation) for ablation in ablations},
            'added': {
                term_effect.term: {'strength': asdict(EFFECTS[term_effect.term]()), **_terms(ablation)}
                for ablation in added
                for term_effect in ablation.term_effects
            },
        },
        charts=charts,
    )


def _costs(size: SceneBenchmarkSize) -> dict[tuple[str, bool], ScanCost]:
    """Return the costs by scene and whether the skin sticks and slips."""
    costs = {}
    for name in size.scenes:
        scene = load_scene(name)
        for sticks, surfaces in stuck_surfaces(scene).items():
            if surfaces:
                costs[name, sticks] = scan_cost(scene, surfaces, size.scan_repeats, size.many)
    return costs


def _ablation(name: str, size: SceneBenchmarkSize, seed: int) -> Ablation:
    return _weighed(completed(load_scene(name), TOUCH_PROTOCOLS[name]), size, seed)


def _added(size: SceneBenchmarkSize, seed: int) -> list[Ablation]:
    """Return the influence of each effect that no scene names, in a scene that has no other of them."""
    return [_weighed(scene, size, seed, (name,)) for name, scene in with_one_more(load_scene(HOST)).items()]


def _weighed(scene: Scene, size: SceneBenchmarkSize, seed: int, terms: Sequence[str] = ()) -> Ablation:
    touch_protocol = TOUCH_PROTOCOLS[scene.name]
    slides = size.slides // FEWER.get(scene.name, 1)
    done = ablate(scene, touch_protocol, slides, size.repeats, seed, terms=terms)
    return timed(done, scene, touch_protocol, size.timed, size.timed_repeats)


def _together(added: Sequence[Ablation]) -> Ablation:
    """Return scenes with one more effect each as one: accuracy and time are those without any of them."""
    term_effects = list(itertools.chain.from_iterable(ablation.term_effects for ablation in added))
    pairs = list(zip(added, term_effects, strict=True))
    return Ablation(
        f'{HOST}, with one of',
        float(np.mean([ablation.accuracy + term_effect.easier.mean for ablation, term_effect in pairs])),
        added[0].tested,
        term_effects,
        float(np.median([ablation.slide_us - term_effect.cost_us for ablation, term_effect in pairs])),
    )


def _kind(name: str, sticks: bool) -> str:
    return f'{name}, stick-slip' if sticks else name


def _terms(ablation: Ablation) -> dict[str, Any]:
    term_effects = {term_effect.term: _effect(term_effect) for term_effect in ablation.term_effects}
    whole = {'accuracy': round(ablation.accuracy, 4), 'tested': ablation.tested, 'slide_us': round(ablation.slide_us)}
    paper = {'paper_accuracy': round(ablation.paper, 4)} if ablation.paper is not None else {}
    return {**whole, **paper, **term_effects}


def _effect(effect: TermEffect) -> dict[str, Any]:
    return {
        'accuracy_without': _numbers(effect.easier),
        'accuracy_trained_without': _numbers(effect.unprepared),
        'decisions_changed': _numbers(effect.changed),
        **({'paper_without': _numbers(effect.paper)} if effect.paper else {}),
        'cost_us': round(effect.cost_us, 1),
        'verdict': effect.verdict,
    }


def _numbers(difference: MeanDifference) -> dict[str, float]:
    return {'change': round(difference.mean, 4), 'half_interval': round(difference.half, 4)}

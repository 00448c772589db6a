# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What simulated scenes cost, and what each of their terms contributes to recognition."""

from __future__ import annotations

import itertools
import math
import time
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult
from texture_core.types import Array, Samples
from texture_evaluation.charts import COLOURS, chart
from texture_papers import jamali_experiment, roberge_experiment
from texture_papers.protocol import Interval, PaperProtocol, folds, halves, mean_over_seeds, of_task
from texture_simulation.effects import FingerSpread, ForceGain, PatchGrowth, SlideError, Unevenness
from texture_simulation.offline import simulate_slide_streams
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import Contact, Scene, load_scene
from texture_simulation.sensor_models import SENSORS
from texture_simulation.surfaces import MIN_BLUR_M

PATCH = 'patch filter'
FRICTION = 'friction'


@dataclass(frozen=True)
class TouchProtocol:
    """How the surfaces of a scene are touched, as in its experiment."""

    # speeds_m_s, forces_n, directions_rad: every combination is met equally often
    speeds_m_s: Sequence[float]
    forces_n: Sequence[float]
    directions_rad: Sequence[float] = (0.0,)
    # duration_s, radius_m: of each slide
    duration_s: float = 0.5
    radius_m: float = 0.0
    # A surface is measured once in each of these directions, and all are evaluated together
    turned_rad: Sequence[float] = (0.0,)
    slow: bool = False  # Whether the slow channels are also used
    tested_forces_n: Sequence[float] = ()  # Other forces for the test; as in learning if empty
    # training_by, tested_by: individuals of the sensor
    training_by: Sequence[int] = (0,)
    tested_by: Sequence[int] = (0,)


RIGHT = np.pi / 2
# The papers' conditions; slides of 2 and 3 s are cut to 1 s. On the bench, one learns as the demo does, and then
# presses as one likes.
TOUCH_PROTOCOLS: Mapping[str, TouchProtocol] = {
    'twelve_textures': TouchProtocol((0.1,), (2.0,), tested_forces_n=(0.5, 2.0, 5.0)),
    'ets_linear': TouchProtocol((0.10, 0.15, 0.20), (1.0, 2.5, 5.0)),
    'ets_circular': TouchProtocol((0.1,), (2.5,), (RIGHT, np.pi / 3, np.pi / 4, 0.0), radius_m=0.02),
    'ets_fine': TouchProtocol((0.125,), (2.0,), duration_s=0.8),
    'roughness': TouchProtocol((0.10, 0.15, 0.20), (1.0, 2.5, 5.0), duration_s=0.7),
    'jamali': TouchProtocol((0.05,), (1.0,), duration_s=1.0),
    'kaboli': TouchProtocol((0.05,), (1.0,), duration_s=1.0, slow=True, training_by=(1, 2), tested_by=(0, 1)),
    'hu': TouchProtocol((0.0255,), (1.5,), duration_s=1.0, turned_rad=(0.0, RIGHT)),
    'sticky': TouchProtocol((0.02, 0.05), (1.0, 2.0)),
}
# Effects that left the scenes because they change no decision there; they are put back to be measured.
REMOVED_EFFECTS: Mapping[str, Mapping[str, Any]] = {
    'twelve_textures': {'slide_error': SlideError(0.01, 0.04), 'unevenness': Unevenness(0.15)},
    'ets_circular': {'patch_growth': PatchGrowth(), 'force_gain': ForceGain(), 'unevenness': Unevenness(0.15)},
    'ets_fine': {'patch_growth': PatchGrowth(), 'force_gain': ForceGain(), 'unevenness': Unevenness(0.1)},
    'jamali': {'patch_growth': PatchGrowth()},
    'kaboli': {
        'patch_growth': PatchGrowth(),
        'force_gain': ForceGain(),
        'finger_spread': FingerSpread(0.05),
        'unevenness': Unevenness(0.15),
    },
    'hu': {
        'patch_growth': PatchGrowth(),
        'force_gain': ForceGain(),
        'slide_error': SlideError(0.005, 0.03),
        'unevenness': Unevenness(0.2),
    },
    'sticky': {'patch_growth': PatchGrowth(), 'unevenness': Unevenness(0.1)},
}


def completed(scene: Scene, touch_protocol: TouchProtocol) -> Scene:
    """Return a scene with what has left it for changing no decision (`REMOVED_EFFECTS`)."""
    for name, effect in REMOVED_EFFECTS.get(scene.name, {}).items():
        contact = _grown(scene.contact, effect, touch_protocol, -1)
        scene = replace(scene, effects={**scene.effects, name: effect}, contact=contact)
    return scene


def variants(scene: Scene, touch_protocol: TouchProtocol) -> dict[str, Scene]:
    """Return the scene without each of its effects, with a contact of a point, and without friction.

    What grows with the force stays as large as at the mean force: a term that only sets a constant is none.
    """
    made = {
        name: replace(_without(scene, name), contact=_grown(scene.contact, effect, touch_protocol, 1))
        for name, effect in scene.effects.items()
    }
    made[PATCH] = replace(scene, contact=replace(scene.contact, blur_m=MIN_BLUR_M))
    if any(surface.friction for surface in scene.surfaces.values()):
        bare = {name: replace(surface, friction=None) for name, surface in scene.surfaces.items()}
        made[FRICTION] = replace(scene, surfaces=bare)
    return made


def _without(scene: Scene, name: str) -> Scene:
    """Return a scene without an effect; what else is random stays as it was, so that slides are compared one by one."""
    if isinstance(scene.effects[name], SlideError):
        return replace(scene, effects={**scene.effects, name: SlideError(0.0, 0.0)})  # it still draws its numbers
    return scene.without(name)


def _grown(contact: Contact, effect: Any, touch_protocol: TouchProtocol, sign: int) -> Contact:
    """Return the contact with the growth of an effect at the mean force in it (sign 1), or taken out of it (-1)."""
    force_n = np.array([np.mean(touch_protocol.forces_n)])
    if isinstance(effect, PatchGrowth):
        return replace(contact, blur_m=contact.blur_m * float(effect.blur_growth(force_n)[0]) ** sign)
    if isinstance(effect, ForceGain):
        return replace(contact, stiffness_n_m=contact.stiffness_n_m * float(effect.gain_growth(force_n)[0]) ** sign)
    return contact


BANDS = 24  # of the spectrum, each of equal width on a logarithmic scale
LOWEST_HZ = 5.0
MIN_POWER = 1e-12


def ablate(
    scene: Scene, others: Mapping[str, Scene], touch_protocol: TouchProtocol, slides: int, *, repeats: int, seed: int
) -> dict[str, Any]:
    """Return the accuracy on a scene, and how it changes with each other scene, which lacks a term or has one more.

    About this many slides are trained on, and as many tested; all is repeated with other random numbers. By term,
    'accuracy_without' is the change when training and test have the other scene, 'accuracy_trained_without' that when
    only the training has it.
    """
    count = max(2, round(slides / len(scene.surfaces)))
    pressed = replace(touch_protocol, forces_n=touch_protocol.tested_forces_n or touch_protocol.forces_n)

    def learned(of: Scene, number: int) -> Any:
        each = max(1, count // len(touch_protocol.training_by))
        examples = simulate_features(of, touch_protocol, each, [seed, number, 0], touch_protocol.training_by)
        learner = LinearDiscriminantAnalysis(solver='lsqr', shrinkage='auto')
        return make_pipeline(StandardScaler(), learner).fit(*examples)

    def tested(of: Scene, number: int) -> tuple[Array, NDArray[np.intp]]:
        each = max(1, count // len(touch_protocol.tested_by))
        return simulate_features(of, pressed, each, [seed, number, 2], touch_protocol.tested_by)

    right: list[float] = []
    changes: dict[str, tuple[list[float], list[float]]] = {term: ([], []) for term in others}
    for number in range(repeats):
        test = tested(scene, number)
        right.append(float(learned(scene, number).score(*test)))
        for term, other in others.items():
            learner = learned(other, number)
            changes[term][0].append(learner.score(*tested(other, number)) - right[-1])
            changes[term][1].append(learner.score(*test) - right[-1])
    return {
        'accuracy': round(float(np.mean(right)), 4),
        'tested': repeats * len(test[1]),
        **{
            term: {'accuracy_without': difference(both), 'accuracy_trained_without': difference(trained)}
            for term, (both, trained) in changes.items()
        },
    }


def simulate_features(
    scene: Scene, touch_protocol: TouchProtocol, count: int, seed: Sequence[int], fingers: Sequence[int]
) -> tuple[Array, NDArray[np.intp]]:
    """Return features (n, n_features) and surfaces (n,) of `count` slides over each, by each finger in turn."""
    fast, *others = SENSORS[scene.sensor].streams
    # Slides that meet all conditions in turn.
    conditions = itertools.product(touch_protocol.speeds_m_s, touch_protocol.forces_n, touch_protocol.directions_rad)
    rows = np.array(list(itertools.islice(itertools.cycle(conditions), count)))
    values, codes = [], []
    for (code, surface), finger in itertools.product(enumerate(scene.surfaces), fingers):
        rng = np.random.default_rng([*seed, finger, zlib.crc32(surface.encode())])
        parts = []
        for turned_rad in touch_protocol.turned_rad:
            sliding = SimulatedSlide(
                rows[:, 0], rows[:, 1], touch_protocol.duration_s, rows[:, 2] + turned_rad, touch_protocol.radius_m
            )
            slow = touch_protocol.slow
            measured = simulate_slide_streams(scene, surface, count, sliding, rng, finger=finger, slow=slow)
            parts.append(extract_features(measured[fast.topic], fast.rate_hz))
            for stream in others if slow else ():
                parts += [measured[stream.topic].mean(axis=1), np.log10(measured[stream.topic].std(axis=1) + 1.0)]
        values.append(np.concatenate(parts, axis=1))
        codes += [code] * count
    return np.concatenate(values), np.array(codes)


def extract_features(samples: Samples, rate_hz: float) -> Array:
    """Return the logarithm of the power in bands of each channel, (n, n_channels · BANDS)."""
    n_samples = samples.shape[1]
    spectrum = np.fft.rfft(samples * np.hanning(n_samples)[:, None], axis=1)
    edges_hz = np.geomspace(LOWEST_HZ, rate_hz / 2, BANDS + 1)
    edges = np.searchsorted(np.fft.rfftfreq(n_samples, 1 / rate_hz), edges_hz)
    # Below, bands may be narrower than a bin: such a band takes the bin it lies in.
    starts, ends = edges[:-1], np.maximum(edges[1:], edges[:-1] + 1)
    total = np.concatenate([np.zeros_like(samples[:, :1]), np.cumsum(np.abs(spectrum) ** 2, axis=1)], axis=1)
    ends = np.minimum(ends, total.shape[1] - 1)
    power = (total[:, ends] - total[:, np.minimum(starts, ends - 1)]) / n_samples
    return np.asarray(np.log10(np.maximum(power, 0.0) + MIN_POWER).reshape(len(samples), -1), dtype=np.float64)


def difference(values: Sequence[float]) -> dict[str, float]:
    """Return the mean of differences, one of each repetition, and the half of its interval."""
    found = mean_over_seeds(values) if len(values) > 1 else Interval(values[0], -math.inf, math.inf)
    return {'change': round(found.value, 4), 'half_interval': round(found.high - found.value, 4)}


SCAN_S = 0.5
SLIDE = SimulatedSlide(0.1, 2.0, SCAN_S)


def scan_cost(scene: Scene, surfaces: Sequence[str], repeats: int, many: int) -> dict[str, float]:
    """Return the ms of computing for a slide of 0.5 s with all channels; `repeats` is that of single slides.

    Medians over surfaces, of one slide at a time and of each of many at once.
    """
    alone = [_scan_ms(scene, name, 1, repeats) for name in surfaces]
    together = [_scan_ms(scene, name, many, max(1, repeats // 5)) for name in surfaces]
    return {'alone_ms': float(np.median(alone)), 'together_ms': float(np.median(together))}


def _scan_ms(scene: Scene, surface: str, count: int, repeats: int) -> float:
    """Return the median computing time of one of `count` slides at once."""
    rng = np.random.default_rng(0)
    simulate_slide_streams(scene, surface, 1, SLIDE, rng)  # makes what is made once: tiles of random relief
    times = []
    for _ in range(repeats):
        began = time.thread_time()
        simulate_slide_streams(scene, surface, count, SLIDE, rng)
        times.append(time.thread_time() - began)
    return 1000 * float(np.median(times)) / count


# Scenes in which the quick learner is too good, or too bad, to see all that the paper's method sees: the experiment,
# its slides divided less often than there, and the method by which the scene was set.
PAPERS: Mapping[str, tuple[PaperProtocol, str]] = {
    'ets_linear': (replace(roberge_experiment.LINEAR, divide=halves(4)), roberge_experiment.SVM),
    'jamali': (replace(jamali_experiment.PROTOCOL, divide=folds(5, 1)), jamali_experiment.FIVE),
}


def with_paper(
    figures: Mapping[str, Any], name: str, repeats: int, seed: int, *, quick: bool = False
) -> dict[str, Any]:
    """Return figures of a scene with the change of accuracy of the paper's method, if there is one, by effect."""
    if name not in PAPERS:
        return dict(figures)
    protocol, method = PAPERS[name]
    task, *_ = protocol.tasks
    task = replace(task, methods=tuple(one for one in task.methods if one.name == method))

    def right(world: Scene, number: int) -> float:
        [(_, outcome)] = of_task(protocol, task, world, seed + number, quick=quick)
        return outcome.test.value

    scene = completed(load_scene(name), TOUCH_PROTOCOLS[name])
    worlds = {term: world for term, world in variants(scene, TOUCH_PROTOCOLS[name]).items() if term in scene.effects}
    fractions = np.array([[right(world, number) for world in (scene, *worlds.values())] for number in range(repeats)])
    changes = dict(zip(worlds, map(difference, (fractions[:, 1:] - fractions[:, :1]).T), strict=True))
    return {
        **{term: {**row, 'paper_without': changes[term]} if term in changes else row for term, row in figures.items()},
        'paper_accuracy': round(float(fractions[:, 0].mean()), 4),
    }


COLUMNS = 2


def ablation_chart(numbers: Mapping[str, Any], path: str | Path) -> Path:
    """Draw for each scene how the accuracy changes when a term is left out."""
    panels = numbers['terms']
    terms = {name: {t: row for t, row in figures.items() if isinstance(row, dict)} for name, figures in panels.items()}
    rows = -(-len(panels) // COLUMNS)
    size = (6.0, 0.6 + rows * (0.9 + 0.27 * max(map(len, terms.values()))))
    title = 'Change of accuracy without a term of a simulated scene; n slides tested, others trained'
    with chart(path, size, title) as figure:
        grid = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
        for axes, (name, row) in zip(grid, terms.items(), strict=False):
            _draw_terms(axes, row)
            axes.set_title(f'{name}: {100 * panels[name]["accuracy"]:.0f} %,\nn = {panels[name]["tested"]}')
        for axes in grid[len(panels) :]:
            axes.axis('off')
        grid[len(panels) - 1].set_xlabel('change (percentage points)')
        for axes in grid[len(panels) :][:1]:
            handles, names = grid[1].get_legend_handles_labels()
            axes.legend(handles, names, loc='center', title='the term is left out of')
    return Path(path)


def _draw_terms(axes: Any, terms: Mapping[str, Mapping[str, Mapping[str, float]]]) -> None:
    for label, which, colour, shift in (
        ('training and test slides', 'accuracy_without', COLOURS[0], -0.2),
        ('training slides only', 'accuracy_trained_without', COLOURS[1], 0.2),
        ("both, with the paper's method", 'paper_without', COLOURS[2], 0.0),
    ):
        known = [(place + shift, row[which]) for place, row in enumerate(terms.values()) if which in row]
        axes.errorbar(
            [100 * item['change'] for _, item in known], [place for place, _ in known],
            xerr=[100 * item['half_interval'] if np.isfinite(item['half_interval']) else 0.0 for _, item in known],
            fmt='o', color=colour, markersize=4, capsize=2, label=label,
        )  # fmt: skip
    axes.axvline(0.0, color='black', linewidth=0.8)
    axes.set_yticks(np.arange(len(terms)), [term.replace('_', ' ') for term in terms])
    axes.set(ylim=(len(terms) - 0.5, -0.5))


# Dear scenes are measured less often: stick-slip costs ten times as much, eight channels five times.
FEWER: Mapping[str, int] = {'sticky': 5, 'jamali': 3}


# scenes, slides, repeats, those with the method of a paper, those of single slides, slides at once
FULL = (tuple(TOUCH_PROTOCOLS), 240, 5, 3, 15, 100)
QUICK = (('ets_linear', 'sticky'), 32, 2, 1, 2, 10)


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Time slides, and remove each term of each scene in turn.

    Computing time (ms) of a slide of 0.5 s with all channels, alone and as one of many at once, median over surfaces;
    accuracy of a linear discriminant (shrunk covariance) on the logarithm of 24 bands of the spectrum of each channel,
    with and without each term.
    """
    names, slides, repeats, paper_repeats, scan_repeats, many = QUICK if options.quick else FULL
    costs, terms = dict[str, Any](), dict[str, Any]()
    for name in names:
        scene, touch_protocol = load_scene(name), TOUCH_PROTOCOLS[name]
        sticks = {label: hasattr(surface.friction, 'BRISTLE_1_M') for label, surface in scene.surfaces.items()}
        for kind in sorted(set(sticks.values())):
            surfaces = [label for label in sticks if sticks[label] is kind]
            costs[f'{name}, stick-slip' if kind else name] = scan_cost(scene, surfaces, scan_repeats, many)
        scene = completed(scene, touch_protocol)
        fewer = slides // FEWER.get(name, 1)
        row = ablate(scene, variants(scene, touch_protocol), touch_protocol, fewer, repeats=repeats, seed=options.seed)
        terms[name] = with_paper(row, name, paper_repeats, 1000 + options.seed, quick=options.quick)
    return BenchmarkResult(
        data='simulated scenes; slides of 2 and 3 s are cut to 1 s; terms that left a scene are put back for it',
        split=f'{slides} slides for training (jamali a third, sticky a fifth), others for test, {repeats} repetitions; '
        f"the papers' methods on {paper_repeats} sets of slides as many as in the paper; intervals of 95 %",
        numbers={'scan_ms': costs, 'terms': terms},
        charts=(ablation_chart({'terms': terms}, options.out / 'scenes_ablation.png'),),
    )

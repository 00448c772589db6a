# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where recognition fails: how slides end under disturbances, over unknown materials."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.peers import SVC, recipe_of
from texture_benchmarks.study import (
    DATA,
    BenchmarkOptions,
    BenchmarkResult,
    accuracy_interval,
    imported,
    with_spaced_windows,
)
from texture_core.types import Array, TactileSignal, join_batches
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.training import train
from texture_evaluation import metrics
from texture_evaluation.charts import COLOURS, chart
from texture_evaluation.cross_validation import predict_slides
from texture_evaluation.metrics import SlideResult
from texture_evaluation.train import training_examples
from texture_features.augmentation import (
    Augmentation,
    Disturbance,
    SlideWindows,
    add_drift,
    add_noise,
    amplify,
    at_speed,
    clip,
    hold_lost,
    low_pass,
    other_finger,
)
from texture_recordings.dataset import SlideDataset
from texture_recordings.slides import LabelledSlide
from texture_simulation.offline import simulate_slide_streams
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import load_scene
from texture_simulation.sensor_models import SENSORS

# --------------------
# Disturbances, computed on the signals of whole slides.

VIBRATION = 'signal'
FINGER_SEED = 7  # the same other finger for all slides


def at_other_speed(windows: SlideWindows, strength: float, _rng: np.random.Generator) -> Array:
    """Return the path at another speed: less of it in the same time, or all of it in less."""
    return at_speed(windows, strength, windows.samples.shape[1])


def worn(windows: SlideWindows, strength: float, rng: np.random.Generator) -> Array:
    """Low-pass the vibration with the strength as its cut-off, Hz."""
    return low_pass(windows, strength / windows.rate_hz, rng)


def another_finger(windows: SlideWindows, strength: float, _rng: np.random.Generator) -> Array:
    """Filter the vibration by one smooth random response (dB), and shift the slow channels."""
    return other_finger(windows, strength, np.random.default_rng([FINGER_SEED, round(1000 * strength)]))


@dataclass(frozen=True)
class DisturbanceSweep:
    """One disturbance at several strengths."""

    change: Disturbance
    strengths: Sequence[float]  # How strongly
    form: str  # Name of the disturbance at a strength
    percent: bool = False  # Whether the name gives the strength in percent
    nothing: float = 0.0  # Strength at which nothing changes; 1 for factors
    # Which strengths the classifier is trained on; None where it is trained on none
    trained: Callable[[Augmentation], tuple[float, float] | None] = lambda _: None

    @property
    def is_factor(self) -> bool:
        """Whether strengths below and above that of no change are measured."""
        return self.nothing == 1.0

    def name(self, strength: float) -> str:
        """Return the name of the disturbance at this strength."""
        return self.form.format(100.0 * strength if self.percent else strength)

    def tick(self, strength: float) -> str:
        """Return the strength as a number, in percent where the name gives it so."""
        return f'{100.0 * strength if self.percent else strength:g}'


ROWS: Mapping[str, DisturbanceSweep] = {
    'gain': DisturbanceSweep(
        amplify,
        (0.5, 0.7, 0.8, 0.9, 1.1, 1.25, 1.4, 2.0),
        'gain × {:g}',
        nothing=1.0,
        trained=lambda augmentation: (1.0 / augmentation.gain_range, augmentation.gain_range),
    ),
    'white noise': DisturbanceSweep(
        add_noise,
        (0.003, 0.01, 0.03, 0.1),
        'white noise {:g} % of the rms',
        percent=True,
        trained=lambda augmentation: (0.0, augmentation.noise_range),
    ),
    'speed': DisturbanceSweep(
        at_other_speed,
        (0.4, 0.7, 0.9, 0.95, 1.05, 1.1, 1.4, 2.0),
        'speed × {:g}',
        nothing=1.0,
        trained=lambda augmentation: (1.0 - augmentation.speed_range, 1.0 + augmentation.speed_range),
    ),
    'another finger': DisturbanceSweep(another_finger, (0.5, 1.0, 2.0, 4.0), 'another finger, {:g} dB'),
    'wear': DisturbanceSweep(worn, (800.0, 500.0, 300.0), 'low-pass {:g} Hz', nothing=math.inf),
    'offset drift': DisturbanceSweep(add_drift, (0.1, 1.0, 10.0), 'drift {:g} rms/s'),
    'hidden losses': DisturbanceSweep(hold_lost, (0.003, 0.01, 0.03, 0.1), 'hidden losses {:g} %', percent=True),
    'clipped': DisturbanceSweep(clip, (3.0, 2.0, 1.0), 'clipped at {:g} rms', nothing=math.inf),
}


def disturbed(item: LabelledSlide, row: DisturbanceSweep, strength: float, rng: np.random.Generator) -> LabelledSlide:
    """Return a slide under a disturbance of this strength."""

    def changed(topic: str, run: TactileSignal) -> TactileSignal:
        whole = SlideWindows(
            run.samples[None].astype(np.float64), run.sampling_rate_hz, np.zeros(1), vibration=topic == VIBRATION
        )
        return dataclasses.replace(run, samples=row.change(whole, strength, rng)[0].astype(np.float32))

    signals = {topic: [changed(topic, run) for run in join_batches(batches)] for topic, batches in item.signals.items()}
    return dataclasses.replace(item, signals=signals)


# --------------------
# Simulated slides, for reduced runs without recordings.

SCENE, TRAINED = 'twelve_textures', SimulatedSlide(0.1, 2.0, 3.0)  # speed, force and duration


def simulate(sliding: SimulatedSlide, count: int, rng: np.random.Generator, *, conditions: bool) -> SlideDataset:
    """Return `count` slides over each surface of the scene; whether they state speed and force is `conditions`."""
    scene = load_scene(SCENE)
    parts = {surface: simulate_slide_streams(scene, surface, count, sliding, rng) for surface in scene.surfaces}
    streams = {stream.topic: stream for stream in SENSORS[scene.sensor].streams}
    given: dict[str, Any] = {'speed_m_s': 0.1, 'force_n': 2.0, 'direction_rad': 0.0} if conditions else {}
    return SlideDataset.from_arrays(
        {topic: [samples for part in parts.values() for samples in part[topic]] for topic in streams},
        [surface for surface in parts for _ in range(count)],
        {topic: stream.rate_hz for topic, stream in streams.items()},
        channels={topic: stream.channels for topic, stream in streams.items()},
        motion='linear_slide',
        **given,
    )


# --------------------
# The study.

OURS, PEER, PAPER = 'default', SVC, 'ets-fine-svm'  # of the papers, the one most often right here
RECIPES = (OURS, 'vibration-and-taxels')
COMPARED = (*RECIPES, PEER, PAPER)
TRAINED_ON, TESTED_ON, DISTURBED = '1-30', '31-40', '32,35,38'
DISTURBED_DATA = f'{DATA["biotac20"]}; disturbances are computed on the recorded signals'
LEFT_OUT, DRAWS, UNKNOWN_S = 5, 10, 2.5  # materials left out in each draw, and sliding after which they are counted
SPLIT = (
    f'BioTac, trained on slides {TRAINED_ON}, tested on {TESTED_ON}; disturbed: {DISTURBED}; unknown: {DRAWS} draws of '
    f'{LEFT_OUT} materials that are not trained, slides of {UNKNOWN_S:g} s'
)
QUICK_COMPARED, QUICK_ROWS = ('default', PEER), ('gain', 'hidden losses')
UNDISTURBED = 'undisturbed'
MAX_ACCEPTED_WRONG = 2 / 60
KEPT = 0.9  # of the labels that are right without a disturbance: below it, a recipe has broken down


@dataclass(frozen=True)
class Outcome:
    """How the slides of one cell ended."""

    slides: int  # How many
    # early_right, early_wrong: slides with a right and with a wrong label at the first decided estimate; the
    # others were never decided
    early_right: int
    early_wrong: int
    # final_right, final_wrong: slides with a right and with a wrong label that were accepted at the end;
    # the others were rejected
    final_right: int
    final_wrong: int
    label_right: int  # Slides with the right label at the end, whether they were accepted or not
    interval: tuple[float, float]  # Of their fraction, 95 %, over surfaces: slides over one are no independent draws

    @property
    def worst_wrong(self) -> float:
        """The larger fraction of slides that were accepted but wrong: at the first decided estimate, or at the end."""
        return max(self.early_wrong, self.final_wrong) / self.slides

    @classmethod
    def of(cls, results: Sequence[SlideResult]) -> Outcome:
        """Return the outcome of slides; one without a window counts as rejected."""
        measured = [result for result in results if result.estimates]
        first = [(next((e for e in result.estimates if e.decided), None), result) for result in measured]
        early = [estimate.label == result.surface for estimate, result in first if estimate is not None]
        final = [result.end.label == result.surface for result in measured if result.end.accepted]
        labels = [bool(result.estimates) and result.end.label == result.surface for result in results]
        return cls(
            slides=len(results),
            early_right=sum(early),
            early_wrong=len(early) - sum(early),
            final_right=sum(final),
            final_wrong=len(final) - sum(final),
            label_right=sum(labels),
            interval=accuracy_interval(labels, [result.surface for result in results]),
        )


Outcomes = dict[str, dict[str, Outcome]]  # by recipe and row


def evaluate_slides(model: TextureModel, slides: Sequence[LabelledSlide]) -> list[SlideResult]:
    """Return the estimates of a model for slides, window by window."""
    results = []
    for slide, vectors in SlideDataset(tuple(slides)).vectors(model.recipe.feature_set):
        evidence = EvidenceAccumulator(model)
        estimates = [evidence.update(vector) for vector in vectors]
        alone = model.decide(np.stack([vector.values for vector in vectors])) if vectors else []
        results.append(SlideResult(slide.surface, alone, [estimate for estimate in estimates if estimate.windows]))
    return results


def _slides(options: BenchmarkOptions) -> tuple[SlideDataset, SlideDataset, SlideDataset]:
    """Return the slides that are trained, tested, and disturbed: recorded, or for a quick run simulated ones."""
    if options.quick:
        slides = simulate(TRAINED, 9, np.random.default_rng(options.seed), conditions=True)
        return slides.select('1-6'), slides.select('7-9'), slides.select('7-9')
    with imported(options, 'biotac20') as bags:
        slides = SlideDataset.from_bags(bags)
    return slides.select(TRAINED_ON), slides.select(TESTED_ON), slides.select(DISTURBED)


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on undisturbed slides, and test on later ones under disturbances, one at a time.

    Slides that are accepted and correct, rejected, or accepted but wrong, at the first decided estimate and at the
    end, and slides whose label is right, accepted or not; breakdown: strengths at which these fall below 90 % of those
    without a disturbance, linear between strengths. Unknown: slides over materials that were not trained, accepted
    all the same. The estimates have no information of the disturbance. 95 % intervals by
    bootstrap over surfaces, or exact over slides where these are wider.
    """
    trained, tested, to_disturb = _slides(options)
    models = {name: _trained(name, trained) for name in (QUICK_COMPARED if options.quick else COMPARED)}
    clean = {name: evaluate_slides(model, tested.slides) for name, model in models.items()}
    outcomes = _under_disturbances(models, clean, to_disturb, options)
    numbers: dict[str, Any] = {
        name: {
            'window_accuracy': metrics.window_accuracy(clean[name]),
            'calibration_error': metrics.calibration_error(clean[name]),
            'accepted_wrong': metrics.accepted_wrong(clean[name]),
            'rejected': metrics.rejected(clean[name]),
            'early': metrics.early_decision(clean[name]),
            'above_allowed': [row for row, one in outcomes[name].items() if one.worst_wrong > MAX_ACCEPTED_WRONG],
            'outcomes': {row: asdict(outcome) for row, outcome in outcomes[name].items()},
            'breakdown': {row: breakdown_strengths(ROWS[row], outcomes[name]) for row in _rows(options)},
        }
        for name in models
    }
    if not options.quick:
        numbers['unknown_materials'] = _unknown_materials(options, trained, tested)
    chart_path = options.out / 'failures.png'
    charts = () if options.quick else (failures_chart(numbers, chart_path),)
    return BenchmarkResult(
        data=f'simulated scene {SCENE}' if options.quick else DISTURBED_DATA,
        split=SPLIT,
        numbers=numbers,
        charts=charts,
    )


def _rows(options: BenchmarkOptions) -> Sequence[str]:
    return QUICK_ROWS if options.quick else tuple(ROWS)


def _trained(name: str, slides: SlideDataset) -> TextureModel:
    recipe = _recipe(name)
    return train(recipe, training_examples(recipe, slides))


def _recipe(name: str) -> Recipe:
    return with_spaced_windows(recipe_of(name)) if name in (PEER, PAPER) else recipe_of(name)


def _under_disturbances(
    models: Mapping[str, TextureModel],
    clean: Mapping[str, Sequence[SlideResult]],
    to_disturb: SlideDataset,
    options: BenchmarkOptions,
) -> Outcomes:
    """Return the outcomes of undisturbed slides, and of the slides under each disturbance."""
    outcomes: Outcomes = {name: {UNDISTURBED: Outcome.of(results)} for name, results in clean.items()}
    for row, kind in enumerate(_rows(options)):
        row_kind = ROWS[kind]
        for column, strength in enumerate(row_kind.strengths):
            seeds = np.random.SeedSequence([options.seed, row, column]).spawn(len(to_disturb))
            slides = [
                disturbed(item, row_kind, strength, np.random.default_rng(seed))
                for item, seed in zip(to_disturb, seeds, strict=True)
            ]
            for name, model in models.items():
                outcomes[name][row_kind.name(strength)] = Outcome.of(evaluate_slides(model, slides))
    return outcomes


def _unknown_materials(options: BenchmarkOptions, trained: SlideDataset, tested: SlideDataset) -> dict[str, Any]:
    """Return the fractions of slides over untrained materials that are accepted, and of trained ones rejected."""
    labels = np.unique(trained.labels)
    found: dict[str, Any] = {}
    for name in RECIPES:
        recipe, rng = load_recipe(name), np.random.default_rng(options.seed)
        examples, features = training_examples(recipe, trained), tested.features(recipe.feature_set)
        accepted, rejected = [], []
        for draw in range(DRAWS):
            unknown = rng.choice(labels, LEFT_OUT, replace=False)
            known = np.unique(examples.groups[~np.isin(examples.labels, unknown)])
            ends = [
                (one.surface, end)
                for one in predict_slides(train(recipe, examples.of_slides(known)), features).values()
                if (end := one.after(UNKNOWN_S)) is not None
            ]
            accepted.append(float(np.mean([end.accepted for surface, end in ends if surface in unknown])))
            rejected.append(float(np.mean([not end.accepted for surface, end in ends if surface not in unknown])))
            print(f'trust, unknown materials, {name}: {draw + 1} of {DRAWS} trainings', flush=True)
        found[name] = {'accepted': accepted, 'false_rejection_rate': float(np.mean(rejected))}
    return found


def ordered(sweep: DisturbanceSweep) -> list[tuple[float, str]]:
    """Return the strengths from none, or from the smallest factor, to the largest, each with the name of its row."""
    measured = [(strength, sweep.name(strength)) for strength in sweep.strengths]
    clean = (sweep.nothing, UNDISTURBED)
    return sorted([*measured, clean]) if sweep.is_factor else [clean, *measured]


def breakdown(places: Sequence[float], accuracies: Sequence[float]) -> float | None:
    """Return where a curve first falls below KEPT of its start, linear between places; None if it never does."""
    limit = KEPT * accuracies[0]
    below = next((index for index, accuracy in enumerate(accuracies) if accuracy < limit), 0)
    if not below:
        return None
    fallen = (accuracies[below - 1] - limit) / (accuracies[below - 1] - accuracies[below])
    return float(places[below - 1] + fallen * (places[below] - places[below - 1]))


def breakdowns(sweep: DisturbanceSweep, outcomes: Mapping[str, Outcome]) -> list[float]:
    """Return the places on the axis of a sweep, 0 for its first strength, where the accuracy breaks down."""
    rows = ordered(sweep)
    accuracies = [outcomes[name].label_right / outcomes[name].slides for _, name in rows]
    clean = [name for _, name in rows].index(UNDISTURBED)
    sides = (list(range(clean, -1, -1)), list(range(clean, len(rows))))
    found = [breakdown(side, [accuracies[place] for place in side]) for side in sides]
    return [place for place in found if place is not None]


def breakdown_strengths(sweep: DisturbanceSweep, outcomes: Mapping[str, Outcome]) -> list[float]:
    """Return the strengths at these places; below an infinite one, the first that was measured."""
    strengths = [strength for strength, _ in ordered(sweep)]
    found = []
    for place in breakdowns(sweep, outcomes):
        before, after = strengths[math.floor(place)], strengths[math.ceil(place)]
        found.append(after if math.isinf(before) else before + (place % 1.0) * (after - before))
    return found


# --------------------
# The chart.

RIGHT, UNKNOWN, WRONG = COLOURS[2], '#d9d9d9', COLOURS[5]
DRAWN: Mapping[str, str] = {
    'gain': 'gain, factor',
    'white noise': 'white noise, % of rms',
    'speed': 'speed, factor',
    'another finger': 'another finger, dB',
    'wear': 'low-pass, Hz',
    'offset drift': 'drift, rms/s',
    'hidden losses': 'hidden losses, %',
    'clipped': 'clipped, at rms',
}
LINES: Mapping[str, tuple[str, str, str]] = {
    OURS: (f'this suite: {OURS}', COLOURS[0], 'o'),
    PEER: (f'peer: {PEER}', COLOURS[3], 's'),
    PAPER: (f'best paper, Roberge et al.: {PAPER}', '#4d4d4d', '^'),
}


def failures_chart(numbers: Mapping[str, Any], path: str | Path) -> Path:
    """Draw labels right of three methods under each disturbance, how ours ends, and unknown materials accepted."""
    with chart(path, (8.0, 10.6), points=11.0) as figure:
        heights = [1.0, 0.5] * 3
        grid = figure.subplots(6, 3, height_ratios=heights, sharey='row')
        panels = [(grid[2 * place, column], grid[2 * place + 1, column]) for place in range(3) for column in range(3)]
        for (lines, strip), (row, title) in zip(panels, DRAWN.items(), strict=False):
            _draw_sweep(lines, strip, ROWS[row], numbers)
            lines.set_title(title)
        _draw_unknown(*panels[-1], numbers['unknown_materials'])
        for lines, strip in zip(grid[::2, 0], grid[1::2, 0], strict=True):
            lines.set_ylabel('label right (%)')
            strip.set_ylabel('ends (%)')
        handles, labels = grid[0, 0].get_legend_handles_labels()
        bars, names = grid[1, 0].get_legend_handles_labels()
        figure.legend([*handles, *bars], [*labels, *names], loc='outside lower left', ncols=2)
    return Path(path)


def _draw_sweep(lines: Any, strip: Any, sweep: DisturbanceSweep, numbers: Mapping[str, Any]) -> None:
    rows = ordered(sweep)
    places = np.arange(len(rows))
    covered = sweep.trained(load_recipe(OURS).augmentation)
    if covered:
        low, high = np.interp(covered, [strength for strength, _ in rows], places)
        lines.axvspan(low, high, color='#cfe3f2', linewidth=0, label=f'range that training of {OURS} covers')
    else:
        lines.axvspan(0, 0, color='#cfe3f2', linewidth=0)
    for name, (label, colour, marker) in LINES.items():
        ends = [numbers[name]['outcomes'][row] for _, row in rows]
        accuracy = 100 * np.array([end['label_right'] / end['slides'] for end in ends])
        low, high = 100 * np.array([end['interval'] for end in ends]).T
        lines.fill_between(places, low, high, color=colour, alpha=0.13, linewidth=0)
        lines.plot(places, accuracy, color=colour, marker=marker, markersize=4, label=label)
    ours = {row: Outcome(**numbers[OURS]['outcomes'][row]) for _, row in rows}
    for place in breakdowns(sweep, ours):
        lines.axvline(place, color=COLOURS[0], linestyle=':')
    lines.plot([], [], color=COLOURS[0], linestyle=':', label=f'{OURS} breaks down: 90 % of undisturbed')
    lines.set(ylim=(0, 105), xticks=places, xlim=(-0.5, len(rows) - 0.5))
    lines.tick_params(labelbottom=False)
    outcomes_of_rows = [numbers[OURS]['outcomes'][row] for _, row in rows]
    accuracies = np.array([[end['final_right'], end['final_wrong'], end['label_right']] for end in outcomes_of_rows])
    _draw_ends(strip, 100 * accuracies / np.array([[end['slides']] for end in outcomes_of_rows]))
    crowded = len(rows) > 6
    strip.set_xticks(places, ['none' if name == UNDISTURBED and not sweep.is_factor else sweep.tick(strength)
                              for strength, name in rows], rotation=60 if crowded else 0)  # fmt: skip


def _draw_unknown(panel: Any, below: Any, unknown: Mapping[str, Mapping[str, Any]]) -> None:
    """Draw the fraction of slides over unknown materials that each recipe accepts, with its draws."""
    below.axis('off')
    for place, found in enumerate(unknown.values()):
        accepted = 100 * np.array(found['accepted'])
        panel.bar(place, accepted.mean(), 0.6, color=WRONG)
        panel.plot(np.full(len(accepted), place), accepted, '.', color='black')
    panel.set_xticks(range(len(unknown)), [name.replace('-and-', '-\nand-') for name in unknown])
    panel.set_title('unknown materials accepted')


def _draw_ends(strip: Any, accuracies: Array) -> None:
    """Draw how the slides of ours end, (n, 3) in percent: accepted and correct, accepted but wrong, label right."""
    places = np.arange(len(accuracies))
    right, wrong, label = accuracies.T
    strip.bar(places, right, 0.8, color=RIGHT, label=f'{OURS}: accepted and correct')
    strip.bar(places, 100 - right - wrong, 0.8, right, color=UNKNOWN, label='rejected')
    strip.bar(places, wrong, 0.8, 100 - wrong, color=WRONG, label='accepted but wrong')
    strip.plot(places, label, 'D', color='black', markersize=4, label='label right, rejected or not')
    strip.set(ylim=(0, 112), yticks=[0, 50, 100], xlim=(-0.5, len(places) - 0.5))
    strip.grid(visible=False)

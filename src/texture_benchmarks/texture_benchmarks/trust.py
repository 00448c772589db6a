# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where recognition fails: how slides end under disturbances, over unknown materials."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from texture_benchmarks.peers import SVC, recipe_of
from texture_benchmarks.study import (
    DATA,
    QUICK_MATERIALS,
    BenchmarkOptions,
    BenchmarkResult,
    fraction_interval,
    recorded,
    with_spaced_windows,
)
from texture_core.types import Array, TactileSignal, join_batches
from texture_estimation.model import TextureModel
from texture_estimation.recipe import load_recipe
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


class DisturbanceSweep(NamedTuple):
    """One disturbance at several strengths."""

    change: Disturbance
    strengths: Sequence[float]
    form: str  # name of the disturbance at a strength
    title: str  # what the axis of the chart shows
    nothing: float = 0.0  # strength at which nothing changes; 1 for factors
    unit: float = 1.0  # by which names and ticks multiply the strength: 100 for percent

    @property
    def is_factor(self) -> bool:
        """Whether strengths below and above that of no change are measured."""
        return self.nothing == 1.0

    def name(self, strength: float) -> str:
        """Return the name of the disturbance at this strength."""
        return self.form.format(self.unit * strength)


GAINS = (0.5, 0.7, 0.8, 0.9, 1.1, 1.25, 1.4, 2.0)
SPEEDS = (0.4, 0.7, 0.9, 0.95, 1.05, 1.1, 1.4, 2.0)
NOISES = (0.003, 0.01, 0.03, 0.1)
ROWS: Mapping[str, DisturbanceSweep] = {
    'gain': DisturbanceSweep(amplify, GAINS, 'gain × {:g}', 'gain, factor', 1.0),
    'white noise': DisturbanceSweep(
        add_noise, NOISES, 'white noise {:g} % of the rms', 'white noise, % of rms', unit=100.0
    ),
    'speed': DisturbanceSweep(at_other_speed, SPEEDS, 'speed × {:g}', 'speed, factor', 1.0),
    'another finger': DisturbanceSweep(
        another_finger, (0.5, 1.0, 2.0, 4.0), 'another finger, {:g} dB', 'another finger, dB'
    ),
    'wear': DisturbanceSweep(worn, (800.0, 500.0, 300.0), 'low-pass {:g} Hz', 'low-pass, Hz', math.inf),
    'offset drift': DisturbanceSweep(add_drift, (0.1, 1.0, 10.0), 'drift {:g} rms/s', 'drift, rms/s'),
    'hidden losses': DisturbanceSweep(hold_lost, NOISES, 'hidden losses {:g} %', 'hidden losses, %', unit=100.0),
    'clipped': DisturbanceSweep(clip, (3.0, 2.0, 1.0), 'clipped at {:g} rms', 'clipped, at rms', math.inf),
}


def disturbed(item: LabelledSlide, row: DisturbanceSweep, strength: float, rng: np.random.Generator) -> LabelledSlide:
    """Return a slide under a disturbance of this strength."""

    def changed(topic: str, run: TactileSignal) -> TactileSignal:
        whole = SlideWindows(
            run.samples[None].astype(np.float64), run.sampling_rate_hz, np.zeros(1), vibration=topic == VIBRATION
        )
        return replace(run, samples=row.change(whole, strength, rng)[0].astype(np.float32))

    signals = {topic: [changed(topic, run) for run in join_batches(batches)] for topic, batches in item.signals.items()}
    return replace(item, signals=signals)


# --------------------
# The study.

OURS, PEER, PAPER = 'default', SVC, 'ets-fine-svm'  # of the papers, the one with the highest accuracy here
RECIPES = (OURS, 'vibration-and-taxels')
COMPARED = (*RECIPES, PEER, PAPER)
UNKNOWN_TO = (*RECIPES, 'any-place', 'any-place-and-taxels')
TRAINED_ON, TESTED_ON, DISTURBED = SELECTED = '1-30', '31-40', '32,35,38'
DISTURBED_DATA = f'{DATA["biotac20"]}; disturbances are computed on the recorded signals'
MATERIALS = 20
LEFT_OUT, DRAWS, UNKNOWN_S = 5, 10, 2.5  # materials left out in each draw, and sliding after which they are counted
SPLIT = (
    f'BioTac, trained on slides {TRAINED_ON}, tested on {TESTED_ON}; disturbed: {DISTURBED}; unknown: {DRAWS} draws of '
    f'{LEFT_OUT} materials that are not trained, slides of {UNKNOWN_S:g} s'
)
QUICK_COMPARED, QUICK_ROWS, QUICK_SELECTED = ('default', PEER), ('gain', 'hidden losses'), ('1-9', '10-15', '10-15')
UNDISTURBED = 'undisturbed'


def outcome(results: Sequence[SlideResult]) -> dict[str, Any]:
    """Return how many slides had which label: at the first decided estimate, if accepted at the end, and at the end.

    The others were never decided, and rejected at the end.
    """
    first = [(next((e for e in one.estimates if e.decided), None), one.surface) for one in results]
    early = [estimate.label == surface for estimate, surface in first if estimate is not None]
    final = [one.end.label == one.surface for one in results if one.end.accepted]
    labels = [one.end.label == one.surface for one in results]
    return {
        'slides': len(results),
        'early_correct': sum(early),
        'early_wrong': len(early) - sum(early),
        'accepted_correct': sum(final),
        'accepted_wrong': len(final) - sum(final),
        'correct': sum(labels),
        'interval': fraction_interval(labels, [one.surface for one in results]),
    }


Outcomes = dict[str, dict[str, dict[str, Any]]]  # by recipe and row


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on undisturbed slides, and test on later ones under disturbances, one at a time.

    Slides that are accepted and correct, rejected, or accepted but wrong, at the first decided estimate and at the
    end, and slides whose label is correct, accepted or not. Unknown: slides over materials that were not trained,
    accepted all the same. The estimates have no information of the disturbance. 95 % intervals over surfaces.
    """
    rows, compared = (QUICK_ROWS, QUICK_COMPARED) if options.quick else (tuple(ROWS), COMPARED)
    slides = recorded(options, 'biotac20', ('1-15', QUICK_MATERIALS))
    trained, tested, to_disturb = map(slides.select, QUICK_SELECTED if options.quick else SELECTED)
    # Train, and test without a disturbance, with each, and over unknown materials.
    models = {}
    for name in compared:
        recipe = with_spaced_windows(recipe_of(name)) if name in (PEER, PAPER) else recipe_of(name)
        models[name] = train(recipe, training_examples(recipe, trained))
    clean = {name: _results(model, tested) for name, model in models.items()}
    outcomes: Outcomes = {name: {UNDISTURBED: outcome(results)} for name, results in clean.items()}
    for number, kind in enumerate(rows):
        for column, strength in enumerate(ROWS[kind].strengths):
            seeds = np.random.SeedSequence([options.seed, number, column]).spawn(len(to_disturb))
            changed = [
                disturbed(item, ROWS[kind], strength, np.random.default_rng(seed))
                for item, seed in zip(to_disturb, seeds, strict=True)
            ]
            for name, model in models.items():
                outcomes[name][ROWS[kind].name(strength)] = outcome(_results(model, SlideDataset(tuple(changed))))
    numbers: dict[str, Any] = {
        name: {
            'window_accuracy': metrics.window_accuracy(clean[name]),
            'calibration_error': metrics.calibration_error(clean[name]),
            'accepted_wrong': metrics.accepted_wrong(clean[name]),
            'rejected': metrics.rejected(clean[name]),
            'early': metrics.early_decision(clean[name]),
            'outcomes': outcomes[name],
        }
        for name in models
    }
    if not options.quick:
        numbers['unknown_materials'] = _unknown_materials(options, trained, tested)
    return BenchmarkResult(
        data=DISTURBED_DATA,
        split=SPLIT,
        numbers=numbers,
        charts=() if options.quick else (failures_chart(numbers, options.out / 'failures.png'),),
    )


def _results(model: TextureModel, slides: SlideDataset) -> list[SlideResult]:
    return list(predict_slides(model, slides.features(model.recipe.feature_set)).values())


def _unknown_materials(options: BenchmarkOptions, trained: SlideDataset, tested: SlideDataset) -> dict[str, Any]:
    """Return fractions of slides: over untrained materials accepted, and ended early; over trained ones rejected."""
    labels = np.unique(trained.labels)
    found: dict[str, Any] = {}
    for name in UNKNOWN_TO:
        recipe, rng = load_recipe(name), np.random.default_rng(options.seed)
        examples, features = training_examples(recipe, trained), tested.features(recipe.feature_set)
        accepted, ended, rejected = [], [], []
        for draw in range(DRAWS):
            unknown = rng.choice(labels, LEFT_OUT, replace=False)
            known = np.unique(examples.groups[~np.isin(examples.labels, unknown)])
            results = predict_slides(train(recipe, examples.of_slides(known)), features).values()
            ends = [(one.surface, end) for one in results if (end := one.after(UNKNOWN_S)) is not None]
            early = [one.early() for one in results if one.surface in unknown]
            accepted.append(float(np.mean([end.accepted for surface, end in ends if surface in unknown])))
            ended.append(float(np.mean([one.decided and one.accepted for one in early])))
            rejected.append(float(np.mean([not end.accepted for surface, end in ends if surface not in unknown])))
            print(f'trust, unknown materials, {name}: {draw + 1} of {DRAWS} trainings', flush=True)
        found[name] = {
            'accepted': accepted,
            'mean_accepted': float(np.mean(accepted)),
            'most_accepted': max(accepted),
            'ended_early': float(np.mean(ended)),
            'false_rejection_rate': float(np.mean(rejected)),
        }
    return found


def ordered(sweep: DisturbanceSweep) -> list[tuple[float, str]]:
    """Return the strengths from none, or from the smallest factor, to the largest, each with the name of its row."""
    measured = [(strength, sweep.name(strength)) for strength in sweep.strengths]
    clean = (sweep.nothing, UNDISTURBED)
    return sorted([*measured, clean]) if sweep.is_factor else [clean, *measured]


# --------------------
# The chart.

CORRECT, REJECTED, WRONG = COLOURS[2], '#d9d9d9', COLOURS[5]
LINES: Mapping[str, tuple[str, str, str]] = {
    OURS: (f'this suite: {OURS}', COLOURS[0], 'o'),
    PEER: (f'peer: {PEER}', COLOURS[3], 's'),
    PAPER: (f'best paper, Roberge et al.: {PAPER}', '#4d4d4d', '^'),
}


def failures_chart(numbers: Mapping[str, Any], path: str | Path) -> Path:
    """Draw the accuracy of three methods under each disturbance, how ours ends, and unknown materials accepted."""
    ends = numbers[OURS]['outcomes']
    clean, changed = (ends[row]['slides'] for row in (UNDISTURBED, ROWS['gain'].name(GAINS[0])))
    trained, tested, of_disturbed = (text.replace('-', '–').replace(',', ', ') for text in SELECTED)
    title = (
        f'BioTac (biotac20), {MATERIALS} materials, same track: slides {trained} of each trained; tested without '
        f'disturbance (none, 1): {tested}, n = {clean}; with one: {of_disturbed}, n = {changed} each'
    )
    with chart(path, (6.0, 14.8), title) as figure:
        grid = figure.subplots(10, 2, height_ratios=[1.0, 0.55] * 4 + [0.55, 0.05], sharey='row')
        panels = [*zip(grid[::2].flat, grid[1::2].flat, strict=True)]
        for unused in (*panels.pop(), *panels.pop()):
            unused.remove()
        covered = trained_ranges(load_recipe(OURS).augmentation)
        for (lines, strip), (name, sweep) in zip(panels, ROWS.items(), strict=False):
            _draw_sweep(lines, strip, sweep, numbers, covered.get(name))
            lines.set_title(sweep.title)
        _draw_unknown(figure.add_subplot(grid[0, 0].get_gridspec()[8, :]), numbers['unknown_materials'], clean)
        for lines, strip in zip(grid[:8:2, 0], grid[1:8:2, 0], strict=True):
            lines.set_ylabel('accuracy (%)')
            strip.set_ylabel('slides (%)')
        handles, labels = grid[0, 0].get_legend_handles_labels()
        bars, names = grid[1, 0].get_legend_handles_labels()
        figure.legend([*handles, *bars], [*labels, *names], loc='outside lower left')
    return Path(path)


def trained_ranges(augmentation: Augmentation) -> dict[str, tuple[float, float]]:
    """Return the strengths that the copies of a training cover, by disturbance."""
    return {
        'gain': (1.0 / augmentation.gain_range, augmentation.gain_range),
        'white noise': (0.0, augmentation.noise_range),
        'speed': (1.0 - augmentation.speed_range, 1.0 + augmentation.speed_range),
    }


def _draw_sweep(
    lines: Any, strip: Any, sweep: DisturbanceSweep, numbers: Mapping[str, Any], covered: tuple[float, float] | None
) -> None:
    rows = ordered(sweep)
    places = np.arange(len(rows))
    if covered:
        low, high = np.interp(covered, [strength for strength, _ in rows], places)
        lines.axvspan(low, high, color='#cfe3f2', linewidth=0, label=f'range that training of {OURS} covers')
    else:
        lines.axvspan(0, 0, color='#cfe3f2', linewidth=0)
    for name, (label, colour, marker) in LINES.items():
        ends = [numbers[name]['outcomes'][row] for _, row in rows]
        accuracy = 100 * np.array([end['correct'] / end['slides'] for end in ends])
        low, high = 100 * np.array([end['interval'] for end in ends]).T
        lines.fill_between(places, low, high, color=colour, alpha=0.13, linewidth=0)
        lines.plot(places, accuracy, color=colour, marker=marker, markersize=4, label=label)
    lines.set(ylim=(0, 105), xticks=places, xlim=(-0.5, len(rows) - 0.5))
    lines.tick_params(labelbottom=False)
    outcomes_of_rows = [numbers[OURS]['outcomes'][row] for _, row in rows]
    accuracies = np.array(
        [[end['accepted_correct'], end['accepted_wrong'], end['correct']] for end in outcomes_of_rows]
    )
    _draw_ends(strip, 100 * accuracies / np.array([[end['slides']] for end in outcomes_of_rows]))
    crowded = len(rows) > 6
    strip.set_xticks(places, ['none' if name == UNDISTURBED and not sweep.is_factor else f'{sweep.unit * strength:g}'
                              for strength, name in rows], rotation=60 if crowded else 0)  # fmt: skip


def _draw_unknown(panel: Any, unknown: Mapping[str, Mapping[str, Any]], tested: int) -> None:
    """Draw the fraction of slides over unknown materials that each recipe accepts, with its draws."""
    for place, found in enumerate(unknown.values()):
        accepted = 100 * np.array(found['accepted'])
        panel.barh(place, accepted.mean(), 0.6, color=WRONG)
        panel.plot(accepted, np.full(len(accepted), place), '.', color='black')
    panel.set_yticks(range(len(unknown)), list(unknown))
    of_each = tested // MATERIALS * LEFT_OUT
    panel.set_title(f'unknown: {DRAWS} choices of {LEFT_OUT} materials, n = {of_each} slides each')
    panel.set(xlabel='accepted (%), mean and each')


def _draw_ends(strip: Any, accuracies: Array) -> None:
    """Draw how the slides of ours end, (n, 3) in percent: accepted and correct, accepted but wrong, correct."""
    places = np.arange(len(accuracies))
    correct, wrong, accuracy = accuracies.T
    strip.bar(places, correct, 0.8, color=CORRECT, label=f'{OURS}: accepted and correct')
    strip.bar(places, 100 - correct - wrong, 0.8, correct, color=REJECTED, label=f'{OURS}: rejected')
    strip.bar(places, wrong, 0.8, 100 - wrong, color=WRONG, label=f'{OURS}: accepted but wrong')
    strip.plot(places, accuracy, 'D', color='black', markersize=4, label=f'{OURS}: accuracy, accepted or not')
    strip.set(ylim=(0, 112), yticks=[0, 50, 100], xlim=(-0.5, len(places) - 0.5))
    strip.grid(visible=False)

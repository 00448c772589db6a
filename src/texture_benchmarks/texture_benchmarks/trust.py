# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where recognition fails: how slides end when something differs from the training, under disturbances and borders."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.borders import FINGER, PLACE, SAME, for_recipe, recipe_of, tried
from texture_benchmarks.borders import SETS as BORDER_SETS
from texture_benchmarks.borders import figures as border_figures
from texture_benchmarks.disturbances import ROWS, SCENE, SIMULATED, TRAINED, DisturbanceSweep, disturbed, simulate
from texture_benchmarks.study import DATA, BenchmarkOptions, BenchmarkResult, imported, share_interval, trained_apart
from texture_core.types import Array
from texture_estimation.domain import OUTSIDE
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.training import train
from texture_evaluation import metrics
from texture_evaluation.charts import COLOURS, chart
from texture_evaluation.metrics import SlideResult
from texture_evaluation.train import training_examples
from texture_recordings.dataset import LabelledSlide, SlideDataset

OURS, PEER, PAPER = 'default', 'SVC on log bands', 'ets-fine-svm'  # of the papers, the one most often right here
RECIPES = (OURS, 'vibration-and-taxels')
COMPARED = (*RECIPES, PEER, PAPER)
TRAINED_ON, TESTED_ON, DISTURBED = '1-30', '31-40', '32,35,38'
DISTURBED_DATA = f'{DATA["biotac20"]}; disturbances are computed on the recorded signals'
SPLIT = (
    f'BioTac, trained on slides {TRAINED_ON}, tested on {TESTED_ON}; disturbed: {DISTURBED}; borders: one half of the '
    'path of slides 21-30 trained, of slides 31-40 tested'
)
TRAINED_SLIDES, TESTED_SLIDES = 25, 5  # simulated, of each of the 12 surfaces; 300 in all show an error rate of 1 %
QUICK_COMPARED, QUICK_ROWS, QUICK_SIMULATED = ('fast', PEER), ('gain', 'lost samples'), ('circle, simulated',)
QUICK_TRAINED, QUICK_TESTED = 6, 3
UNDISTURBED, UNDISTURBED_SIMULATED = 'undisturbed', 'undisturbed, simulated'
MAX_WRONG_KNOWN = 2 / 60
ALLOWED = {'accepted_wrong_of_60': 2, 'undisturbed_unknown': 0.03}
KEPT = 0.9  # of the labels that are right without a disturbance: below it, a recipe has broken down


@dataclass(frozen=True)
class Outcome:
    """How the slides of one cell ended."""

    slides: int  # How many
    # early_right, early_wrong: slides with a right and with a wrong label at the first decided estimate; the
    # others were never decided
    early_right: int
    early_wrong: int
    # final_right, final_wrong: slides with a right and with a wrong label that were taken for known at the end;
    # the others were rejected
    final_right: int
    final_wrong: int
    label_right: int  # Slides with the right label at the end, whether they were taken for known or not
    interval: tuple[
        float, float
    ]  # Of the share of those, 95 %, over surfaces: slides over one are no independent draws

    @property
    def worst_wrong(self) -> float:
        """The larger share of slides that were wrong and known: at the first decided estimate, or at the end."""
        return max(self.early_wrong, self.final_wrong) / self.slides

    @classmethod
    def of(cls, results: Sequence[SlideResult]) -> Outcome:
        """Return the outcome of slides; one without a window counts as rejected."""
        measured = [result for result in results if result.estimates]
        first = [(next((e for e in result.estimates if e.decided), None), result) for result in measured]
        early = [estimate.label == result.surface for estimate, result in first if estimate is not None]
        final = [result.end.label == result.surface for result in measured if result.end.known]
        labels = [bool(result.estimates) and result.end.label == result.surface for result in results]
        return cls(
            slides=len(results),
            early_right=sum(early),
            early_wrong=len(early) - sum(early),
            final_right=sum(final),
            final_wrong=len(final) - sum(final),
            label_right=sum(labels),
            interval=share_interval(labels, [result.surface for result in results]),
        )


Outcomes = dict[str, dict[str, Outcome]]  # by recipe and row


def evaluate_slides(model: TextureModel, slides: Sequence[LabelledSlide]) -> list[SlideResult]:
    """Return what a model says of slides, window by window."""
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
        slides = simulate(TRAINED, QUICK_TRAINED + QUICK_TESTED, np.random.default_rng(options.seed), told=True)
        later = slides.select(f'{QUICK_TRAINED + 1}-{QUICK_TRAINED + QUICK_TESTED}')
        return slides.select(f'1-{QUICK_TRAINED}'), later, later
    with imported(options, 'biotac20') as bags:
        slides = SlideDataset.from_bags(bags)
    return slides.select(TRAINED_ON), slides.select(TESTED_ON), slides.select(DISTURBED)


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train on undisturbed slides, and test on later ones under disturbances, one at a time, and across borders.

    Slides that are right and known, unknown, or wrong and known, at the first decided estimate and at the end, and
    slides whose label is right, known or not; breakdown: strengths at which these fall below 90 % of those without a
    disturbance, linear between strengths. The estimates are told nothing of the disturbance. 95 % intervals by
    bootstrap over surfaces, or exact over slides where these are wider.
    """
    trained, tested, to_disturb = _slides(options)
    models = {name: _trained(name, trained) for name in (QUICK_COMPARED if options.quick else COMPARED)}
    clean = {name: evaluate_slides(model, tested.slides) for name, model in models.items()}
    outcomes = _under_disturbances(models, clean, to_disturb, options)
    own = tuple(models)[:1] if options.quick else RECIPES
    refusals = _under_conditions({name: outcomes[name] for name in own}, options)
    numbers: dict[str, Any] = {
        'allowed': ALLOWED,
        'told_outside_what_was_trained': refusals,
        **{
            name: {
                'window_accuracy': metrics.window_accuracy(clean[name]),
                'calibration_error': metrics.calibration_error(clean[name]),
                'accepted_wrong': metrics.accepted_wrong(clean[name]),
                'unknown': metrics.unknown(clean[name]),
                'early': metrics.early_decision(clean[name]),
                'above_allowed': [row for row, one in outcomes[name].items() if one.worst_wrong > MAX_WRONG_KNOWN],
                'outcomes': {row: asdict(outcome) for row, outcome in outcomes[name].items()},
                'breakdown': {row: breakdown_strengths(ROWS[row], outcomes[name]) for row in _rows(options)},
            }
            for name in models
        },
    }
    if not options.quick:
        numbers['borders'] = _across_borders(options)
    chart_path = options.out / 'failures.png'
    charts = () if options.quick else (failures_chart(numbers, chart_path),)
    return BenchmarkResult(
        name='trust',
        measured=run.__doc__,
        data=f'{f"simulated scene {SCENE}" if options.quick else DISTURBED_DATA}; forces and motions: simulated, scene '
        f'{SCENE}, trained on {TRAINED_SLIDES} straight slides of each surface and tested on {TESTED_SLIDES}',
        split=f'simulated, trained on the first {QUICK_TRAINED} slides of each surface' if options.quick else SPLIT,
        numbers=numbers,
        charts=charts,
    )


def _rows(options: BenchmarkOptions) -> Sequence[str]:
    return QUICK_ROWS if options.quick else tuple(ROWS)


def _trained(name: str, slides: SlideDataset) -> TextureModel:
    recipe = _recipe(name)
    return train(recipe, training_examples(recipe, for_recipe(slides, recipe)))


def _recipe(name: str) -> Recipe:
    return trained_apart(recipe_of(name)) if name in (PEER, PAPER) else recipe_of(name)


def _under_disturbances(
    models: Mapping[str, TextureModel],
    clean: Mapping[str, Sequence[SlideResult]],
    to_disturb: SlideDataset,
    options: BenchmarkOptions,
) -> Outcomes:
    """Return the outcomes of undisturbed slides, and of the slides under each disturbance."""
    outcomes: Outcomes = {name: {UNDISTURBED: Outcome.of(results)} for name, results in clean.items()}
    for row, kind in enumerate(_rows(options)):
        own = ROWS[kind]
        for column, strength in enumerate(own.strengths):
            seeds = np.random.SeedSequence([options.seed, row, column]).spawn(len(to_disturb))
            slides = [
                disturbed(item, own, strength, np.random.default_rng(seed))
                for item, seed in zip(to_disturb, seeds, strict=True)
            ]
            for name, model in models.items():
                outcomes[name][own.name(strength)] = Outcome.of(evaluate_slides(model, slides))
    return outcomes


def _under_conditions(outcomes: Outcomes, options: BenchmarkOptions) -> dict[str, dict[str, float]]:
    """Add the outcomes of simulated slides with other forces and motions, of which the estimates are not told.

    Returns the share of slides of each row whose final estimate is refused as outside what was trained when they are
    told, by recipe.
    """
    trained = simulate(TRAINED, TRAINED_SLIDES, np.random.default_rng([options.seed, 0]), told=True)
    refused: dict[str, dict[str, float]] = {}
    for name, own in outcomes.items():
        model, refused[name] = train(load_recipe(name), training_examples(load_recipe(name), trained)), {}
        for row in (UNDISTURBED_SIMULATED, *(QUICK_SIMULATED if options.quick else SIMULATED)):
            for told in (False, True):
                rng = np.random.default_rng([options.seed, 1])
                slides = simulate(SIMULATED.get(row, TRAINED), TESTED_SLIDES, rng, told=told).slides
                results = evaluate_slides(model, slides)
                if told:
                    refused[name][row] = float(np.mean([OUTSIDE in result.end.message for result in results]))
                else:
                    own[row] = Outcome.of(results)
    return refused


def _across_borders(options: BenchmarkOptions) -> dict[str, dict[str, Any]]:
    """Return how slides end at another place and with another finger, by border and recipe."""
    trials = [
        replace(trial, recipes=(OURS, PEER, PAPER))
        for trial in BORDER_SETS['biotac20'](options)
        if set(trial.tested) == set(BORDER_TICKS)
    ]
    found: dict[str, dict[str, Any]] = {border: {} for border in BORDER_TICKS}
    for (border, _, name), answers in tried(trials).items():
        found[border][name] = border_figures(answers)
    return found


def ordered(sweep: DisturbanceSweep) -> list[tuple[float, str]]:
    """Return the strengths from none, or from the smallest factor, to the largest, each with the name of its row."""
    measured = [(strength, sweep.name(strength)) for strength in sweep.strengths]
    clean = (sweep.nothing, UNDISTURBED)
    return sorted([*measured, clean]) if sweep.is_factor else [clean, *measured]


def breakdown(places: Sequence[float], shares: Sequence[float]) -> float | None:
    """Return where a curve first falls below KEPT of its start, linear between places; None if it never does."""
    limit = KEPT * shares[0]
    below = next((index for index, share in enumerate(shares) if share < limit), 0)
    if not below:
        return None
    fallen = (shares[below - 1] - limit) / (shares[below - 1] - shares[below])
    return float(places[below - 1] + fallen * (places[below] - places[below - 1]))


def breakdowns(sweep: DisturbanceSweep, outcomes: Mapping[str, Outcome]) -> list[float]:
    """Return the places on the axis of a sweep, 0 for its first strength, where the share of right labels breaks."""
    rows = ordered(sweep)
    shares = [outcomes[name].label_right / outcomes[name].slides for _, name in rows]
    clean = [name for _, name in rows].index(UNDISTURBED)
    sides = (list(range(clean, -1, -1)), list(range(clean, len(rows))))
    found = [breakdown(side, [shares[place] for place in side]) for side in sides]
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
BORDER_TICKS = {SAME: 'same\ntrack', PLACE: 'other\nplace', FINGER: 'other\nfinger'}
LINES: Mapping[str, tuple[str, str, str]] = {
    OURS: (f'this suite: {OURS}', COLOURS[0], 'o'),
    PEER: (f'peer: {PEER}', COLOURS[3], 's'),
    PAPER: (f'best paper, Roberge et al.: {PAPER}', '#4d4d4d', '^'),
}


def failures_chart(numbers: Mapping[str, Any], path: str | Path) -> Path:
    """Draw labels right of three methods under each disturbance and across borders, and below how ours ends."""
    with chart(path, (8.0, 10.6), points=11.0) as figure:
        heights = [1.0, 0.5] * 3
        grid = figure.subplots(6, 3, height_ratios=heights, sharey='row')
        panels = [(grid[2 * place, column], grid[2 * place + 1, column]) for place in range(3) for column in range(3)]
        for (lines, strip), (row, title) in zip(panels, DRAWN.items(), strict=False):
            _draw_sweep(lines, strip, ROWS[row], numbers)
            lines.set_title(title)
        _draw_borders(*panels[-1], numbers['borders'])
        panels[-1][0].set_title('borders, half a track')
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
        share = 100 * np.array([end['label_right'] / end['slides'] for end in ends])
        low, high = 100 * np.array([end['interval'] for end in ends]).T
        lines.fill_between(places, low, high, color=colour, alpha=0.13, linewidth=0)
        lines.plot(places, share, color=colour, marker=marker, markersize=4, label=label)
    ours = {row: Outcome(**numbers[OURS]['outcomes'][row]) for _, row in rows}
    for place in breakdowns(sweep, ours):
        lines.axvline(place, color=COLOURS[0], linestyle=':')
    lines.plot([], [], color=COLOURS[0], linestyle=':', label=f'{OURS} breaks down: 90 % of undisturbed')
    lines.set(ylim=(0, 105), xticks=places, xlim=(-0.5, len(rows) - 0.5))
    lines.tick_params(labelbottom=False)
    own = [numbers[OURS]['outcomes'][row] for _, row in rows]
    shares = np.array([[end['final_right'], end['final_wrong'], end['label_right']] for end in own])
    _draw_ends(strip, 100 * shares / np.array([[end['slides']] for end in own]))
    crowded = len(rows) > 6
    strip.set_xticks(places, ['none' if name == UNDISTURBED and not sweep.is_factor else sweep.tick(strength)
                              for strength, name in rows], rotation=60 if crowded else 0)  # fmt: skip


def _draw_borders(lines: Any, strip: Any, borders: Mapping[str, Mapping[str, Any]]) -> None:
    places = np.arange(len(BORDER_TICKS))
    for offset, (name, (_, colour, marker)) in zip((-0.15, 0.0, 0.15), LINES.items(), strict=True):
        share = 100 * np.array([borders[border][name]['right'] for border in BORDER_TICKS])
        edges = 100 * np.array([borders[border][name]['interval']['right'] for border in BORDER_TICKS]).T
        errors = np.maximum([share - edges[0], edges[1] - share], 0.0)
        lines.errorbar(places + offset, share, yerr=errors, color=colour, fmt=marker, markersize=5)
    lines.set(xticks=places, xlim=(-0.5, len(places) - 0.5))
    lines.tick_params(labelbottom=False)
    own = [borders[border][OURS] for border in BORDER_TICKS]
    _draw_ends(strip, 100 * np.array([[end['accepted_correct'], end['accepted_wrong'], end['right']] for end in own]))
    strip.set_xticks(places, list(BORDER_TICKS.values()))


def _draw_ends(strip: Any, shares: Array) -> None:
    """Draw how the slides of ours end, (n, 3) in percent: right and known, wrong and known, label right."""
    places = np.arange(len(shares))
    right, wrong, label = shares.T
    strip.bar(places, right, 0.8, color=RIGHT, label=f'{OURS}: right and known')
    strip.bar(places, 100 - right - wrong, 0.8, right, color=UNKNOWN, label='unknown')
    strip.bar(places, wrong, 0.8, 100 - wrong, color=WRONG, label='wrong and known')
    strip.plot(places, label, 'D', color='black', markersize=4, label='label right, rejected or not')
    strip.set(ylim=(0, 112), yticks=[0, 50, 100], xlim=(-0.5, len(places) - 0.5))
    strip.grid(visible=False)

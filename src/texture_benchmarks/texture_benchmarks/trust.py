# SPDX-License-Identifier: Apache-2.0
"""How often slides end wrong and known when something differs from the training."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_benchmarks.recipes import DATA, at_rate
from texture_benchmarks.robustness import DEGRADATIONS, FORCE_N, SCENE, SPEED_M_S
from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult, imported
from texture_core.types import Array, FeatureVector
from texture_estimation.decisions import OUTSIDE
from texture_estimation.evidence import EvidenceAccumulator
from texture_estimation.model import TextureModel
from texture_estimation.recipe import load_recipe
from texture_estimation.training import train
from texture_evaluation import metrics
from texture_evaluation.charts import COLOURS, chart
from texture_evaluation.metrics import SlideResult
from texture_evaluation.train import training_examples
from texture_features.augmentation import smooth_response
from texture_recordings.dataset import LabelledSlide, SlideDataset
from texture_simulation.offline import simulate_slide_streams
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import load_scene
from texture_simulation.sensor_models import SENSORS

SLIDE_S = 3.0
TRAINED_SLIDES, TESTED_SLIDES = 25, 5  # of each of the 12 surfaces; 300 in all show an error rate of 1 %
CIRCLE_M = 0.005  # radius
TRAINED_MOTION = 'linear_slide'


@dataclass(frozen=True, eq=False)
class Condition:
    """How a surface is explored."""

    sliding: SimulatedSlide  # Speed, force, direction and radius
    motion: str = TRAINED_MOTION  # Name of the exploratory motion


TRAINED = Condition(SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S))


def _force(times: float) -> Condition:
    return Condition(dataclasses.replace(TRAINED.sliding, force_n=times * FORCE_N))


SIMULATED: Mapping[str, Condition] = {
    **{f'force × {times:g}, simulated': _force(times) for times in (0.5, 0.7, 0.8, 1.25, 1.4, 2.0)},
    'circle, simulated': Condition(dataclasses.replace(TRAINED.sliding, radius_m=CIRCLE_M), 'circular'),
    'across, simulated': Condition(dataclasses.replace(TRAINED.sliding, direction_rad=math.pi / 2)),
}


def simulate(condition: Condition, count: int, rng: np.random.Generator, *, told: bool) -> SlideDataset:
    """Return `count` slides over each surface of the scene, with all streams of its sensor."""
    scene = load_scene(SCENE)
    parts = {
        surface: simulate_slide_streams(scene, surface, count, condition.sliding, rng) for surface in scene.surfaces
    }
    streams = {stream.topic: stream for stream in SENSORS[scene.sensor].streams}
    sliding = condition.sliding
    circle = bool(sliding.radius_m)
    return SlideDataset.from_arrays(
        {topic: [samples for part in parts.values() for samples in part[topic]] for topic in streams},
        [surface for surface in parts for _ in range(count)],
        {topic: stream.rate_hz for topic, stream in streams.items()},
        channels={topic: stream.channels for topic, stream in streams.items()},
        motion=condition.motion if told else TRAINED_MOTION,
        speed_m_s=float(sliding.speed_m_s) if told else math.nan,
        force_n=float(sliding.force_n) if told else math.nan,
        direction_rad=float(sliding.direction_rad) if told and not circle else math.nan,
    )


VIBRATION = 'signal'
FINGER_SEED = 7  # the same other finger for all slides
UNDISTURBED = 'undisturbed'
# (samples (n, n_channels), rate in Hz, strength, random, whether it is the vibration) -> samples
Change = Callable[[Array, float, float, np.random.Generator, bool], Array]


def _shared(name: str) -> Change:
    """Return a degradation of both inputs."""
    change = DEGRADATIONS[name].change
    return lambda samples, rate_hz, strength, rng, _vibration: change(samples, rate_hz, strength, rng)


def _of_vibration(name: str) -> Change:
    """Return a degradation of the vibration alone."""
    change = DEGRADATIONS[name].change
    return lambda samples, rate_hz, strength, rng, vibration: (
        change(samples, rate_hz, strength, rng) if vibration else samples
    )


def _other_finger(
    samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator, vibration: bool
) -> Array:
    """Filter the vibration by one smooth random response (dB); other gains and offsets of the slow channels."""
    rng = np.random.default_rng([FINGER_SEED, round(1000 * strength), vibration])
    mean: Array = samples.mean(axis=0)
    deviation = samples - mean
    if vibration:
        response = smooth_response(len(samples) // 2 + 1, strength, rng)
        filtered: Array = np.fft.irfft(np.fft.rfft(deviation, axis=0) * response[:, None], len(samples), axis=0)
        return mean + filtered
    gains = np.exp(0.05 * strength * rng.standard_normal(samples.shape[1]))
    offsets = 3.0 * strength * rng.standard_normal(samples.shape[1])
    changed: Array = mean + gains * deviation + offsets
    return changed


@dataclass(frozen=True)
class DisturbanceSweep:
    """One disturbance at several strengths."""

    change: Change  # What is done to the samples
    strengths: Sequence[float]  # How strongly
    form: str  # Name of the disturbance at a strength
    percent: bool = False  # Whether the name gives the strength in percent

    def name(self, strength: float) -> str:
        """Return the name of the disturbance at this strength."""
        return self.form.format(100.0 * strength if self.percent else strength)

    @property
    def title(self) -> str:
        """Name of the disturbance, with an ellipsis in place of its strength."""
        return self.form.replace('{:g}', '…')

    def tick(self, strength: float) -> str:
        """Return the strength as a number, in percent where the name gives it so."""
        return f'{100.0 * strength if self.percent else strength:g}'


ROWS: Mapping[str, DisturbanceSweep] = {
    'gain': DisturbanceSweep(_of_vibration('lower gain'), (0.5, 0.7, 0.8, 0.9, 1.1, 1.25, 1.4, 2.0), 'gain × {:g}'),
    'white noise': DisturbanceSweep(
        _shared('white noise'), (0.003, 0.01, 0.03, 0.1), 'white noise {:g} % of the rms', percent=True
    ),
    'speed': DisturbanceSweep(
        _shared('slower than trained'), (0.4, 0.7, 0.9, 0.95, 1.05, 1.1, 1.4, 2.0), 'speed × {:g}'
    ),
    'another finger': DisturbanceSweep(_other_finger, (1.0, 2.0, 4.0), 'another finger, {:g} dB'),
    'wear': DisturbanceSweep(_of_vibration('wear'), (800.0, 300.0), 'low-pass {:g} Hz'),
    'offset drift': DisturbanceSweep(_shared('offset drift'), (0.1, 1.0, 10.0), 'drift {:g} rms/s'),
    'lost samples': DisturbanceSweep(
        _of_vibration('lost samples'), (0.001, 0.005, 0.01), 'lost samples {:g} %', percent=True
    ),
    'hidden losses': DisturbanceSweep(
        _of_vibration('losses hidden'), (0.003, 0.01, 0.03, 0.1), 'hidden losses {:g} %', percent=True
    ),
    'clipped': DisturbanceSweep(_of_vibration('clipping'), (3.0, 2.0, 1.0), 'clipped at {:g} rms'),
}


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
    mean_s: float  # Mean sliding time until the first decided estimate, or to the end
    label_right: int  # Slides with the right label at the end, whether they were taken for known or not

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
        times = [(estimate or result.estimates[-1]).evidence_s for estimate, result in first]
        return cls(
            slides=len(results),
            early_right=sum(early),
            early_wrong=len(early) - sum(early),
            final_right=sum(final),
            final_wrong=len(final) - sum(final),
            mean_s=float(np.mean(times)) if times else math.nan,
            label_right=sum(result.end.label == result.surface for result in measured),
        )


def disturbed(item: LabelledSlide, row: DisturbanceSweep, strength: float, rng: np.random.Generator) -> LabelledSlide:
    """Return a slide under a disturbance of this strength."""
    signals = {}
    for topic, batches in item.signals.items():
        whole = at_rate(item, topic, batches[0].sampling_rate_hz).signals[topic]
        signals[topic] = [
            dataclasses.replace(run, samples=changed.astype(np.float32))
            for run in whole
            for changed in [
                row.change(run.samples.astype(np.float64), run.sampling_rate_hz, strength, rng, topic == VIBRATION)
            ]
        ]
    return dataclasses.replace(item, signals=signals)


def evaluate_slides(model: TextureModel, slides: Sequence[LabelledSlide]) -> list[SlideResult]:
    """Return what a model says of slides, window by window."""
    extracted = SlideDataset(tuple(slides)).vectors(model.recipe.feature_set)
    return [evaluate_vectors(model, slide.surface, vectors) for slide, vectors in extracted]


def evaluate_vectors(model: TextureModel, surface: str, vectors: Sequence[FeatureVector]) -> SlideResult:
    """Return what a model says of the windows of one slide."""
    evidence = EvidenceAccumulator(model)
    estimates = [evidence.update(vector) for vector in vectors]
    alone = model.decide(np.stack([vector.values for vector in vectors])) if vectors else []
    return SlideResult(surface, alone, [estimate for estimate in estimates if estimate.windows])


RIGHT, UNKNOWN, WRONG = COLOURS[2], '#d9d9d9', COLOURS[5]
UNDISTURBED_SIMULATED = 'undisturbed, simulated'
HALF = 0.42  # width of one of the two bars of a strength
Ticks = list[tuple[str, str]]  # below a pair of bars, and the row that it shows


def trust_chart(recipes: Outcomes, title: str, path: str | Path) -> Path:
    """Draw one grid: a column for each recipe, a row for each disturbance, a pair of stacked bars for each strength.

    Of each pair the left bar is the first decided estimate, the right one the end of the slide: right and known,
    unknown or undecided, wrong and known.
    """
    panels = grid_panels(list(next(iter(recipes.values()))))
    with chart(path, (3.4 * len(recipes) + 0.8, 0.78 * len(panels) + 1.1)) as figure:
        figure.suptitle(title, x=0.01, ha='left', fontweight='bold', fontsize=9)
        grid = figure.subplots(len(panels), len(recipes), sharey=True, sharex='row', squeeze=False)
        for row, (name, ticks) in zip(grid, panels.items(), strict=True):
            for axes, outcomes in zip(row, recipes.values(), strict=True):
                _bars(axes, ticks, outcomes)
            row[0].set_ylabel(name, rotation=0, ha='right', va='center', fontsize=8)
        for axes, recipe in zip(grid[0], recipes, strict=True):
            axes.set_title(recipe)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside lower center', ncols=3)
    return Path(path)


def grid_panels(rows: Sequence[str]) -> dict[str, Ticks]:
    """Return what each row of the grid shows, for the rows that were measured.

    The undisturbed slides stand at 1 where strengths are factors, before them elsewhere.
    """
    panels = {
        row.title: [(row.tick(strength), row.name(strength)) for strength in row.strengths] for row in ROWS.values()
    }
    for name in SIMULATED:
        kind, _, strength = name.removesuffix(', simulated').partition(' × ')
        title = 'force × …,\nsimulated' if strength else 'motion,\nsimulated'
        panels.setdefault(title, []).append((strength or kind, name))
    shown = {}
    for title, ticks in panels.items():
        clean = UNDISTURBED_SIMULATED if 'simulated' in title else UNDISTURBED
        if measured := [tick for tick in ticks if tick[1] in rows]:
            factors = sorted([*measured, ('1', clean)], key=lambda tick: float(tick[0])) if '×' in title else None
            shown[title] = factors or [('none', clean), *measured]
    return shown


def _bars(axes: Any, ticks: Ticks, outcomes: Mapping[str, Outcome]) -> None:
    shown = [outcomes[name] for _, name in ticks]
    places = np.arange(len(shown))
    for side, ends in (
        (-1, [(o.early_right, o.early_wrong) for o in shown]),
        (1, [(o.final_right, o.final_wrong) for o in shown]),
    ):
        right, wrong = 100.0 * np.array(ends).T / [o.slides for o in shown]
        at = places + side * HALF / 2
        axes.bar(at, right, HALF, color=RIGHT, label='right and known' if side < 0 else '')
        axes.bar(at, 100 - right - wrong, HALF, right, color=UNKNOWN, label='unknown or undecided' if side < 0 else '')
        axes.bar(at, wrong, HALF, 100 - wrong, color=WRONG, label='wrong and known' if side < 0 else '')
    axes.set_xticks(places, [tick for tick, _ in ticks], fontsize=7)
    axes.set(ylim=(0, 100), yticks=[0, 50, 100])
    axes.tick_params(length=0, pad=1, labelsize=7)
    axes.grid(visible=False)


RECIPES = ('default', 'fast', 'vibration-and-taxels')
TRAINED_ON, TESTED_ON, DISTURBED, FIRST_SLIDES = '1-30', '31-40', '32,35,38', '1-10'
QUICK_RECIPES, QUICK_ROWS, QUICK_SIMULATED = ('fast',), ('gain', 'lost samples'), ('circle, simulated',)
QUICK_TRAINED, QUICK_TESTED = 6, 3
MAX_WRONG_KNOWN = 2 / 60
ALLOWED = {'wrong_known_of_60': 2, 'undisturbed_unknown': 0.03}
TITLE = (
    'Where it fails: % of slides by how they end when something differs from the training. {}\n'
    'Of each pair of bars: left the first decided estimate, right the end of the slide'
)

Outcomes = dict[str, dict[str, Outcome]]  # by recipe and row


@dataclass(frozen=True, eq=False)
class _Data:
    """What is trained on, and tested undisturbed and disturbed."""

    trained: SlideDataset
    tested: SlideDataset
    to_disturb: SlideDataset
    first: SlideDataset | None  # the first of those trained on, to train on them alone; None to leave this out
    described: str
    split: str

    @classmethod
    def recorded(cls, options: BenchmarkOptions) -> _Data:
        """Return the recorded slides."""
        with imported(options, 'biotac20') as bags:
            slides = SlideDataset.from_bags(bags)
        trained, tested, to_disturb = (slides.select(numbers) for numbers in (TRAINED_ON, TESTED_ON, DISTURBED))
        return cls(
            trained,
            tested,
            to_disturb,
            slides.select(FIRST_SLIDES),
            f'{DATA["biotac20"]}; disturbances are computed on the recorded signals',
            f'BioTac, trained on slides {TRAINED_ON}, tested on {TESTED_ON}; disturbed: {DISTURBED}',
        )

    @classmethod
    def simulated(cls, seed: int) -> _Data:
        """Return simulated slides, for a quick run."""
        slides = simulate(TRAINED, QUICK_TRAINED + QUICK_TESTED, np.random.default_rng(seed), told=True)
        later = slides.select(f'{QUICK_TRAINED + 1}-{QUICK_TRAINED + QUICK_TESTED}')
        split = f'simulated, trained on the first {QUICK_TRAINED} slides of each surface, tested on the others'
        return cls(slides.select(f'1-{QUICK_TRAINED}'), later, later, None, f'simulated scene {SCENE}', split)


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train recipes on undisturbed slides, and test them on later ones under disturbances, one at a time.

    Slides that are right and known, unknown, or wrong and known, at the first decided estimate and at the end; the
    estimates are told nothing of the disturbance.
    """
    data = _Data.simulated(options.seed) if options.quick else _Data.recorded(options)
    models, of_first = {}, {}
    for name in QUICK_RECIPES if options.quick else RECIPES:
        examples = training_examples(load_recipe(name), data.trained)
        models[name] = train(load_recipe(name), examples)
        if data.first:  # how a model trained on the first slides alone does on the last ones, in spite of all drift
            model = train(load_recipe(name), examples.of_slides(slide.name for slide in data.first))
            results = evaluate_slides(model, data.tested.slides)
            of_first[name] = {**_figures(results), 'accuracy_at_end': metrics.accuracy_at_end(results)}
    clean = {name: evaluate_slides(model, data.tested.slides) for name, model in models.items()}
    outcomes = _under_disturbances(models, clean, data, options)
    refusals = _under_conditions(outcomes, options)
    return BenchmarkResult(
        name='trust',
        measured=run.__doc__,
        data=f'{data.described}; forces and motions: simulated, scene {SCENE}, trained on {TRAINED_SLIDES} straight '
        f'slides of each surface and tested on {TESTED_SLIDES}',
        split=data.split,
        numbers={
            'allowed': ALLOWED,
            'told_outside_what_was_trained': refusals,
            **{
                name: {
                    **_figures(clean[name]),
                    'early': metrics.early_decision(clean[name]),
                    'stopping_rule': asdict(model.decisions.stopping_rule),
                    'confidence_floor': asdict(model.decisions.confidence_floor),
                    'above_allowed': [row for row, own in outcomes[name].items() if own.worst_wrong > MAX_WRONG_KNOWN],
                    'outcomes': {row: asdict(outcome) for row, outcome in outcomes[name].items()},
                }
                for name, model in models.items()
            },
            f'trained_on_{FIRST_SLIDES}': of_first,
        },
        charts=(trust_chart(outcomes, TITLE.format(data.split), options.out / 'trust.png'),),
    )


def _figures(results: Sequence[metrics.SlideResult]) -> dict[str, object]:
    return {
        'window_accuracy': metrics.window_accuracy(results),
        'accuracy_at_s': metrics.accuracy_at_times(results),
        'calibration_error': metrics.calibration_error(results),
        'wrong_known': metrics.wrong_known(results),
        'unknown': metrics.unknown(results),
    }


def _under_disturbances(
    models: Mapping[str, TextureModel],
    clean: Mapping[str, Sequence[metrics.SlideResult]],
    data: _Data,
    options: BenchmarkOptions,
) -> Outcomes:
    """Return the outcomes of undisturbed slides, and of the slides under each disturbance."""
    outcomes: Outcomes = {name: {UNDISTURBED: Outcome.of(results)} for name, results in clean.items()}
    for row, kind in enumerate(QUICK_ROWS if options.quick else ROWS):
        own = ROWS[kind]
        for column, strength in enumerate(own.strengths):
            seeds = np.random.SeedSequence([options.seed, row, column]).spawn(len(data.to_disturb))
            slides = [
                disturbed(item, own, strength, np.random.default_rng(seed))
                for item, seed in zip(data.to_disturb, seeds, strict=True)
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

"""How often slides end wrong and known when something differs from the training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from texture_benchmarks.imported_data import imported
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.trust.chart import trust_chart, trust_table
from texture_benchmarks.trust.simulated import SIMULATED, TESTED_SLIDES, TRAINED, TRAINED_SLIDES, simulate
from texture_benchmarks.trust.trial import ROWS, UNDISTURBED, Outcome, disturbed, evaluate_slides
from texture_estimation.classification.training import train
from texture_estimation.model import TextureModel
from texture_estimation.open_set.domain import OUTSIDE
from texture_estimation.recipe import load_recipe
from texture_evaluation import metrics
from texture_evaluation.train import training_examples
from texture_features.labelled_features import LabelledFeatures
from texture_recordings.slide_dataset import SlideDataset

RECIPES = ('default', 'fast', 'vibration-and-taxels')
TRAINED_ON, TESTED_ON, DISTURBED, FIRST_SLIDES = '1-30', '31-40', '32,35,38', '1-10'
QUICK_RECIPES, QUICK_ROWS, QUICK_SIMULATED = ('fast',), ('gain', 'lost samples'), ('circle, simulated',)
QUICK_TRAINED, QUICK_TESTED = 6, 3
MAX_WRONG_KNOWN = 2 / 60
ALLOWED = {'wrong_known_of_60': 2, 'undisturbed_unknown': 0.03}
SIMULATED_DATA = (
    f'scene twelve_textures, trained on {TRAINED_SLIDES} straight slides of each surface and tested on {TESTED_SLIDES}'
)
TITLE = (
    'Where it fails: % of slides by how they end when something differs from the training. {}\n'
    'Of each pair of bars: left the first certain estimate, right the end of the slide'
)

Outcomes = dict[str, dict[str, Outcome]]  # by recipe and row


@dataclass(frozen=True, eq=False)
class _Data:
    """What is trained on, and tested undisturbed and disturbed.

    Parameters
    ----------
    trained, tested, to_disturb
        Slides.
    first
        The first of those trained on, to train on them alone; None to leave this out.
    described, split
        In words.
    """

    trained: SlideDataset
    tested: SlideDataset
    to_disturb: SlideDataset
    first: SlideDataset | None
    described: str
    split: str


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train recipes on undisturbed slides, and test them on later ones under disturbances, one at a time."""
    data = _simulated(options.seed) if options.quick else _recorded(options)
    recipes = QUICK_RECIPES if options.quick else RECIPES
    models, of_first = {}, {}
    for name in recipes:
        examples = training_examples(load_recipe(name), data.trained)
        models[name] = train(load_recipe(name), examples)
        if data.first:
            of_first[name] = _trained_on_first(name, examples, data.first, data.tested)
    clean = {name: evaluate_slides(model, data.tested.slides) for name, model in models.items()}
    outcomes = _under_disturbances(models, clean, data, options)
    refusals = _under_conditions(outcomes, options)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / 'trust.md').write_text(trust_table(outcomes, MAX_WRONG_KNOWN), encoding='utf-8')
    return BenchmarkResult(
        name='trust',
        measured='slides that are right and known, unknown, or wrong and known, at the first certain estimate and at '
        'the end, under disturbances one at a time, of which the estimates are told nothing',
        data=f'{data.described}; forces and motions: simulated, {SIMULATED_DATA}',
        split=data.split,
        numbers={
            'allowed': ALLOWED,
            'told_outside_what_was_trained': refusals,
            **{name: _numbers(models[name], clean[name], outcomes[name]) for name in recipes},
            f'trained_on_{FIRST_SLIDES}': of_first,
        },
        charts=(trust_chart(outcomes, TITLE.format(data.split), options.out / 'trust.png'),),
    )


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
        model = _trained(name, trained)
        refused[name] = {}
        for row in ('undisturbed, simulated', *(QUICK_SIMULATED if options.quick else SIMULATED)):
            results = {
                told: evaluate_slides(
                    model,
                    simulate(
                        SIMULATED.get(row, TRAINED), TESTED_SLIDES, np.random.default_rng([options.seed, 1]), told=told
                    ).slides,
                )
                for told in (False, True)
            }
            own[row] = Outcome.of(results[False])
            refused[name][row] = float(np.mean([OUTSIDE in result.end.message for result in results[True]]))
    return refused


def _trained(name: str, slides: SlideDataset) -> TextureModel:
    recipe = load_recipe(name)
    return train(recipe, training_examples(recipe, slides))


def _trained_on_first(
    name: str, examples: LabelledFeatures, first: SlideDataset, tested: SlideDataset
) -> dict[str, object]:
    """Return how a model that was trained on the first slides alone does on the last ones, in spite of all drift."""
    model = train(load_recipe(name), examples.of_slides(slide.name for slide in first))
    results = evaluate_slides(model, tested.slides)
    return {
        'window_accuracy': metrics.window_accuracy(results),
        'accuracy_at_s': metrics.accuracy_at_times(results),
        'accuracy_at_end': metrics.accuracy_at_end(results),
        'calibration_error': metrics.calibration_error(results),
        'wrong_known': metrics.wrong_known(results),
        'unknown': metrics.unknown(results),
    }


def _recorded(options: BenchmarkOptions) -> _Data:
    with imported(options, 'biotac20') as bags:
        slides = SlideDataset.from_bags(bags)
    return _Data(
        trained=slides.select(TRAINED_ON),
        tested=slides.select(TESTED_ON),
        to_disturb=slides.select(DISTURBED),
        first=slides.select(FIRST_SLIDES),
        described=f'BioTac, {len(bags)} materials (github dexrob/BioTac_slide_20_50, Gao et al. 2020); disturbances '
        'are computed on the recorded signals',
        split=f'BioTac, trained on slides {TRAINED_ON}, tested on {TESTED_ON}; disturbed: {DISTURBED}',
    )


def _simulated(seed: int) -> _Data:
    slides = simulate(TRAINED, QUICK_TRAINED + QUICK_TESTED, np.random.default_rng(seed), told=True)
    later = slides.select(f'{QUICK_TRAINED + 1}-{QUICK_TRAINED + QUICK_TESTED}')
    return _Data(
        trained=slides.select(f'1-{QUICK_TRAINED}'),
        tested=later,
        to_disturb=later,
        first=None,
        described='simulated slides of the scene twelve_textures',
        split=f'simulated, trained on the first {QUICK_TRAINED} slides of each surface, tested on the others',
    )


def _numbers(
    model: TextureModel, clean: Sequence[metrics.SlideResult], outcomes: Mapping[str, Outcome]
) -> dict[str, object]:
    return {
        'window_accuracy': metrics.window_accuracy(clean),
        'accuracy_at_s': metrics.accuracy_at_times(clean),
        'early': metrics.early_decision(clean),
        'calibration_error': metrics.calibration_error(clean),
        'wrong_known': metrics.wrong_known(clean),
        'unknown': metrics.unknown(clean),
        'stopping_rule': asdict(model.stopping_rule),
        'confidence_floor': asdict(model.confidence_floor),
        'above_allowed': [row for row, outcome in outcomes.items() if outcome.worst_wrong > MAX_WRONG_KNOWN],
        'outcomes': {name: asdict(outcome) for name, outcome in outcomes.items()},
    }

"""How often slides end wrong and known when something differs from the training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from texture_benchmarks.imported_data import imported
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.robustness.scenes import FORCE_N, SCENE, SLIDE_S, SPEED_M_S, TouchConditions
from texture_benchmarks.robustness.scenes import simulate_slide_signals as simulate
from texture_benchmarks.trust.chart import trust_chart
from texture_benchmarks.trust.trial import ROWS, UNDISTURBED, Outcome, disturbed, evaluate_slides
from texture_estimation.classification.training import train
from texture_estimation.model import TextureModel
from texture_estimation.recipe import load_recipe
from texture_evaluation import metrics
from texture_evaluation.train import training_examples
from texture_recordings.slide_dataset import SlideDataset
from texture_recordings.slides import LabelledSlide
from texture_simulation.scene import load_scene
from texture_simulation.simulated_slide import SimulatedSlide

RECIPES = ('default', 'fast', 'vibration-and-taxels')
LAST_TRAINED, DISTURBED = 30, (32, 35, 38)
QUICK_RECIPES, QUICK_ROWS, QUICK_SLIDES = ('fast',), ('gain', 'lost samples'), 9
ALLOWED = {'wrong_known_of_60': 2, 'undisturbed_unknown': 0.03}


@dataclass(frozen=True, eq=False)
class _Data:
    """What is trained on, and tested undisturbed and disturbed."""

    trained: Sequence[LabelledSlide]
    tested: Sequence[LabelledSlide]
    to_disturb: Sequence[LabelledSlide]
    described: str
    split: str


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train recipes on undisturbed slides, and test them on later ones under disturbances, one at a time."""
    data = _simulated(options.seed) if options.quick else _recorded(options)
    recipes = QUICK_RECIPES if options.quick else RECIPES
    rows = {name: ROWS[name] for name in (QUICK_ROWS if options.quick else ROWS)}
    models = {name: _trained(name, data.trained) for name in recipes}
    outcomes: dict[str, dict[str, Outcome]] = {name: {} for name in recipes}
    clean = {name: evaluate_slides(model, data.tested) for name, model in models.items()}
    for name, results in clean.items():
        outcomes[name][UNDISTURBED] = Outcome.of(results)
    for row, (kind, own) in enumerate(rows.items()):
        for column, strength in enumerate(own.strengths):
            seeds = np.random.SeedSequence([options.seed, row, column]).spawn(len(data.to_disturb))
            slides = [
                disturbed(item, own, strength, np.random.default_rng(seed))
                for item, seed in zip(data.to_disturb, seeds, strict=True)
            ]
            for name, model in models.items():
                outcomes[name][f'{kind} {strength:g} {own.axis}'] = Outcome.of(evaluate_slides(model, slides))
    title = f'Slides right, unknown, and wrong but taken for known. {data.split}'
    return BenchmarkResult(
        name='trust',
        measured='slides that are right and known, unknown, or wrong and known, at the first certain estimate and at '
        'the end, under disturbances one at a time',
        data=data.described,
        split=data.split,
        numbers={
            'allowed': ALLOWED,
            **{name: _numbers(models[name], clean[name], outcomes[name]) for name in recipes},
        },
        charts=(trust_chart(outcomes, title, options.out / 'trust.png'),),
    )


def _trained(name: str, slides: Sequence[LabelledSlide]) -> TextureModel:
    recipe = load_recipe(name)
    return train(recipe, training_examples(recipe, SlideDataset(tuple(slides))))


def _recorded(options: BenchmarkOptions) -> _Data:
    with imported(options, 'biotac20') as bags:
        slides = SlideDataset.from_bags(bags).slides
    return _Data(
        trained=[item for item in slides if item.number <= LAST_TRAINED],
        tested=[item for item in slides if item.number > LAST_TRAINED],
        to_disturb=[item for item in slides if item.number in DISTURBED],
        described=f'BioTac, {len(bags)} materials (github dexrob/BioTac_slide_20_50, Gao et al. 2020); disturbances '
        'are computed on the recorded signals',
        split=f'BioTac, trained on slides 1-{LAST_TRAINED}, undisturbed: 31-40, disturbed: '
        f'{", ".join(map(str, DISTURBED))} of each material',
    )


def _simulated(seed: int) -> _Data:
    conditions = TouchConditions(load_scene(SCENE), SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S))
    slides = simulate(conditions, QUICK_SLIDES, np.random.default_rng(seed))
    last = 2 * QUICK_SLIDES // 3
    later = [item for item in slides if item.number >= last]  # numbers start at 0
    return _Data(
        trained=[item for item in slides if item.number < last],
        tested=later,
        to_disturb=later,
        described=f"simulated slides of the scene '{SCENE}'",
        split=f'simulated, trained on the first {last} slides of each surface, tested on the others',
    )


def _numbers(
    model: TextureModel, clean: Sequence[metrics.SlideResult], outcomes: Mapping[str, Outcome]
) -> dict[str, object]:
    return {
        'window_accuracy': metrics.window_accuracy(clean),
        'accuracy_at_s': metrics.accuracy_at_times(clean),
        'early': metrics.early_decision(clean),
        'calibration_error': metrics.calibration_error(clean),
        'stopping_rule': asdict(model.stopping_rule),
        'outcomes': {name: asdict(outcome) for name, outcome in outcomes.items()},
    }

"""Where each recipe breaks down, as one thing degrades in slides of the training in good order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np

from texture_benchmarks.imported_data import imported
from texture_benchmarks.recipes.run import (
    DATA,
    LAST_TRAINED,
    NEEDS_ARRAY,
    QUICK_LAST_TRAINED,
    QUICK_MATERIALS,
    QUICK_SLIDES,
    RATE_HZ,
    of_one_finger,
)
from texture_benchmarks.recipes.trial import at_rate, comparable
from texture_benchmarks.result import BenchmarkOptions, BenchmarkResult
from texture_benchmarks.robustness.breakdown_table import KEPT, Curve, Panel, robustness_tables
from texture_benchmarks.robustness.degradations import DEGRADATIONS, Degradation, breakdown
from texture_benchmarks.robustness.scenes import (
    CONDITIONS,
    FORCE_N,
    SCENE,
    SLIDE_S,
    SPEED_M_S,
    ShiftedCondition,
    TouchConditions,
    simulate_slide_signals,
)
from texture_benchmarks.robustness.trial import TOPIC, Count, TrainedModels, degraded
from texture_core.resources import folder
from texture_estimation.channels import FAST_TOPIC, with_channels
from texture_estimation.recipe import Recipe, load_recipe
from texture_recordings.labelled_slide import LabelledSlide
from texture_recordings.slide_dataset import SlideDataset

# Networks for pairs and the search for a penalty train for as long as all others together. Variants of one method break
# down alike, and `vibration-and-taxels` is another recipe without its slow channels.
LEFT_OUT = frozenset(
    {
        'hu-pca-svm',
        'jamali-amplitude-deviation',
        'jamali-stft',
        'jamali-symbols',
        'jamali-wavelets',
        'kaboli-pa-ovr',
        'kaboli-svm',
        'vibration-and-taxels',
    }
)
LEFT_OUT_METHODS = ('-ann', '-pairs')
RECIPES = of_one_finger(
    path.stem
    for path in folder('texture_estimation', 'config/recipes').glob('*.yaml')
    if path.stem not in NEEDS_ARRAY | LEFT_OUT
    and not any(method in path.stem for method in LEFT_OUT_METHODS)
    and FAST_TOPIC in load_recipe(path.stem).feature_set.topics
)
LATER = 'later in the session'
Score = Callable[[float], Mapping[str, Count]]
Effect = TypeVar('Effect')


@dataclass(frozen=True)
class _Size:
    """How much is used for training and tested.

    Parameters
    ----------
    recipes
        Names.
    materials, slides
        Read; all if empty.
    last_training
        Later slides are tested.
    every_slide, every_strength, every_effect
        One in so many is tested.
    early, later
        For `LATER`: numbers of the slides of each surface that are used for training, and of those tested, in groups.
    simulated
        Slides of each surface for training, and to test on.
    """

    recipes: Sequence[str]
    materials: Sequence[str]
    slides: str
    last_training: int
    every_slide: int
    every_strength: int
    every_effect: int
    early: Sequence[int]
    later: Sequence[Sequence[int]]
    simulated: tuple[int, int]


WHOLE = _Size(
    recipes=RECIPES,
    materials=(),
    slides='',
    last_training=LAST_TRAINED,
    every_slide=4,
    every_strength=1,
    every_effect=1,
    early=(1, 2, 4, 5, 7, 8, 10, 11),
    later=((3, 6, 9, 12), (13, 14, 15, 16), (21, 22, 23, 24), (29, 30, 31, 32), (37, 38, 39, 40)),
    simulated=(20, 8),
)
QUICK = _Size(
    recipes=('peaks-naive-bayes', 'kaboli-pa'),
    materials=QUICK_MATERIALS,
    slides=QUICK_SLIDES,
    last_training=QUICK_LAST_TRAINED,
    every_slide=1,
    every_strength=3,
    every_effect=5,
    early=(1, 3),
    later=((2,), (5, 6)),
    simulated=(4, 2),
)


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train recipes on clean slides and test them on degraded ones."""
    size = QUICK if options.quick else WHOLE
    with imported(options, 'biotac20', size.slides, size.materials) as bags:
        slide_signals = SlideDataset.from_bags(bags, topics=(TOPIC,)).slides
    recipes = [_recipe(name) for name in size.recipes]
    vibration = [at_rate(item, TOPIC, RATE_HZ) for item in slide_signals]
    trained_models = TrainedModels.trained(recipes, [item for item in vibration if item.number <= size.last_training])
    slides = [item for item in slide_signals if item.number > size.last_training][:: size.every_slide]
    panels = {
        **{
            name: _degraded(trained_models, slides, each, size, options.seed)
            for name, each in _some(DEGRADATIONS, size)
        },
        LATER: _later(recipes, vibration, size),
        **_simulated(recipes, size, options.seed),
    }
    return _result(options, panels, len(slides), size)


def _some(effects: Mapping[str, Effect], size: _Size) -> list[tuple[str, Effect]]:
    return list(effects.items())[:: size.every_effect]


def _recipe(name: str) -> Recipe:
    """Return a shipped recipe for the vibration alone, as it is compared with all others."""
    return comparable(with_channels(load_recipe(name), 'fast'), RATE_HZ, of_motion=False, augmented=True)


def _degraded(
    trained_models: TrainedModels, slides: Sequence[LabelledSlide], degradation: Degradation, size: _Size, seed: int
) -> Panel:
    """Return how recipes do on slides that are made worse."""

    def score(strength: float) -> Mapping[str, Count]:
        rng = np.random.default_rng(seed)
        worse = [degraded(item, degradation, strength, RATE_HZ, rng) for item in slides]
        return trained_models.counts(worse, strength if degradation.of_windows else 1.0)

    strengths = degradation.strengths[:: size.every_strength]
    return _panel(degradation.axis, strengths, score, 'recorded', of_all=degradation.loses)


def _later(recipes: Sequence[Recipe], slide_signals: Sequence[LabelledSlide], size: _Size) -> Panel:
    """Return the accuracy of recipes trained at the beginning of the session on later and later slides."""
    trained_models = TrainedModels.trained(recipes, [item for item in slide_signals if item.number in size.early])
    groups = {max(0.0, float(np.mean(group)) - max(size.early)): group for group in size.later}

    def score(since: float) -> Mapping[str, Count]:
        return trained_models.counts([item for item in slide_signals if item.number in groups[since]])

    return _panel('slides since the last training slide', tuple(groups), score, 'recorded')


def _simulated(recipes: Sequence[Recipe], size: _Size, seed: int) -> dict[str, Panel]:
    """Return how recipes do where a scene is measured otherwise than it was trained."""
    to_learn, to_test = size.simulated
    trained_models: dict[Callable[[], TouchConditions], TrainedModels] = {}
    panels = {}
    for name, condition in _some(CONDITIONS, size):
        if condition.trained not in trained_models:
            slides = simulate_slide_signals(condition.trained(), to_learn, np.random.default_rng([seed, 0]))
            trained_models[condition.trained] = TrainedModels.trained(recipes, slides)
        score = partial(_counts_under_shift, trained_models[condition.trained], condition, to_test, seed)
        panels[name] = _panel(condition.axis, condition.strengths[:: size.every_strength], score, 'simulated')
    return panels


def _counts_under_shift(
    trained_models: TrainedModels, condition: ShiftedCondition, count: int, seed: int, strength: float
) -> Mapping[str, Count]:
    """Return what is recognised of slides that touch the same places at every strength."""
    return trained_models.counts(
        simulate_slide_signals(condition.touch_conditions(strength), count, np.random.default_rng([seed, 1]))
    )


def _panel(axis: str, strengths: Sequence[float], score: Score, slides: str, *, of_all: bool = False) -> Panel:
    """Return the curves of all recipes: shares of the windows cut, or `of_all` that would be at no strength."""
    found = [score(strength) for strength in strengths]
    curves = {}
    for recipe, clean in found[0].items():
        own = [counts[recipe] for counts in found]
        shares = [count.right / max(1, clean.cut if of_all else count.cut) for count in own]
        curves[recipe] = Curve(shares, breakdown(strengths, shares, KEPT))
    return Panel(axis, strengths, curves, slides)


def _result(options: BenchmarkOptions, panels: Mapping[str, Panel], tested: int, size: _Size) -> BenchmarkResult:
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / 'robustness.md').write_text(robustness_tables(panels), encoding='utf-8')
    return BenchmarkResult(
        name='robustness',
        measured=(
            'share of single windows recognised as one thing degrades in the tested slides only, by its strength; '
            f'breakdown: strength at which it falls below {100 * KEPT:.0f} % of the share without degradation, linear '
            'between strengths, null if it does not'
        ),
        data=(
            f'recorded: {DATA["biotac20"]}; PAC at 1 kHz; degraded by computation. Simulated: scene {SCENE}, '
            f'capacitive fingertip at 1 kHz, {SPEED_M_S} m/s, {FORCE_N} N'
        ),
        split=(
            f'recorded: trained on slides 1-{LAST_TRAINED} of each material, tested on {tested} of the later ones; '
            f'{LATER}: trained on slides {_listed(size.early)}, tested on {"; ".join(map(_listed, size.later))}. '
            f'Simulated: {size.simulated[0]} slides of {SLIDE_S} s a surface for training, {size.simulated[1]} '
            'others for test'
        ),
        numbers={effect: _numbers(panel) for effect, panel in panels.items()},
    )


def _listed(numbers: Sequence[int]) -> str:
    return ', '.join(map(str, numbers))


def _numbers(panel: Panel) -> dict[str, Any]:
    return {
        'slides': panel.slides,
        'strength': panel.axis,
        'strengths': [strength if np.isfinite(strength) else None for strength in panel.strengths],
        'recipes': {
            name: {'window_accuracy': [round(share, 4) for share in curve.shares], 'breakdown': curve.breakdown}
            for name, curve in panel.curves.items()
        },
    }

"""Where each recipe breaks down, as one thing degrades in slides that were learnt in good order."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.signal import TactileSignal
from texture_estimation.model import Model
from texture_estimation.recipe import Recipe
from texture_evaluation.benches.recipes import DATA, LAST_LEARNT, VIBRATION, biotac20_settings
from texture_evaluation.benches.result import Bench, BenchResult
from texture_evaluation.degradations import DEGRADATIONS, Degradation, breakdown
from texture_evaluation.recipe_trials import Recorded, try_recipe
from texture_evaluation.robustness_charts import Curve, Panel, robustness_chart, robustness_table
from texture_features.windows import CutWindow

# Those that train in seconds and recognise enough to lose something.
RECIPES = ('default', 'fast', 'hu-pca-svm', 'ets-linear-svm', 'peaks-naive-bayes', 'kaboli-pa')
QUICK_RECIPES = ('fast', 'kaboli-pa')
QUICK_STRENGTHS = 4  # every so many
TESTED_EVERY = 3  # of the slides that were not learnt from
KEPT = 0.9  # of the nominal accuracy: below it, a recipe has broken down
TOPIC = 'signal'


@dataclass(frozen=True, eq=False)
class _Trained:
    """What learnt from clean slides, and the clean slides it is tested on."""

    recipes: Sequence[Recipe]
    models: Sequence[Model]
    slides: Sequence[Recorded]
    seed: int


def run(bench: Bench) -> BenchResult:
    """Train recipes on clean slides and test them on degraded ones."""
    [source] = bench.recordings('biotac20')
    setting = biotac20_settings(source, bench)[VIBRATION]
    learnt, tested = setting.splits['by time'][0]
    slides = [item for item in setting.recorded if item.slide.name in tested]
    chosen = slides if bench.quick else slides[::TESTED_EVERY]
    names = frozenset(item.slide.name for item in chosen)
    recipes = [setting.recipe(name) for name in (QUICK_RECIPES if bench.quick else RECIPES)]
    models = [try_recipe(recipe, setting.recorded, [(learnt, names)]).model for recipe in recipes]
    trained = _Trained(recipes, models, chosen, bench.seed)
    panels = {effect: _panel(trained, degradation, bench.quick) for effect, degradation in DEGRADATIONS.items()}
    bench.out.mkdir(parents=True, exist_ok=True)
    (bench.out / 'robustness.md').write_text(robustness_table(panels), encoding='utf-8')
    title = 'Recorded slides, degraded after clean training: single windows recognised as one thing gets worse'
    return BenchResult(
        name='robustness',
        measured=(
            'share of single windows (0.5 s) recognised as one thing degrades in the tested slides only, by its '
            f'strength; breakdown: strength at which it falls below {100 * KEPT:.0f} % of the share without '
            'degradation, linear between strengths, null if it does not'
        ),
        data=f'{DATA["biotac20"]}; PAC at 1 kHz; degraded by computation',
        split=f'by time: learnt from slides 1-{LAST_LEARNT} of each material, tested on {len(chosen)} later ones',
        numbers={effect: _numbers(panel) for effect, panel in panels.items()},
        charts=(robustness_chart(panels, title, bench.out / 'robustness.png'),),
    )


def degraded(item: Recorded, degradation: Degradation, strength: float, rng: np.random.Generator) -> Recorded:
    """Return a slide of one topic whose samples are as bad as the strength says."""
    signals = [_degraded(batch, degradation, strength, rng) for batch in item.signals[TOPIC]]
    return dataclasses.replace(item, signals={TOPIC: signals})


def share_recognised(recipe: Recipe, model: Model, slides: Sequence[Recorded], due: int | None = None) -> float:
    """Return the share of windows recognised, each by itself: of those cut, or of so many that should have been."""
    right = count = 0
    for item in slides:
        pieces = [piece for piece in item.cut(recipe) if isinstance(piece, CutWindow)]
        vectors = recipe.feature_set.describe_many(pieces)
        if vectors:
            labels = model.decide(np.stack([vector.values for vector in vectors]))
            right += sum(label == item.slide.surface for label in labels)
            count += len(labels)
    return right / max(1, due or count)


def with_windows(recipe: Recipe, length_s: float) -> Recipe:
    """Return a recipe that describes windows of another length in the same terms, one each as often as before."""
    windows = dataclasses.replace(recipe.feature_set.windows, length_s=length_s)
    return dataclasses.replace(
        recipe, feature_set=dataclasses.replace(recipe.feature_set, windows=windows, _layouts={})
    )


def _panel(trained: _Trained, degradation: Degradation, quick: bool) -> Panel:
    strengths = degradation.strengths[:: QUICK_STRENGTHS if quick else 1]
    shares = np.array([_shares(trained, degradation, strength) for strength in strengths])
    curves = {
        recipe.name: Curve(own, breakdown(strengths, own, KEPT))
        for recipe, own in zip(trained.recipes, shares.T.tolist(), strict=True)
    }
    return Panel(degradation.axis, strengths, curves)


def _shares(trained: _Trained, degradation: Degradation, strength: float) -> list[float]:
    """Return the share of windows that each recipe recognises; all are given the same slides."""
    rng = np.random.default_rng(trained.seed)
    slides = [degraded(item, degradation, strength, rng) for item in trained.slides]
    recipes = [with_windows(recipe, strength) if degradation.of_windows else recipe for recipe in trained.recipes]
    due = [_windows(recipe, trained.slides) if degradation.loses else None for recipe in recipes]
    return [
        share_recognised(recipe, model, slides, count)
        for recipe, model, count in zip(recipes, trained.models, due, strict=True)
    ]


def _degraded(
    batch: TactileSignal, degradation: Degradation, strength: float, rng: np.random.Generator
) -> TactileSignal:
    samples = degradation.change(batch.samples.astype(np.float64), batch.sampling_rate_hz, strength, rng)
    return dataclasses.replace(batch, samples=samples.astype(np.float32))


def _windows(recipe: Recipe, slides: Sequence[Recorded]) -> int:
    return sum(isinstance(piece, CutWindow) for item in slides for piece in item.cut(recipe))


def _numbers(panel: Panel) -> dict[str, Any]:
    return {
        'strength': panel.axis,
        'strengths': [strength if np.isfinite(strength) else None for strength in panel.strengths],
        'recipes': {
            name: {'window_accuracy': [round(share, 4) for share in curve.shares], 'breakdown': curve.breakdown}
            for name, curve in panel.curves.items()
        },
    }

# SPDX-License-Identifier: Apache-2.0
"""Where recipes break down as noise, wear, losses or other speeds grow in slides of a training in good order."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from operator import eq
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter, lfilter_zi, resample_poly

from texture_benchmarks.recipes import (
    DATA,
    LAST_TRAINED,
    NEEDS_ARRAY,
    QUICK_LAST_TRAINED,
    QUICK_MATERIALS,
    QUICK_SLIDES,
    RATE_HZ,
    at_rate,
    comparable,
    of_one_finger,
)
from texture_benchmarks.study import BenchmarkOptions, BenchmarkResult, imported, markdown_table
from texture_core.config import find, shipped
from texture_core.types import Array, ExplorationState, Phase, TactileSignal
from texture_estimation.model import TextureModel
from texture_estimation.recipe import FAST_TOPIC, Recipe, load_recipe, with_channels
from texture_estimation.training import train
from texture_evaluation.train import training_examples
from texture_features.augmentation import Augmentation
from texture_features.feature_set import FeatureSet
from texture_recordings.dataset import LabelledSlide, SlideDataset
from texture_simulation.effects import FingerSpread
from texture_simulation.friction import StickSlip
from texture_simulation.offline import simulate_slides
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import Scene, load_scene
from texture_simulation.sensor_models import SENSORS

KEPT = 0.9  # of the accuracy without degradation: below it, a recipe has broken down


def at_other_speed(samples: Array, speed_m_s: float, wanted_m_s: float) -> Array:
    """Return samples (n, n_channels) taken at one speed as they would be at another, at the same rate.

    What frequency does to the sensor and to friction stays that of the speed they were taken at.
    """
    ratio = Fraction(speed_m_s / wanted_m_s).limit_denominator(1000)
    values: Array = resample_poly(samples, ratio.numerator, ratio.denominator, axis=0, padtype='line')
    return values


BURST_S = 0.01  # samples are lost by the packet

# (samples (n, n_channels), rate in Hz, strength, random) -> samples
Change = Callable[[Array, float, float, np.random.Generator], Array]


@dataclass(frozen=True)
class Degradation:
    """One thing that gets worse."""

    # Makes the samples of a slide as bad as the strength says; at `nothing` it returns them as they are
    change: Change
    strengths: Sequence[float]  # From `nothing` on, worse and worse
    axis: str  # What the strength is, with its unit
    loses: bool = False  # Whether samples become NaN: windows that hold one are not cut, and count as not recognised
    # Whether the strength is the length of the tested windows, of that trained, and the samples stay as they
    # are
    of_windows: bool = False
    # Whether it happens before sampling, so that the samples of the sensor are changed and not those of a lower
    # rate
    of_the_world: bool = False

    @property
    def nothing(self) -> float:
        """The strength at which nothing changes."""
        return self.strengths[0]


def _noisy(samples: Array, _rate_hz: float, strength: float, rng: np.random.Generator) -> Array:
    noise: Array = strength * samples.std(axis=0) * rng.standard_normal(samples.shape)
    return samples + noise


def _amplified(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    return strength * samples


def _drifting(samples: Array, rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    seconds = np.arange(len(samples))[:, None] / rate_hz
    drift: Array = strength * samples.std(axis=0) * seconds
    return samples + drift


def _worn(samples: Array, rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    """Low-pass of first order with the strength as its cut-off, Hz, at rest at the first sample."""
    if math.isinf(strength):
        return samples
    pole = math.exp(-2.0 * math.pi * strength / rate_hz)
    b, a = [1.0 - pole], [1.0, -pole]
    worn: Array = lfilter(b, a, samples, axis=0, zi=lfilter_zi(b, a)[:, None] * samples[:1])[0]
    return worn


def _lost(samples: Array, rate_hz: float, strength: float, rng: np.random.Generator) -> Array:
    return np.where(_gaps(len(samples), rate_hz, strength, rng)[:, None], math.nan, samples)


def _held(samples: Array, rate_hz: float, strength: float, rng: np.random.Generator) -> Array:
    gaps = _gaps(len(samples), rate_hz, strength, rng)
    gaps[0] = False
    last_there = np.maximum.accumulate(np.where(gaps, 0, np.arange(len(samples))))
    held: Array = samples[last_there]
    return held


def _gaps(count: int, rate_hz: float, share: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return which samples are missing, (count,), whole bursts at a time."""
    burst = max(1, round(BURST_S * rate_hz))
    return np.repeat(rng.random(-(-count // burst)) < share, burst)[:count]


def _clipped(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    if math.isinf(strength):
        return samples
    middle, limit = samples.mean(axis=0), strength * samples.std(axis=0)
    return np.clip(samples, middle - limit, middle + limit)


def _hurried(samples: Array, _rate_hz: float, strength: float, _rng: np.random.Generator) -> Array:
    """Return the way at another speed: less of it in the same time, or all of it in less."""
    return samples if strength == 1.0 else at_other_speed(samples, 1.0, strength)[: len(samples)]


def _unchanged(samples: Array, _rate_hz: float, _strength: float, _rng: np.random.Generator) -> Array:
    return samples


_OF_RMS = "in the slide's rms"
DEGRADATIONS: Mapping[str, Degradation] = {
    'white noise': Degradation(_noisy, (0.0, 0.01, 0.03, 0.1, 0.2, 0.5, 1.0, 2.0), f'rms of the noise, {_OF_RMS}'),
    'lower gain': Degradation(_amplified, (1.0, 0.95, 0.9, 0.8, 0.7, 0.5, 0.35, 0.25), 'gain'),
    'higher gain': Degradation(_amplified, (1.0, 1.05, 1.1, 1.25, 1.5, 2.0, 3.0, 4.0), 'gain'),
    'offset drift': Degradation(_drifting, (0.0, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0), f'drift per second, {_OF_RMS}'),
    'wear': Degradation(
        _worn, (math.inf, 2000.0, 1000.0, 500.0, 300.0, 200.0, 100.0, 20.0), 'cut-off (Hz)', of_the_world=True
    ),
    'lost samples': Degradation(_lost, (0.0, 0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05), 'share lost', loses=True),
    'losses hidden': Degradation(
        _held, (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.2, 0.5), 'share replaced by the last value'
    ),
    'clipping': Degradation(_clipped, (math.inf, 4.0, 3.0, 2.0, 1.5, 1.0, 0.5, 0.2), f'limit, {_OF_RMS}'),
    'shorter windows': Degradation(
        _unchanged, (1.0, 0.9, 0.8, 0.6, 0.5, 0.4, 0.2, 0.1), 'length of the window, of that trained', of_windows=True
    ),
    'slower than trained': Degradation(
        _hurried, (1.0, 0.98, 0.95, 0.9, 0.8, 0.7, 0.6, 0.5), 'speed, of that trained', of_the_world=True
    ),
    'faster than trained': Degradation(
        _hurried, (1.0, 1.02, 1.05, 1.1, 1.25, 1.5, 1.75, 2.0), 'speed, of that trained', of_the_world=True
    ),
}


def breakdown(strengths: Sequence[float], shares: Sequence[float], kept: float) -> float | None:
    """Return the strength at which a curve first falls below so much of its start; None if it never does.

    Between two strengths it is taken for a straight line; after an infinite one, the next strength is returned.
    """
    limit = kept * shares[0]
    below = next((index for index, share in enumerate(shares) if share < limit), 0)
    if not below:
        return None
    before, after = strengths[below - 1], strengths[below]
    if math.isinf(before):
        return after
    fallen = (shares[below - 1] - limit) / (shares[below - 1] - shares[below])
    return before + fallen * (after - before)


TOPIC = 'signal'
AT_ONCE = 512  # windows evaluated together: many for speed, few enough for the memory


class Count(NamedTuple):
    """Windows recognised, each by itself, of those that were cut."""

    right: int
    cut: int


@dataclass(frozen=True, eq=False)
class TrainedModels:
    """Models of several recipes that trained on the same slides; recipes of the same features describe them once."""

    models: Sequence[TextureModel]

    @classmethod
    def trained(cls, recipes: Iterable[Recipe], slides: Sequence[LabelledSlide]) -> TrainedModels:
        """Train each recipe on all slides."""
        models = []
        for group in _sharing({recipe.name: recipe for recipe in recipes}):
            examples = training_examples(group[0], SlideDataset(tuple(slides)))
            models += [train(recipe, examples) for recipe in group]
        return cls(models)

    def counts(self, slides: Sequence[LabelledSlide], length: float = 1.0) -> dict[str, Count]:
        """Return what each recipe recognises, by its name, in windows `length` times as long as those trained."""
        models = {model.recipe.name: model for model in self.models}
        found: dict[str, Count] = {}
        for group in _sharing({name: with_windows(model.recipe, length) for name, model in models.items()}):
            vectors = SlideDataset(tuple(slides)).vectors(group[0].feature_set)
            extracted = [(slide.surface, vector.values) for slide, own in vectors for vector in own]
            found |= {recipe.name: _count(models[recipe.name], extracted) for recipe in group}
        return found


def with_windows(recipe: Recipe, length: float) -> Recipe:
    """Return a recipe that describes longer or shorter windows in the same terms, one each as often as before."""
    own = recipe.feature_set.windows
    windows = replace(own, length_s=length * own.length_s)
    features = replace(recipe.feature_set, windows=windows, _layouts={})
    return replace(recipe, feature_set=features)


def degraded(
    item: LabelledSlide, degradation: Degradation, strength: float, rate_hz: float, rng: np.random.Generator
) -> LabelledSlide:
    """Return the vibration of a slide at a rate, as bad as the strength says."""
    own_hz = item.signals[TOPIC][0].sampling_rate_hz if degradation.of_the_world else rate_hz
    runs = at_rate(item, TOPIC, own_hz).signals[TOPIC]
    worse = [degradation.change(run.samples.astype(np.float64), own_hz, strength, rng) for run in runs]
    signals = [replace(run, samples=own.astype(np.float32)) for run, own in zip(runs, worse, strict=True)]
    return at_rate(replace(item, signals={TOPIC: signals}), TOPIC, rate_hz)


def _sharing(recipes: Mapping[str, Recipe]) -> list[list[Recipe]]:
    """Return the recipes that have the same windows, features and augmentation together."""
    groups: dict[tuple[FeatureSet, Augmentation], list[Recipe]] = {}
    for recipe in recipes.values():
        groups.setdefault((recipe.feature_set, recipe.augmentation), []).append(recipe)
    return list(groups.values())


def _count(model: TextureModel, extracted: Sequence[tuple[str, Array]]) -> Count:
    right = 0
    for first in range(0, len(extracted), AT_ONCE):
        surfaces, values = zip(*extracted[first : first + AT_ONCE], strict=True)
        right += sum(map(eq, model.decide(np.stack(values)), surfaces))
    return Count(right, len(extracted))


SCENE = 'twelve_textures'
SPEED_M_S, FORCE_N, SLIDE_S = 0.1, 2.0, 2.0
KINETIC = 0.5  # coefficient of friction where there is friction
STRIBECK_M_S = 0.2  # so wide that the skin hangs at SPEED_M_S, too
TRAINED_BY, OTHERS = (0,), (1, 2, 3, 4, 5, 6, 7, 8)  # individuals of the sensor


@dataclass(frozen=True, eq=False)
class TouchConditions:
    """How the surfaces of a scene are measured."""

    scene: Scene
    sliding: SimulatedSlide
    fingers: Sequence[int] = TRAINED_BY


@dataclass(frozen=True)
class ShiftedCondition:
    """One thing that differs more and more from what was trained, which is the first of the strengths."""

    touch_conditions: Callable[[float], TouchConditions]
    strengths: Sequence[float]
    axis: str  # what the strength is, with its unit


def _usual() -> TouchConditions:
    return TouchConditions(load_scene(SCENE), SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S))


def _pressed(strength: float) -> TouchConditions:
    touch_conditions = _usual()
    return replace(touch_conditions, sliding=replace(touch_conditions.sliding, force_n=strength * FORCE_N))


def _turned(strength: float) -> TouchConditions:
    touch_conditions = _usual()
    return replace(touch_conditions, sliding=replace(touch_conditions.sliding, direction_rad=math.radians(strength)))


def _sticking(strength: float) -> TouchConditions:
    touch_conditions = _usual()
    friction = StickSlip(static=strength * KINETIC, kinetic=KINETIC, stribeck_m_s=STRIBECK_M_S)
    rubbing = {name: replace(surface, friction=friction) for name, surface in touch_conditions.scene.surfaces.items()}
    return replace(touch_conditions, scene=replace(touch_conditions.scene, surfaces=rubbing))


def _other_fingers(strength: float) -> TouchConditions:
    touch_conditions = _usual()
    spread = {**touch_conditions.scene.effects, 'finger_spread': FingerSpread(strength)}
    return replace(touch_conditions, scene=replace(touch_conditions.scene, effects=spread), fingers=OTHERS)


CONDITIONS: Mapping[str, ShiftedCondition] = {
    'weaker force': ShiftedCondition(_pressed, (1.0, 0.9, 0.8, 0.65, 0.5, 0.35, 0.25), 'force, of that trained'),
    'stronger force': ShiftedCondition(_pressed, (1.0, 1.1, 1.25, 1.5, 2.0, 2.5, 3.0), 'force, of that trained'),
    'turned direction': ShiftedCondition(_turned, (0.0, 2.0, 5.0, 10.0, 20.0, 45.0, 90.0), 'angle to that trained (°)'),
    'another finger': ShiftedCondition(
        _other_fingers, (0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5), 'spread of the gain among fingers'
    ),
    'stick-slip': ShiftedCondition(_sticking, (1.0, 1.05, 1.1, 1.15, 1.2, 1.3, 1.5), 'static over kinetic friction'),
}


def simulate_slide_signals(touched: TouchConditions, count: int, rng: np.random.Generator) -> list[LabelledSlide]:
    """Return `count` slides over each surface, assigned to the fingers, at the rate of the sensor."""
    stream = find(SENSORS, touched.scene.sensor, 'sensor model').fast
    units = (stream.unit,) * len(stream.channels)
    each = max(1, count // len(touched.fingers))
    slides = []
    for surface, finger in product(touched.scene.surfaces, touched.fingers):
        samples = simulate_slides(touched.scene, surface, each, touched.sliding, rng, finger=finger)
        for number, own in enumerate(samples.astype(np.float32), each * finger):
            slide = LabelledSlide(Path(), f'{surface}/{number}', surface, number, 0, None)
            state = ExplorationState(
                0, slide.exploration_id, 'linear_slide', Phase.SLIDE, steady_s=SLIDE_S, surface=surface
            )
            signal = TactileSignal(0, stream.sensor, stream.channels, units, stream.rate_hz, 0, own)
            slides.append(replace(slide, signals={TOPIC: [signal]}, states=[state]))
    return slides


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
    for path in shipped('texture_estimation', 'config/recipes').values()
    if path.stem not in NEEDS_ARRAY | LEFT_OUT
    and not any(method in path.stem for method in LEFT_OUT_METHODS)
    and FAST_TOPIC in load_recipe(path.stem).feature_set.topics
)
LATER = 'later in the session'


@dataclass(frozen=True)
class _Size:
    """How much is used for training and tested."""

    recipes: Sequence[str]  # names
    materials: Sequence[str]  # read; all if empty, as for the slides
    slides: str
    last_training: int  # later slides are tested
    every: tuple[int, int, int]  # one in so many slides, strengths and effects is tested
    early: Sequence[int]  # for `LATER`: numbers of the slides of each surface that are trained on
    later: Sequence[Sequence[int]]  # and of those tested, in groups
    simulated: tuple[int, int]  # slides of each surface for training, and to test on


WHOLE = _Size(
    RECIPES, (), '', LAST_TRAINED, (4, 1, 1), (1, 2, 4, 5, 7, 8, 10, 11),
    ((3, 6, 9, 12), (13, 14, 15, 16), (21, 22, 23, 24), (29, 30, 31, 32), (37, 38, 39, 40)), (20, 8),
)  # fmt: skip
QUICK = _Size(
    ('peaks-naive-bayes', 'kaboli-pa'), QUICK_MATERIALS, QUICK_SLIDES, QUICK_LAST_TRAINED, (1, 3, 5), (1, 3),
    ((2,), (5, 6)), (4, 2),
)  # fmt: skip


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train recipes on clean slides and test them on degraded ones.

    Share of single windows recognised as one thing degrades in the tested slides only, by its strength; breakdown:
    strength at which it falls below 90 % of the share without degradation, linear between strengths, null if it does
    not.
    """
    size = QUICK if options.quick else WHOLE
    every_slide, every_strength, every_effect = size.every
    with imported(options, 'biotac20', size.slides, size.materials) as bags:
        recorded = SlideDataset.from_bags(bags, topics=(TOPIC,)).slides
    recipes = [
        comparable(with_channels(load_recipe(name), 'fast'), RATE_HZ, of_motion=False, augmented=True)
        for name in size.recipes
    ]
    vibration = [at_rate(item, TOPIC, RATE_HZ) for item in recorded]
    models = TrainedModels.trained(recipes, [item for item in vibration if item.number <= size.last_training])
    slides = [item for item in recorded if item.number > size.last_training][::every_slide]
    numbers = {}
    for name, each in list(DEGRADATIONS.items())[::every_effect]:
        found = {}
        for strength in each.strengths[::every_strength]:
            rng = np.random.default_rng(options.seed)
            worse = [degraded(item, each, strength, RATE_HZ, rng) for item in slides]
            found[strength] = models.counts(worse, strength if each.of_windows else 1.0)
        numbers[name] = _panel(each.axis, found, 'recorded', of_all=each.loses)
    early = TrainedModels.trained(recipes, [item for item in vibration if item.number in size.early])
    since = {max(0.0, float(np.mean(group)) - max(size.early)): group for group in size.later}
    found = {since_: early.counts([s for s in vibration if s.number in group]) for since_, group in since.items()}
    numbers[LATER] = _panel('slides since the last training slide', found, 'recorded')
    models_of: dict[bool, TrainedModels] = {}  # by whether there is friction
    for name, condition in list(CONDITIONS.items())[::every_effect]:
        sticks = condition.touch_conditions is _sticking
        if sticks not in models_of:
            trained, rng = _sticking(1.0) if sticks else _usual(), np.random.default_rng([options.seed, 0])
            simulated = simulate_slide_signals(trained, size.simulated[0], rng)
            models_of[sticks] = TrainedModels.trained(recipes, simulated)
        numbers[name] = _under_shift(models_of[sticks], condition, size, options.seed)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / 'robustness.md').write_text(robustness_tables(numbers), encoding='utf-8')
    return BenchmarkResult(
        name='robustness',
        measured=run.__doc__,
        data=(
            f'recorded: {DATA["biotac20"]}; PAC at 1 kHz; degraded by computation. Simulated: scene {SCENE}, '
            f'capacitive fingertip at 1 kHz, {SPEED_M_S} m/s, {FORCE_N} N'
        ),
        split=(
            f'recorded: trained on slides 1-{size.last_training} of each material, tested on {len(slides)} later ones; '
            f'{LATER}: trained on slides {size.early}, tested on groups {size.later}. Simulated: {size.simulated[0]} '
            f'slides of {SLIDE_S} s a surface for training, {size.simulated[1]} others for test'
        ),
        numbers=numbers,
    )


def _under_shift(models: TrainedModels, condition: ShiftedCondition, size: _Size, seed: int) -> dict[str, Any]:
    """Return how recipes do where a scene is touched otherwise than trained, at the same places at every strength."""
    found = {}
    for strength in condition.strengths[:: size.every[1]]:
        touched, rng = condition.touch_conditions(strength), np.random.default_rng([seed, 1])
        found[strength] = models.counts(simulate_slide_signals(touched, size.simulated[1], rng))
    return _panel(condition.axis, found, 'simulated')


def _panel(
    axis: str, found: Mapping[float, Mapping[str, Count]], slides: str, *, of_all: bool = False
) -> dict[str, Any]:
    """Return the shares of all recipes: of the windows cut, or `of_all` that would be at no strength."""
    strengths, recipes = list(found), {}
    for recipe, clean in found[strengths[0]].items():
        own = [counts[recipe] for counts in found.values()]
        shares = [count.right / max(1, clean.cut if of_all else count.cut) for count in own]
        rounded = [round(share, 4) for share in shares]
        recipes[recipe] = {'window_accuracy': rounded, 'breakdown': breakdown(strengths, shares, KEPT)}
    known = [strength if np.isfinite(strength) else None for strength in strengths]
    return {'slides': slides, 'strength': axis, 'strengths': known, 'recipes': recipes}


def robustness_tables(panels: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the breakdown points in Markdown: a table for each kind of slides, a row for each recipe."""
    tables = []
    for kind in dict.fromkeys(panel['slides'] for panel in panels.values()):
        own = {name: panel for name, panel in panels.items() if panel['slides'] == kind}
        clean = {name: cell['window_accuracy'][0] for name, cell in next(iter(own.values()))['recipes'].items()}
        rows = [
            ['strength', 'without degradation', *(panel['strength'] for panel in own.values())],
            ['tried up to', '', *(f'{panel["strengths"][-1]:g}' for panel in own.values())],
        ]
        for recipe in sorted(clean, key=lambda name: -clean[name]):
            points = [panel['recipes'][recipe]['breakdown'] for panel in own.values()]
            cells = ('–' if point is None else f'{point:.3g}' for point in points)
            rows.append([f'`{recipe}`', f'{100 * clean[recipe]:.1f} %', *cells])
        tables.append(markdown_table([f'{kind} slides', 'windows recognised', *own], rows))
    return '\n'.join(tables)

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What recipes recognise and accept at a distance from what they were trained on: other places, days, fingers, runs."""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from sklearn.discriminant_analysis import QuadraticDiscriminantAnalysis
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from texture_benchmarks import peers
from texture_benchmarks.peers import SVC, recipe_of
from texture_benchmarks.study import DATA, BenchmarkOptions, BenchmarkResult, imported, map_forked, trained_apart
from texture_benchmarks.trust import TRAINED, simulate
from texture_core.types import NANOSECONDS, Phase, TextureEstimate, join_batches
from texture_estimation.recipe import FAST_TOPIC, Recipe
from texture_estimation.training import train
from texture_evaluation.charts import COLOURS, chart
from texture_evaluation.cross_validation import interval, predict_slides
from texture_evaluation.metrics import TIMES_S
from texture_evaluation.train import training_examples
from texture_features.windows import WindowParams
from texture_recordings.dataset import SlideDataset
from texture_recordings.slides import LabelledSlide
from texture_simulation.offline import simulate_slides
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import Scene, load_scene
from texture_simulation.sensor_models import SENSORS

# Tables of the study; each has rows, and each row figures by recipe.
DISTANCE, SPACING, HALVES, OTHER = 'distance', 'spacing', 'halves', 'other'
PLACE_RECIPES = ('any-place-and-taxels', 'any-place', 'vibration-and-taxels', 'default')
CELLS, CELL_CM = 8, 1.4
SPACED = {'1, 7': (1, 7), '2, 6': (2, 6), '3, 5': (3, 5), '1, 3, 5, 7': (1, 3, 5, 7)}
BETWEEN, THERE = 'between', 'at trained places'
# Slides trained and tested: three draws, each trained before it is tested.
DRAWS = {'1-20 → 21-30': ('1-20', '21-30'), '11-30 → 31-40': ('11-30', '31-40'), '1-20 → 31-40': ('1-20', '31-40')}
FIRST_DRAW = next(iter(DRAWS))
# Parts of ten of the track that are trained, and those at the end of it that are tested then; the other way round, too.
PARTS = 10
GAPS = {
    'same half': ((0, 5), (0, 5)),
    'no gap': ((0, 5), (5, 10)),
    'gap of 2.2 cm': ((0, 4), (6, 10)),
    'control of 2.2 cm': ((1, 5), (5, 9)),
    'gap of 4.4 cm': ((0, 3), (7, 10)),
    'control of 4.4 cm': ((2, 5), (5, 8)),
}
# Controls that see no signal: whether the textures differ in how the robot slid over them.
CONTROLS: Mapping[str, Callable[[LabelledSlide], tuple[float, ...]]] = {
    'force and speed alone': lambda one: (one.force_n, one.speed_m_s),
    'direction alone': lambda one: (math.cos(one.direction_rad), math.sin(one.direction_rad)),
}
TAXELS = ('taxels-any-day', 'fast', SVC)  # `fast` and the peer read the taxels as channels of a vibration
FABRICS, DATES = ('BlackPolymer', 'BlackWool', 'GreenVelvet', 'NavyDenim'), ('2021-05-27', '2021-05-31', '2021-06-01')
LONGEST_S = 8.0  # of a slide over taxels
SPIDER_HZ, SPIDER_TRAINED = 15.6, '2024-02-13'
SPIDER = {'2024-02-13b': 'same day', '2024-02-20am1': 'other day', '2024-02-20am2': 'other day',
          '2024-02-21_sensor2': 'other specimen'}  # fmt: skip
BOREAL_HZ, BOREAL_S, BOREAL_SLIDES, BOREAL_TRAINED = 100.0, 5.0, 12, 0.6  # slides of a run at most, and trained runs
QUICK_RECIPES = (
    'any-place-and-taxels',
    'any-place',
    SVC,
    'force and speed alone',
    'direction alone',
)  # for every draw; networks take ten times as long
LONG_NS = 2_000_000_000  # slides from here on have enough windows 0.5 s apart
PEER_WINDOWS = WindowParams(length_s=0.5, hop_s=0.25)


class Trial(NamedTuple):
    """One training, and the slides that are tested for each row of a table, by their names."""

    draw: str
    trained: Sequence[str]
    tested: Mapping[tuple[str, str], Sequence[str]]  # by table and row
    all_recipes: bool = True  # or those alone that train within seconds


@dataclass(frozen=True, eq=False)
class TrialSet:
    """Slides whose features are computed once for each recipe, and the trials among them."""

    name: str
    recipes: Sequence[str]
    slides: SlideDataset
    trials: Sequence[Trial]


class Answer(NamedTuple):
    """How a slide ended: its label and whether it was accepted, after some times, at the end, once decided."""

    cluster: str  # surface and part or session: slides of one are no independent draws
    surface: str
    ends: Mapping[str, tuple[str, bool]]
    reason: str  # of a rejection at the end


END, DECIDED = 'end', 'decided'
Cell = tuple[str, str, str, str]  # table, row, recipe, draw


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train recipes and peers at some places, days or fingers, and test them on other slides there and elsewhere.

    Accuracy at the end of a slide, slides accepted and correct, and accepted but wrong; the largest fraction accepted
    but wrong at 0.5, 1 and 2.5 s, once decided, and at the end. Peers have no rejection: each label of theirs counts
    as accepted. 95 % intervals by bootstrap over surface × part, date or run: slides over one track are no independent
    draws.
    """
    found: defaultdict[Cell, list[Answer]] = defaultdict(list)
    for make in (_simulated_halves,) if options.quick else SETS:
        for trials in make(options):
            for (table, row, recipe, draw), answers in _tried(trials, options.seed):
                found[table, row, recipe, draw] += answers
    return result_of(found, options)


def _tried(trials: TrialSet, seed: int) -> Iterator[tuple[Cell, list[Answer]]]:
    names = [*trials.recipes, *([peers.CNN] if 'biotac20' in trials.name and peers.available() else [])]
    for found in map_forked(partial(answers_of, trials, seed, recipe_of), names):
        yield from found


# --------------------
# One recipe on one set.


def answers_of(
    trials: TrialSet, seed: int, recipe_named: Callable[[str], Recipe], name: str
) -> list[tuple[Cell, list[Answer]]]:
    """Return what a recipe answers in each trial of a set; its features are computed once."""
    slides = {one.name: one for one in trials.slides}
    if name in CONTROLS:
        fit: Callable[[Sequence[str]], Tested] = partial(_control, slides, CONTROLS[name])
    elif name in peers.CLASSIFIERS:
        topics = sorted(trials.slides[0].signals)
        windows = {key: peers.windows_of(one, topics, PEER_WINDOWS) for key, one in slides.items()}
        fit = partial(_peer, slides, windows, name, seed)
    else:
        long = trials.slides[0].sliding[-1].stamp_ns - trials.slides[0].sliding[0].stamp_ns > LONG_NS
        recipe = trained_apart(recipe_named(name)) if name == SVC and long else recipe_named(name)
        fit = _recipe(trials.slides, recipe, accepts_all=name == SVC)
    found = []
    chosen = [one for one in trials.trials if one.all_recipes or name in QUICK_RECIPES]
    for number, trial in enumerate(chosen, 1):
        began_s = time.monotonic()
        test = fit(trial.trained)
        for (table, row), names in trial.tested.items():
            answers = [one._replace(cluster=_cluster(slides[key])) for key, one in test(names).items()]
            found.append(((table, row, name, trial.draw), answers))
        took = f'{time.monotonic() - began_s:.0f} s'
        print(f'{trials.name}, {name}: {number} of {len(chosen)} trainings, {took}', flush=True)
    return found


Tested = Callable[[Sequence[str]], Mapping[str, Answer]]


def _recipe(slides: SlideDataset, recipe: Recipe, *, accepts_all: bool) -> Callable[[Sequence[str]], Tested]:
    """Return what trains a recipe on slides by their names, and returns what tests it on others."""
    if FAST_TOPIC not in slides[0].signals and FAST_TOPIC in recipe.feature_set.topics:  # taxels as a vibration
        slides = SlideDataset(tuple(replace(x, signals={FAST_TOPIC: x.signals['signal_static']}) for x in slides))
    examples, features = training_examples(recipe, slides), slides.features(recipe.feature_set)

    def fit(trained: Sequence[str]) -> Tested:
        model = train(recipe, examples.of_slides(trained))

        def test(names: Sequence[str]) -> Mapping[str, Answer]:
            results = predict_slides(model, features.of_slides(names))
            return {name: _answer(one.surface, one, accepts_all) for name, one in results.items()}

        return test

    return fit


def _answer(surface: str, result: Any, accepts_all: bool) -> Answer:
    """Return the answer of a recipe to a slide."""

    def of(estimate: TextureEstimate) -> tuple[str, bool]:
        return estimate.label, accepts_all or estimate.known

    ends = {f'{s:g}': of(end) for s in TIMES_S if (end := result.after(s)) is not None}
    early = result.early()
    if early.decided and early.known:
        ends[DECIDED] = of(early)
    ends[END] = of(result.end)
    return Answer('', surface, ends, '' if ends[END][1] else result.end.rejection.name.lower())


def _peer(
    slides: Mapping[str, LabelledSlide], windows: Mapping[str, Any], name: str, seed: int, trained: Sequence[str]
) -> Tested:
    fitted = peers.classifier(name, seed)
    labels = np.concatenate([np.repeat(slides[one].surface, len(windows[one])) for one in trained])
    fitted.fit(np.concatenate([windows[one] for one in trained]), labels)

    def test(names: Sequence[str]) -> Mapping[str, Answer]:
        found = {}
        for one in names:
            total = np.log(fitted.predict_proba(windows[one]) + 1e-9).sum(axis=0)
            label = str(fitted.classes_[int(total.argmax())])
            found[one] = Answer('', slides[one].surface, {END: (label, True)}, '')
        return found

    return test


def _control(
    slides: Mapping[str, LabelledSlide], of: Callable[[LabelledSlide], tuple[float, ...]], trained: Sequence[str]
) -> Tested:
    """Return what a Gaussian for each texture answers by the conditions of slides alone."""
    gaussians = make_pipeline(StandardScaler(), QuadraticDiscriminantAnalysis(reg_param=0.01))
    gaussians.fit([of(slides[one]) for one in trained], [slides[one].surface for one in trained])

    def test(names: Sequence[str]) -> Mapping[str, Answer]:
        labels = gaussians.predict([of(slides[one]) for one in names])
        ends = zip(names, labels, strict=True)
        return {one: Answer('', slides[one].surface, {END: (str(label), True)}, '') for one, label in ends}

    return test


def _cluster(slide: LabelledSlide) -> str:
    return f'{slide.surface} {slide.place or slide.session}'


# --------------------
# Other places of a track: the recorded slides of biotac20, and simulated samples that vary.


def names_of(slides: SlideDataset, numbers: str, *places: str) -> list[str]:
    """Return the names of slides with these numbers, at some places, or at any."""
    return [x.name for x in slides.select(numbers, where=lambda one: not places or one.place in places)]


def _biotac20(options: BenchmarkOptions) -> Iterator[TrialSet]:
    with imported(options, 'biotac20') as bags:
        slides = SlideDataset.from_bags(bags)
    yield TrialSet('cells of biotac20', (*PLACE_RECIPES, SVC), cells := slides.in_parts(CELLS), _cells(cells))
    for row, spans in GAPS.items():
        joined, trials = _halves(slides, row, *spans)
        controls = CONTROLS if row == 'no gap' else ()
        yield TrialSet(f'halves of biotac20, {row}', (*PLACE_RECIPES, SVC, *controls), joined, trials)


def _cells(slides: SlideDataset) -> list[Trial]:
    """Return a training in each cell of the track, and in some of them at once, for each draw of slides."""
    places = [f'{number + 1}/{CELLS}' for number in range(CELLS)]
    trials = []
    for draw, (trained, tested) in DRAWS.items():
        every = draw == FIRST_DRAW
        at = [names_of(slides, tested, place) for place in places]
        for cell, place in enumerate(places):
            rows: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
            for other, names in enumerate(at):
                rows[DISTANCE, str(abs(cell - other))] += names
            trials.append(Trial(draw, names_of(slides, trained, place), rows, every))
        for name, chosen in SPACED.items():
            between = [other for other in range(min(chosen) + 1, max(chosen)) if other not in chosen]
            spaced = {
                (SPACING, f'{name}: {BETWEEN}'): [one for other in between for one in at[other]],
                (SPACING, f'{name}: {THERE}'): [one for other in chosen for one in at[other]],
            }
            trials.append(Trial(draw, names_of(slides, trained, *(places[cell] for cell in chosen)), spaced, every))
    return trials


def _halves(
    slides: SlideDataset, row: str, trained: tuple[int, int], tested: tuple[int, int]
) -> tuple[SlideDataset, list[Trial]]:
    """Return the parts of a track joined to what is trained and tested, and a training from either end."""
    parts = slides.in_parts(PARTS)
    joined: dict[str, LabelledSlide] = {}
    for mirrored in (False, True):
        for low, high in {trained, tested}:
            span = (PARTS - high, PARTS - low) if mirrored else (low, high)
            joined |= {one.name: one for one in _joined(parts, span)}
    both = SlideDataset(tuple(joined.values()))
    trials = []
    for draw, (before, after) in DRAWS.items():
        for mirrored in (False, True):
            there, here = (_place((PARTS - x[1], PARTS - x[0]) if mirrored else x) for x in (trained, tested))
            tested_at = {(HALVES, row): names_of(both, after, here)}
            trials.append(Trial(draw, names_of(both, before, there), tested_at, draw == FIRST_DRAW))
    return both, trials


def _place(span: tuple[int, int]) -> str:
    return f'{span[0]}-{span[1]}/{PARTS}'


def _joined(parts: SlideDataset, span: tuple[int, int]) -> Iterator[LabelledSlide]:
    """Yield adjacent parts of slides joined to one stretch each."""
    wanted = {f'{number + 1}/{PARTS}' for number in range(*span)}
    chosen = [one for one in parts if one.place in wanted]
    for _, group in groupby(chosen, key=lambda one: one.whole_name):
        each = list(group)
        states = [x for one in each[:-1] for x in one.states if x.phase is Phase.SLIDE] + list(each[-1].states)
        signals = {
            topic: tuple(join_batches([batch for one in each for batch in one.signals[topic]]))
            for topic in each[0].signals
        }
        yield replace(each[0], place=_place(span), signals=signals, states=states)


SCENE, SPEED_M_S, FORCE_N, SLIDE_S = 'varying', 0.022, 2.0, 2.5
ASTRAY_M = 5e-4  # standard deviation of where a slide over a track begins
PATCH_M, PLACES, NEW_PLACES = 0.1, 6, 8  # side of the patch; places trained and tested of each surface
# From the begin of what is trained to that of what is tested.
ANCHOR = {'simulated, same half': 0.0, 'simulated, no gap': 0.055, 'simulated, gap of 2.2 cm': 0.077}
ANCHORED = 12  # slides of each half of a simulated track


def _simulated(options: BenchmarkOptions) -> Iterator[TrialSet]:
    """Yield six slides of one track or of six places trained and new places tested, and the halves of a track."""
    scene, rng = load_scene(SCENE), np.random.default_rng(options.seed)
    n_surfaces = len(scene.surfaces)
    places_m = rng.uniform(0.0, PATCH_M, (2, n_surfaces, PLACES + NEW_PLACES))
    turned = rng.uniform(-np.pi, np.pi, places_m.shape[1:])
    astray_m = ASTRAY_M * rng.standard_normal((2, n_surfaces, PLACES))
    scattered, track = (
        slides_at(scene, places_m, turned, rng),
        slides_at(scene, astray_m, 0.0 * turned[:, :PLACES], rng),
    )
    first = PLACES + NEW_PLACES
    slides = SlideDataset(
        (*(replace(one, place=f'at {one.number}') for one in scattered),
         *(replace(one, number=first + one.number, place='track') for one in track))
    )  # fmt: skip
    new = names_of(slides, f'{PLACES + 1}-{first}')
    trials = [
        Trial(
            '',
            names_of(slides, f'{first + 1}-{first + PLACES}'),
            {(OTHER, 'simulated, new places from one track'): new},
        ),
        Trial('', names_of(slides, f'1-{PLACES}'), {(OTHER, 'simulated, new places from six'): new}),
    ]
    yield TrialSet('simulated places', ('default', SVC), slides, trials)
    starts_m = np.stack([np.repeat(list(ANCHOR.values()), ANCHORED)] * n_surfaces)
    starts_m = np.stack([starts_m, 0.0 * starts_m]) + ASTRAY_M * rng.standard_normal((2, *starts_m.shape))
    halves = slides_at(scene, starts_m, 0.0 * starts_m[0], rng)
    halves = SlideDataset(tuple(replace(x, place=list(ANCHOR)[(x.number - 1) // ANCHORED]) for x in halves))
    tested = {(HALVES, row): names_of(halves, _last(number), row) for number, row in enumerate(ANCHOR)}
    yield TrialSet(
        'simulated halves', (SVC, 'default'), halves, [Trial('', names_of(halves, f'1-{ANCHORED * 2 // 3}'), tested)]
    )


def _last(half: int) -> str:
    """Return the numbers of the last third of the slides of a half."""
    return f'{half * ANCHORED + ANCHORED * 2 // 3 + 1}-{(half + 1) * ANCHORED}'


def slides_at(scene: Scene, places_m: Any, directions_rad: Any, rng: np.random.Generator) -> SlideDataset:
    """Return a slide over each surface at each place, (2, n_surfaces, n_places), in each direction."""
    stream, count = SENSORS[scene.sensor].fast, places_m.shape[-1]
    made = [
        simulate_slides(scene, name, count, SimulatedSlide(SPEED_M_S, FORCE_N, SLIDE_S, turned, 0.0, x_m, y_m), rng)
        for name, x_m, y_m, turned in zip(scene.surfaces, *places_m, directions_rad, strict=True)
    ]
    return SlideDataset.from_arrays(
        {'signal': [one for slides in made for one in slides]},
        [name for name in scene.surfaces for _ in range(count)],
        {'signal': stream.rate_hz},
        channels={'signal': stream.channels},
        speed_m_s=SPEED_M_S,
        force_n=FORCE_N,
        direction_rad=directions_rad.ravel().tolist(),
    )


def _simulated_halves(options: BenchmarkOptions) -> Iterator[TrialSet]:
    """Yield the halves of few simulated slides, for a reduced run."""
    slides = simulate(TRAINED, 9, np.random.default_rng(options.seed), conditions=True).in_parts(2)
    trained, there, here = (names_of(slides, *which) for which in (('1-6', '1/2'), ('7-9', '1/2'), ('7-9', '2/2')))
    tested = {
        (DISTANCE, '0'): there,
        (DISTANCE, '1'): here,
        (SPACING, f'1, 7: {BETWEEN}'): here,
        (OTHER, 'simulated'): here,
    }
    yield TrialSet('simulated halves', ('fast', SVC), slides, [Trial('', trained, tested)])


# --------------------
# Other days, fingers, runs and speeds.


def _fingersense(options: BenchmarkOptions) -> Iterator[TrialSet]:
    """Yield each date left out in turn; before the first of them levels are twenty times lower."""
    with imported(options, 'fingersense') as bags:
        slides = SlideDataset.from_bags(bags).select(labels=FABRICS, where=lambda one: one.session >= DATES[0])
    slides, trials = _middles(slides), []
    for date in DATES:
        trained = [one for one in slides if one.session != date]
        surfaces = {one.surface for one in trained}
        left = [one.name for one in slides if one.session == date and one.surface in surfaces]
        trials.append(Trial('', [one.name for one in trained], {(OTHER, 'fingersense, another date'): left}))
    yield TrialSet('dates of fingersense', TAXELS, slides, trials)


def _middles(dataset: SlideDataset) -> SlideDataset:
    """Return slides whose one state of sliding covers at most LONGEST_S of its middle: some last a minute."""

    def middle(slide: LabelledSlide) -> LabelledSlide:
        [state] = slide.sliding
        steady_s = min(state.steady_s, LONGEST_S)
        start_ns = state.stamp_ns + round((state.steady_s - steady_s) / 2 * NANOSECONDS)
        before = [one for one in slide.states if one.stamp_ns < state.stamp_ns]
        return replace(slide, states=[*before, replace(state, stamp_ns=start_ns, steady_s=steady_s)])

    return SlideDataset(tuple(map(middle, dataset)))


def _of_sessions(
    runs: Sequence[tuple[str, str, np.ndarray[Any, Any]]], topic: str, rate_hz: float, sensor: str
) -> SlideDataset:
    """Return slides from surface, session and samples of each."""
    made = SlideDataset.from_arrays(
        {topic: [samples for _, _, samples in runs]},
        [surface for surface, _, _ in runs],
        {topic: rate_hz},
        sensor=sensor,
    )
    return SlideDataset(tuple(replace(x, bag=Path(session)) for x, (_, session, _) in zip(made, runs, strict=True)))


def _spider(options: BenchmarkOptions) -> Iterator[TrialSet]:
    """Yield one session of sandpapers trained, and sessions of the same day, other days and another specimen tested."""
    with np.load(options.recordings('spider_sandpaper') / 'slides.npz', allow_pickle=False) as file:
        runs = [
            (parts[1], parts[0], file[key][:, 4:])
            for key in file.files
            if (parts := key.split('/'))[0] in (SPIDER_TRAINED, *SPIDER)
        ]
    slides = _of_sessions(runs, 'signal_static', SPIDER_HZ, 'spider/cells')
    rows: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for one in slides:
        if one.session in SPIDER:
            rows[OTHER, f'spider_sandpaper, {SPIDER[one.session]}'].append(one.name)
    trained = [one.name for one in slides if one.session == SPIDER_TRAINED]
    days = [one.name for one in slides if one.session in (SPIDER_TRAINED, '2024-02-13b')]
    two = {(OTHER, f'{row}, two sessions trained'): names for (_, row), names in rows.items() if 'same day' not in row}
    yield TrialSet('sessions of spider_sandpaper', TAXELS, slides, [Trial('', trained, rows), Trial('', days, two)])


def _borealtc(options: BenchmarkOptions) -> Iterator[TrialSet]:
    """Yield the first runs of a wheeled robot over each ground trained, and its later runs at other places tested."""
    pieces, trained_runs = [], set()
    length = round(BOREAL_S * BOREAL_HZ)
    with np.load(options.recordings('borealtc') / 'runs.npz', allow_pickle=False) as file:
        keys = sorted(key for key in file.files if key.endswith('/imu'))
        for ground, group in groupby(keys, key=lambda key: key.split('/')[0]):
            own = list(group)
            for number, key in enumerate(own):
                samples = file[key][:, 1:]
                session = key.removesuffix('/imu').replace('/', '-')
                if number < BOREAL_TRAINED * len(own):
                    trained_runs.add(session)
                starts = range(0, len(samples) - length + 1, length)
                step = -(-len(starts) // BOREAL_SLIDES) or 1
                pieces += [(ground, session, samples[start : start + length]) for start in starts[::step]]
    slides = _of_sessions(pieces, 'signal', BOREAL_HZ, 'borealtc/imu')
    trained = [one.name for one in slides if one.session in trained_runs]
    tested = [one.name for one in slides if one.session not in trained_runs]
    trial = Trial('', trained, {(OTHER, 'borealtc, other runs'): tested})
    yield TrialSet('runs of borealtc', ('default', 'fast', SVC), slides, [trial])


def _lmt29(options: BenchmarkOptions) -> Iterator[TrialSet]:
    with imported(options, 'lmt29') as bags:
        slides = SlideDataset.from_bags(bags)
    trial = Trial('', names_of(slides, '1-4'), {(OTHER, 'lmt29, other strokes by hand'): names_of(slides, '5-6')})
    yield TrialSet('strokes of lmt29', ('default', SVC), slides, [trial])


def _ntp21(options: BenchmarkOptions) -> Iterator[TrialSet]:
    """Yield each speed left out in turn, and one half of the path with one of four forces out."""
    with imported(options, 'ntp21') as bags:
        slides = SlideDataset.from_bags(bags)
    names = slides.names
    speeds = slides.condition('speed')
    trials = [
        Trial('', names[speeds != speed].tolist(), {(OTHER, 'ntp21, another speed'): names[speeds == speed].tolist()})
        for speed in np.unique(speeds)
    ]
    yield TrialSet('speeds of ntp21', ('any-speed', SVC), slides, trials)
    # Half a faster slide is shorter than the windows.
    halves = slides.select(where=lambda one: one.speed_m_s < 0.05).in_parts(2)
    names, forces, places = halves.names, halves.condition('force'), halves.condition('place')
    trials = [
        Trial('', names[(forces != force) & (places == place)].tolist(),
              {(OTHER, 'ntp21, the other half'): names[(forces == force) & (places != place)].tolist()})
        for force in np.unique(forces)
        for place in ('1/2', '2/2')
    ]  # fmt: skip
    yield TrialSet('halves of ntp21', ('any-speed', SVC), halves, trials)


SETS = (_biotac20, _fingersense, _spider, _borealtc, _lmt29, _ntp21, _simulated)


# --------------------
# The figures.


def figures(answers: Sequence[Answer]) -> dict[str, Any]:
    """Return how slides end, with intervals over clusters."""
    ends = [one.ends[END] for one in answers]
    correct = np.array([label == one.surface for one, (label, _) in zip(answers, ends, strict=True)])
    accepted = np.array([known for _, known in ends])
    shares = {'accuracy': correct, 'accepted_correct': accepted & correct, 'accepted_wrong': accepted & ~correct}
    clusters = [one.cluster for one in answers]
    wrong = defaultdict(list)
    for one in answers:
        for when, (label, known) in one.ends.items():
            wrong[when].append(known and label != one.surface)
    return {
        'slides': len(answers),
        'clusters': len(set(clusters)),
        **{name: float(which.mean()) for name, which in shares.items()},
        'interval': {
            name: interval(np.stack([which, np.ones(len(which))], axis=1), clusters) for name, which in shares.items()
        },
        'accepted_wrong_at': {when: sum(which) / len(answers) for when, which in wrong.items()},
        'most_accepted_wrong': max(sum(which) / len(answers) for which in wrong.values()),
        'rejections': dict(Counter(one.reason for one in answers if one.reason).most_common()),
    }


def result_of(found: Mapping[Cell, Sequence[Answer]], options: BenchmarkOptions) -> BenchmarkResult:
    """Return the figures of all cells, pooled over the draws and of each, and their chart."""
    pooled: defaultdict[tuple[str, str, str], dict[str, Sequence[Answer]]] = defaultdict(dict)
    for (table, row, name, draw), answers in found.items():
        pooled[table, row, name][draw] = answers
    numbers: dict[str, Any] = {table: {} for table in (DISTANCE, SPACING, HALVES, OTHER)}
    for (table, row, name), draws in pooled.items():
        cell = figures([one for answers in draws.values() for one in answers])
        if len(draws) > 1:
            keys = ('accuracy', 'accepted_correct', 'accepted_wrong', 'most_accepted_wrong')
            each = {draw: figures(answers) for draw, answers in draws.items()}
            cell['draws'] = {draw: {key: own[key] for key in keys} for draw, own in each.items()}
        numbers[table].setdefault(row, {})[name] = cell
    return BenchmarkResult(
        name='generalisation',
        measured=run.__doc__,
        data='simulated halves of slides' if options.quick else DATA_SETS,
        split='one half of the track trained, the other tested' if options.quick else SPLIT,
        numbers=numbers,
        charts=(generalisation_chart(numbers, options.out / 'generalisation.png'),),
    )


DATA_SETS = (
    f'{DATA["biotac20"]}; fingersense: four fabrics on dates of May and June 2021, 16 taxels at a nominal 50 Hz; '
    'spider_sandpaper: four sandpapers, 16 cells at 15.6 Hz, five sessions and two specimens of the sensor; borealtc: '
    f'vibration of a wheeled robot on five grounds; lmt29: sound of 29 textures, by hand; {DATA["ntp21"]}; simulated '
    f'scene {SCENE}'
)
SPLIT = (
    f'biotac20, slides {", ".join(DRAWS)}: one of {CELLS} cells of {CELL_CM} cm trained, all tested; two or four cells '
    'trained, those between and those trained tested; halves of the track with and without a gap, as much left out at '
    f'the far ends as control. fingersense: one date out of {", ".join(DATES)}; spider_sandpaper: {SPIDER_TRAINED} '
    f'trained; borealtc: the first {BOREAL_TRAINED:.0%} of the runs trained, slides of {BOREAL_S:g} s; lmt29: strokes '
    '1-4 trained, 5 and 6 tested; ntp21: one speed out, or one half and one force out; simulated: six slides of one '
    f'track or at six places trained, {NEW_PLACES} new places tested'
)


# --------------------
# The chart.

DRAWN = {'any-place-and-taxels': COLOURS[0], 'default': COLOURS[1], SVC: COLOURS[3], peers.CNN: COLOURS[5]}
LINES = {'accuracy': '-', 'accepted_correct': '--', 'accepted_wrong': ':'}
WORDS = {'accuracy': 'accuracy', 'accepted_correct': 'accepted and correct', 'accepted_wrong': 'accepted but wrong'}


def generalisation_chart(numbers: Mapping[str, Any], path: str | Path) -> Path:
    """Draw how slides end by the distance from the trained track, by the trained places, and on other days."""
    heights = [3.0, *(0.9 + 0.2 * sum(len(cells) + 0.6 for cells in numbers[x].values()) for x in (SPACING, OTHER))]
    with chart(path, (9.0, sum(heights)), points=10.5) as figure:
        parts: Any = figure.subfigures(3, 1, height_ratios=heights)
        _draw_distance(parts[0].subplots(), numbers[DISTANCE])
        spacing, other = (part.subplots() for part in parts[1:])
        _draw_bars(spacing, numbers[SPACING], '2. Several of eight cells trained')
        _draw_bars(other, numbers[OTHER], '3. Another day, finger, run or speed')
        spacing.set_xlabel('')
        handles, labels = other.get_legend_handles_labels()
        other.legend(handles, labels, loc='upper center', bbox_to_anchor=(0.3, -0.6 / heights[2]), ncols=3)
    return Path(path)


def _draw_distance(axes: Any, rows: Mapping[str, Mapping[str, Any]]) -> None:
    steps = sorted(rows, key=int)
    at_cm = [CELL_CM * int(step) for step in steps]
    for name, colour in DRAWN.items():
        cells = [cell for step in steps if (cell := rows[step].get(name))]
        if len(cells) < len(steps):
            continue
        axes.plot([], [], color=colour, label=name)
        for what, dashes in LINES.items():
            if what == 'accuracy' or name not in (SVC, peers.CNN):
                axes.plot(at_cm, [100 * cell[what] for cell in cells], dashes, color=colour, marker='.')
    for what, dashes in LINES.items():
        axes.plot([], [], dashes, color='black', label=WORDS[what])
    axes.set(ylim=(0, 101), xlabel='distance from the trained track (cm)', ylabel='slides (%)')
    axes.set_title('1. One place trained, 0.7 s of sliding', loc='left')
    axes.legend(loc='center left', bbox_to_anchor=(1.0, 0.5))


def _draw_bars(axes: Any, rows: Mapping[str, Mapping[str, Any]], title: str) -> None:
    """Draw accepted and correct in colour, rejected but correct in its shade, accepted but wrong in black."""
    ticks, names, at = [], [], 0.0
    for row, cells in rows.items():
        for name, cell in cells.items():
            correct, wrong, right = (100 * cell[key] for key in ('accepted_correct', 'accepted_wrong', 'accuracy'))
            colour = DRAWN.get(name, COLOURS[2])
            axes.barh(at, correct, 0.85, color=colour)
            axes.barh(at, right - correct, 0.85, left=correct, color=colour, alpha=0.35)
            axes.barh(at, wrong, 0.85, left=100 - wrong, color='black')
            ticks.append(at)
            names.append(f'{row}: {name}')
            at += 1.0
        at += 0.6
    axes.set_yticks(ticks, names, fontsize=8)
    axes.set(xlim=(0, 101), ylim=(at - 0.8, -0.6), xlabel='slides (%)')
    axes.set_title(title, loc='left')
    for label, look in (
        ('accepted and correct', {'color': 'grey'}),
        ('correct, rejected', {'color': 'grey', 'alpha': 0.35}),
        ('accepted but wrong (a peer: wrong)', {'color': 'black'}),
    ):
        axes.barh(0, 0, label=label, **look)

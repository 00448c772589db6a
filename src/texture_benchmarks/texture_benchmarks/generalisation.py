# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What recipes recognise and accept at a distance from what they were trained on: other places, days, fingers, runs."""

from __future__ import annotations

import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.transforms import blended_transform_factory
from sklearn.discriminant_analysis import QuadraticDiscriminantAnalysis
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from texture_benchmarks import peers
from texture_benchmarks.peers import SVC, recipe_of
from texture_benchmarks.study import (
    DATA,
    BenchmarkOptions,
    BenchmarkResult,
    fraction_interval,
    outdated,
    recorded,
    resumed,
    with_spaced_windows,
)
from texture_core.types import NANOSECONDS, Phase, join_batches
from texture_estimation.recipe import FAST_TOPIC, Recipe
from texture_estimation.training import train
from texture_evaluation.charts import COLOURS, chart
from texture_evaluation.cross_validation import predict_slides
from texture_evaluation.metrics import TIMES_S, SlideResult
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
# Slides trained and tested: three draws, each trained before it is tested.
DRAWS = {'1-20 → 21-30': ('1-20', '21-30'), '11-30 → 31-40': ('11-30', '31-40'), '1-20 → 31-40': ('1-20', '31-40')}
LATER_DRAWS = tuple(DRAWS)[1:]
# Parts of ten of the track that are trained, and those that are tested then; also from the other end.
PARTS = 10
Span = tuple[int, int]
GAPS: Sequence[tuple[Span, Mapping[str, Span]]] = (
    ((0, 5), {'same half': (0, 5), 'no gap': (5, 10)}),
    ((0, 4), {'gap of 2.2 cm': (6, 10)}),
    ((1, 5), {'control of 2.2 cm': (5, 9)}),
    ((0, 3), {'gap of 4.4 cm': (7, 10)}),
    ((2, 5), {'control of 4.4 cm': (5, 8)}),
)
# Controls that see no signal: whether the textures differ in how the robot slid over them.
CONTROLS: Mapping[str, Callable[[LabelledSlide], tuple[float, ...]]] = {
    'force and speed alone': lambda one: (one.force_n, one.speed_m_s),
    'direction alone': lambda one: (math.cos(one.direction_rad), math.sin(one.direction_rad)),
}
TAXELS = ('default', 'taxels-any-day', SVC)  # `default` and the peer read the taxels as channels of a vibration
FABRICS, DATES = ('BlackPolymer', 'BlackWool', 'GreenVelvet', 'NavyDenim'), ('2021-05-27', '2021-05-31', '2021-06-01')
LONGEST_S = 8.0  # of a slide over taxels
SPIDER_HZ, SPIDER_TRAINED = 15.6, '2024-02-13'
SPIDER = {'2024-02-13b': 'same day', '2024-02-20am1': 'other day', '2024-02-20am2': 'other day',
          '2024-02-21_sensor2': 'other specimen'}  # fmt: skip
BOREAL_HZ, BOREAL_S, BOREAL_SLIDES, BOREAL_TRAINED = 100.0, 5.0, 12, 0.6  # slides of a run at most, and trained runs
# Trained for the later draws, too; networks take ten times as long.
QUICK_RECIPES = ('any-place-and-taxels', 'any-place', SVC, 'force and speed alone', 'direction alone')
LONG_NS = 2_000_000_000  # slides from here on have enough windows 0.5 s apart
PEER_WINDOWS = WindowParams(length_s=0.5, hop_s=0.25)


class Trial(NamedTuple):
    """One training, and the slides that are tested for each row of a table, by their names."""

    draw: str
    trained: Sequence[str]
    tested: Mapping[tuple[str, str], Sequence[str]]  # by table and row


Trials = tuple[SlideDataset, Sequence[Trial]]  # slides whose features are computed once, and the trials among them


class Answer(NamedTuple):
    """How a slide ended: its label and whether it was accepted, after some times, at the end, once decided."""

    cluster: str  # surface and part or session: slides of one are no independent draws
    surface: str
    ends: Mapping[str, tuple[str, bool]]
    reason: str  # of a rejection at the end


END, DECIDED = 'end', 'decided'
Cell = tuple[str, str, str]  # table, row, draw
Figures = tuple[str, str, str, dict[str, Any]]  # table, row, recipe, figures
FINISHED = 'generalisation.jsonl'  # a line for each recipe on each part, as it is finished
SLOW = ('default', 'vibration-and-taxels')  # begin first; the convolutional network last
QUICK_SET = 'simulated track'


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train recipes and peers at some places, days or fingers, and test them on other slides there and elsewhere.

    Accuracy at the end of a slide, slides accepted and correct, and accepted but wrong; the largest fraction accepted
    but wrong at 0.5, 1 and 2.5 s, once decided, and at the end. Peers have no rejection: each label of theirs counts
    as accepted. 95 % intervals over surface × part, date or run: slides over one track are no independent draws.
    """
    chosen = {QUICK_SET: SETS[QUICK_SET]} if options.quick else SETS
    public = [name for name in chosen if not name.startswith('simulated')]
    absent = [name for name in public if not options.has(name)]
    if public and absent == public:
        options.recordings(public[0])  # which is refused
    if absent:
        print(f"generalisation: '{options.data}' has no {', '.join(absent)}, left out", flush=True)
    slides = {name: source.read(options) for name, source in chosen.items() if name not in absent}
    parts = {
        f'{part}, {recipe}': (name, part, recipe)
        for name in slides
        for part, (recipes, _) in chosen[name].parts.items()
        for recipe in recipes
        if recipe != peers.CNN or peers.available(peers.CNN)
    }
    order = sorted(parts, key=lambda name: (parts[name][2] == peers.CNN, parts[name][2] not in SLOW))
    work = partial(_run_part, slides, options.seed)
    found = resumed(work, {name: parts[name] for name in order}, options.out / FINISHED)
    numbers: dict[str, Any] = {table: {} for table in (DISTANCE, SPACING, HALVES, OTHER)}
    for table, row, recipe, cell in (one for name in parts if name in found for one in found[name]):
        if table not in numbers:
            raise outdated(options.out / FINISHED)
        numbers[table].setdefault(row, {})[recipe] = cell
    numbers['missing'] = [name for name in parts if name not in found]
    numbers['missing'] += [f'{part} (no recordings)' for name in absent for part in SETS[name].parts]
    whole = all(numbers[table] for table in (DISTANCE, SPACING, OTHER))
    return BenchmarkResult(
        data=DATA_SETS,
        split=SPLIT,
        numbers=numbers,
        charts=(generalisation_chart(numbers, options.out / 'generalisation.png'),) if whole else (),
    )


def _run_part(slides: Mapping[str, SlideDataset], seed: int, part: tuple[str, str, str]) -> list[Figures]:
    """Return table, row and figures of each cell of one recipe on one part."""
    source, name, recipe = part
    found: defaultdict[tuple[str, str], dict[str, list[Answer]]] = defaultdict(lambda: defaultdict(list))
    _, make = SETS[source].parts[name]
    for (table, row, draw), answers in answers_of(name, make(slides[source]), seed, recipe_of, recipe):
        found[table, row][draw] += answers
    return [(table, row, recipe, _pooled(draws)) for (table, row), draws in found.items()]


def _pooled(draws: Mapping[str, Sequence[Answer]]) -> dict[str, Any]:
    """Return the figures of all draws together, and the main ones of each."""
    cell = figures([one for answers in draws.values() for one in answers])
    if len(draws) > 1:
        keys = ('accuracy', 'accepted_correct', 'accepted_wrong', 'most_accepted_wrong')
        each = {draw: figures(answers) for draw, answers in draws.items()}
        cell['draws'] = {draw: {key: figures_of_draw[key] for key in keys} for draw, figures_of_draw in each.items()}
    return cell


# --------------------
# One recipe on one part.

# Returns how slides end and why one was rejected, by their names.
Tested = Callable[[Sequence[str]], Mapping[str, tuple[Mapping[str, tuple[str, bool]], str]]]


def answers_of(
    part: str, trials: Trials, seed: int, recipe_named: Callable[[str], Recipe], name: str
) -> list[tuple[Cell, list[Answer]]]:
    """Return what a recipe answers in each trial of a part; its features are computed once."""
    dataset, all_trials = trials
    slides = {one.name: one for one in dataset}
    if name in CONTROLS:
        fit: Callable[[Sequence[str]], Tested] = partial(_control, slides, CONTROLS[name])
    elif name in peers.CLASSIFIERS:
        topics = sorted(dataset[0].signals)
        cut = {key: peers.windows_of(one, topics, PEER_WINDOWS) for key, one in slides.items()}
        windows = {key: found for key, found in cut.items() if len(found)}  # some parts of a track are shorter than one
        fit = partial(_peer, slides, windows, name, seed)
    else:
        long = dataset[0].sliding[-1].stamp_ns - dataset[0].sliding[0].stamp_ns > LONG_NS
        recipe = with_spaced_windows(recipe_named(name)) if name == SVC and long else recipe_named(name)
        fit = _recipe(dataset, recipe, accepts_all=name == SVC)
    found = []
    chosen = [one for one in all_trials if one.draw not in LATER_DRAWS or name in QUICK_RECIPES]
    for number, trial in enumerate(chosen, 1):
        began_s = time.monotonic()
        test = fit(trial.trained)
        for (table, row), names in trial.tested.items():
            answers = [Answer(_cluster(slides[key]), slides[key].surface, *end) for key, end in test(names).items()]
            found.append(((table, row, trial.draw), answers))
        took = f'{time.monotonic() - began_s:.0f} s'
        print(f'{part}, {name}: {number} of {len(chosen)} trainings, {took}', flush=True)
    return found


def _recipe(slides: SlideDataset, recipe: Recipe, *, accepts_all: bool) -> Callable[[Sequence[str]], Tested]:
    """Return what trains a recipe on slides by their names, and returns what tests it on others."""
    if FAST_TOPIC not in slides[0].signals and FAST_TOPIC in recipe.feature_set.topics:  # taxels as a vibration
        slides = SlideDataset(tuple(replace(x, signals={FAST_TOPIC: x.signals['signal_static']}) for x in slides))
    examples, features = training_examples(recipe, slides), slides.features(recipe.feature_set)

    def end_of(result: SlideResult) -> tuple[Mapping[str, tuple[str, bool]], str]:
        early = result.early()
        estimates = {f'{s:g}': after for s in TIMES_S if (after := result.after(s)) is not None}
        estimates |= {DECIDED: early} if early.decided and early.accepted else {}
        estimates |= {END: result.end}
        ends = {when: (one.label, accepts_all or one.accepted) for when, one in estimates.items()}
        return ends, '' if ends[END][1] else result.end.rejection.name.lower()

    def fit(trained: Sequence[str]) -> Tested:
        model = train(recipe, examples.of_slides(trained))
        return lambda names: {
            name: end_of(one) for name, one in predict_slides(model, features.of_slides(names)).items()
        }

    return fit


def _peer(
    slides: Mapping[str, LabelledSlide], windows: Mapping[str, Any], name: str, seed: int, trained: Sequence[str]
) -> Tested:
    """Return what a peer answers by the sum of the logarithms of its probabilities over the windows of a slide."""
    fitted, kept = peers.classifier(name, seed), [one for one in trained if one in windows]
    labels = np.repeat([slides[one].surface for one in kept], [len(windows[one]) for one in kept])
    fitted.fit(np.concatenate([windows[one] for one in kept]), labels)

    def test(names: Sequence[str]) -> Mapping[str, tuple[Mapping[str, tuple[str, bool]], str]]:
        tested = [one for one in names if one in windows]
        found = np.log(fitted.predict_proba(np.concatenate([windows[one] for one in tested])) + 1e-9)
        starts = np.cumsum([0, *(len(windows[one]) for one in tested[:-1])])
        best = fitted.classes_[np.add.reduceat(found, starts).argmax(axis=1)]
        return {one: ({END: (str(label), True)}, '') for one, label in zip(tested, best, strict=True)}

    return test


def _control(
    slides: Mapping[str, LabelledSlide], of: Callable[[LabelledSlide], tuple[float, ...]], trained: Sequence[str]
) -> Tested:
    """Return what a Gaussian for each texture answers by the conditions of slides alone."""
    gaussians = make_pipeline(StandardScaler(), QuadraticDiscriminantAnalysis(reg_param=0.01))
    gaussians.fit([of(slides[one]) for one in trained], [slides[one].surface for one in trained])
    return lambda names: {one: ({END: (str(gaussians.predict([of(slides[one])])[0]), True)}, '') for one in names}


def _cluster(slide: LabelledSlide) -> str:
    return f'{slide.surface} {slide.place or slide.session}'


# --------------------
# Other places of a track: the recorded slides of biotac20, and simulated samples that vary.


def names_of(slides: SlideDataset, numbers: str, *places: str) -> list[str]:
    """Return the names of slides with these numbers, at some places, or at any."""
    return [x.name for x in slides.select(numbers, where=lambda one: not places or one.place in places)]


def _cells(whole: SlideDataset) -> Trials:
    """Return a training in each cell of the track, and in some of them at once, for each draw of slides."""
    slides, trials = whole.in_parts(CELLS), []
    places = [f'{number + 1}/{CELLS}' for number in range(CELLS)]
    for draw, (trained, tested) in DRAWS.items():
        at = [names_of(slides, tested, place) for place in places]
        for cell, place in enumerate(places):
            rows: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
            for other, names in enumerate(at):
                rows[DISTANCE, str(abs(cell - other))] += names
            trials.append(Trial(draw, names_of(slides, trained, place), rows))
        for name, chosen in SPACED.items():
            between = [other for other in range(min(chosen) + 1, max(chosen)) if other not in chosen]
            spaced = {
                (SPACING, f'{name}: between'): [one for other in between for one in at[other]],
                (SPACING, f'{name}: at trained places'): [one for other in chosen for one in at[other]],
            }
            trials.append(Trial(draw, names_of(slides, trained, *(places[cell] for cell in chosen)), spaced))
    return slides, trials


def _stretches(spans: Mapping[str, Span], trained: Span, slides: SlideDataset) -> Trials:
    """Return a training on one stretch of a track from either end, tested on others by their rows."""
    parts = slides.in_parts(PARTS)
    joined: dict[str, LabelledSlide] = {}
    for mirrored in (False, True):
        for span in {trained, *spans.values()}:
            joined |= {one.name: one for one in _joined(parts, _turned(span, mirrored))}
    both = SlideDataset(tuple(joined.values()))
    trials = []
    for draw, (before, after) in DRAWS.items():
        for mirrored in (False, True):
            there = names_of(both, before, _place(_turned(trained, mirrored)))
            tested = {
                (HALVES, row): names_of(both, after, _place(_turned(span, mirrored))) for row, span in spans.items()
            }
            trials.append(Trial(draw, there, tested))
    return both, trials


def _quarters(slides: SlideDataset) -> Trials:
    """Return trainings on three quarters of a track, tested on the fourth."""
    parts, places = slides.in_parts(4), [f'{number}/4' for number in range(1, 5)]
    trials = [
        Trial(
            draw,
            names_of(parts, before, *(other for other in places if other != place)),
            {(HALVES, 'three quarters, the fourth tested'): names_of(parts, after, place)},
        )
        for draw, (before, after) in DRAWS.items()
        for place in places
    ]
    return parts, trials


def _turned(span: Span, mirrored: bool) -> Span:
    return (PARTS - span[1], PARTS - span[0]) if mirrored else span


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
FIRST_OF_TRACK = PLACES + NEW_PLACES
# From the begin of what is trained to that of what is tested.
ANCHOR = {'simulated, same half': 0.0, 'simulated, no gap': 0.055, 'simulated, gap of 2.2 cm': 0.077}
ANCHORED = 12  # slides of each half of a simulated track


def _read_places(options: BenchmarkOptions) -> SlideDataset:
    """Simulate slides at places of a patch, and over one track."""
    scene, rng = load_scene(SCENE), np.random.default_rng(options.seed)
    n_surfaces = len(scene.surfaces)
    places_m = rng.uniform(0.0, PATCH_M, (2, n_surfaces, PLACES + NEW_PLACES))
    turned = rng.uniform(-np.pi, np.pi, places_m.shape[1:])
    astray_m = ASTRAY_M * rng.standard_normal((2, n_surfaces, PLACES))
    scattered, track = (
        slides_at(scene, places_m, turned, rng),
        slides_at(scene, astray_m, 0.0 * turned[:, :PLACES], rng),
    )
    return SlideDataset(
        (*(replace(one, place=f'at {one.number}') for one in scattered),
         *(replace(one, number=FIRST_OF_TRACK + one.number, place='track') for one in track))
    )  # fmt: skip


def _places(slides: SlideDataset) -> Trials:
    """Return six slides of one track, or of six places, trained and new places tested."""
    first = FIRST_OF_TRACK
    new = names_of(slides, f'{PLACES + 1}-{first}')
    trials = [
        Trial(
            '',
            names_of(slides, f'{first + 1}-{first + PLACES}'),
            {(OTHER, 'simulated, new places from one track'): new},
        ),
        Trial('', names_of(slides, f'1-{PLACES}'), {(OTHER, 'simulated, new places from six'): new}),
    ]
    return slides, trials


def _read_track(options: BenchmarkOptions) -> SlideDataset:
    """Simulate slides over the halves of a track."""
    scene, rng = load_scene(SCENE), np.random.default_rng([options.seed, 1])
    starts_m = np.stack([np.repeat(list(ANCHOR.values()), ANCHORED)] * len(scene.surfaces))
    starts_m = np.stack([starts_m, 0.0 * starts_m]) + ASTRAY_M * rng.standard_normal((2, *starts_m.shape))
    halves = slides_at(scene, starts_m, 0.0 * starts_m[0], rng)
    return SlideDataset(tuple(replace(x, place=list(ANCHOR)[(x.number - 1) // ANCHORED]) for x in halves))


def _track(halves: SlideDataset) -> Trials:
    """Return the first two thirds of the slides of one half trained, and the last third of each half tested."""
    first = ANCHORED * 2 // 3
    tested = {
        (HALVES, row): names_of(halves, f'{number * ANCHORED + first + 1}-{(number + 1) * ANCHORED}', row)
        for number, row in enumerate(ANCHOR)
    }
    return halves, [Trial('', names_of(halves, f'1-{first}'), tested)]


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


# --------------------
# Other days, fingers, runs and speeds.


def _read_fingersense(options: BenchmarkOptions) -> SlideDataset:
    """Read the dates from which on levels are alike: before, they are twenty times lower."""
    slides = recorded(options, 'fingersense')
    return _middles(slides.select(labels=FABRICS, where=lambda one: one.session >= DATES[0]))


def _leave_out(row: str, condition: str, slides: SlideDataset) -> Trials:
    """Return each value of a condition left out in turn; tested are surfaces that the others have, too."""
    names, labels, values = slides.names, slides.labels, slides.condition(condition)
    trials = []
    for value in np.unique(values):
        others = values != value
        tested = ~others & np.isin(labels, labels[others])
        trials.append(Trial('', names[others].tolist(), {(OTHER, row): names[tested].tolist()}))
    return slides, trials


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


def _read_spider(options: BenchmarkOptions) -> SlideDataset:
    with np.load(options.recordings('spider_sandpaper') / 'slides.npz', allow_pickle=False) as file:
        runs = [
            (parts[1], parts[0], file[key][:, 4:])
            for key in file.files
            if (parts := key.split('/'))[0] in (SPIDER_TRAINED, *SPIDER)
        ]
    return _of_sessions(runs, 'signal_static', SPIDER_HZ, 'spider/cells')


def _sessions(slides: SlideDataset) -> Trials:
    """Return one session of sandpapers trained, or two of a day, and other sessions tested."""
    rows: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for one in slides:
        if one.session in SPIDER:
            rows[OTHER, f'spider_sandpaper, {SPIDER[one.session]}'].append(one.name)
    trained = [one.name for one in slides if one.session == SPIDER_TRAINED]
    days = [one.name for one in slides if one.session in (SPIDER_TRAINED, '2024-02-13b')]
    two = {(OTHER, f'{row}, two sessions trained'): names for (_, row), names in rows.items() if 'same day' not in row}
    return slides, [Trial('', trained, rows), Trial('', days, two)]


def _read_borealtc(options: BenchmarkOptions) -> SlideDataset:
    """Cut the runs of a wheeled robot into slides."""
    chunks = []
    length = round(BOREAL_S * BOREAL_HZ)
    with np.load(options.recordings('borealtc') / 'runs.npz', allow_pickle=False) as file:
        keys = sorted(key for key in file.files if key.endswith('/imu'))
        for ground, group in groupby(keys, key=lambda key: key.split('/')[0]):
            for key in group:
                samples = file[key][:, 1:]
                session = key.removesuffix('/imu').replace('/', '-')
                starts = range(0, len(samples) - length + 1, length)
                step = -(-len(starts) // BOREAL_SLIDES) or 1
                chunks += [(ground, session, samples[start : start + length]) for start in starts[::step]]
    return _of_sessions(chunks, 'signal', BOREAL_HZ, 'borealtc/imu')


def _runs(slides: SlideDataset) -> Trials:
    """Return the first runs over each ground trained, and its later runs at other places tested."""
    earlier: set[str] = set()
    for _, group in groupby(slides, key=lambda one: one.surface):
        runs = list(dict.fromkeys(one.session for one in group))
        earlier |= set(runs[: math.ceil(BOREAL_TRAINED * len(runs))])
    trained = [one.name for one in slides if one.session in earlier]
    tested = [one.name for one in slides if one.session not in earlier]
    return slides, [Trial('', trained, {(OTHER, 'borealtc, other runs'): tested})]


def _strokes(slides: SlideDataset) -> Trials:
    tested = {(OTHER, 'lmt29, other strokes by hand'): names_of(slides, '5-6')}
    return slides, [Trial('', names_of(slides, '1-4'), tested)]


def _other_half(slides: SlideDataset) -> Trials:
    """Return one half of the path trained, with one of four forces out; half a faster slide is shorter than windows."""
    halves = slides.select(where=lambda one: one.speed_m_s < 0.05).in_parts(2)
    names, forces, places = halves.names, halves.condition('force'), halves.condition('place')
    trials = [
        Trial('', names[(forces != force) & (places == place)].tolist(),
              {(OTHER, 'ntp21, the other half'): names[(forces == force) & (places != place)].tolist()})
        for force in np.unique(forces)
        for place in ('1/2', '2/2')
    ]  # fmt: skip
    return halves, trials


class Source(NamedTuple):
    """A data set: what reads it, and the recipes and the trials of each part of the study that is of it."""

    read: Callable[[BenchmarkOptions], SlideDataset]
    parts: Mapping[str, tuple[Sequence[str], Callable[[SlideDataset], Trials]]]


PLAIN = ('default', SVC)
SETS: Mapping[str, Source] = {
    'biotac20': Source(
        partial(recorded, name='biotac20'),
        {
            'cells': ((*PLACE_RECIPES, SVC, peers.CNN), _cells),
            **{
                ', '.join(spans): (
                    (*PLACE_RECIPES, SVC, peers.CNN, *(CONTROLS if 'no gap' in spans else ())),
                    partial(_stretches, spans, trained),
                )
                for trained, spans in GAPS
            },
            'quarters': ((*PLACE_RECIPES, SVC), _quarters),
        },
    ),
    'fingersense': Source(
        _read_fingersense, {'dates': (TAXELS, partial(_leave_out, 'fingersense, another date', 'session'))}
    ),
    'spider_sandpaper': Source(_read_spider, {'sessions': (TAXELS, _sessions)}),
    'borealtc': Source(_read_borealtc, {'runs': (PLAIN, _runs)}),
    'lmt29': Source(partial(recorded, name='lmt29'), {'strokes': (PLAIN, _strokes)}),
    'ntp21': Source(
        partial(recorded, name='ntp21'),
        {
            'speeds': (('any-speed', SVC), partial(_leave_out, 'ntp21, another speed', 'speed')),
            'other half': (('any-speed', SVC), _other_half),
        },
    ),
    'simulated places': Source(_read_places, {'simulated places': (PLAIN, _places)}),
    QUICK_SET: Source(_read_track, {QUICK_SET: (PLAIN, _track)}),
}


# --------------------
# The figures.


def figures(answers: Sequence[Answer]) -> dict[str, Any]:
    """Return how slides end, with intervals over clusters."""
    ends = [one.ends[END] for one in answers]
    correct = np.array([label == one.surface for one, (label, _) in zip(answers, ends, strict=True)])
    accepted = np.array([known for _, known in ends])
    cases = {'accuracy': correct, 'accepted_correct': accepted & correct, 'accepted_wrong': accepted & ~correct}
    clusters = [one.cluster for one in answers]
    wrong = defaultdict(list)
    for one in answers:
        for when, (label, known) in one.ends.items():
            wrong[when].append(known and label != one.surface)
    return {
        'slides': len(answers),
        'clusters': len(set(clusters)),
        **{name: float(which.mean()) for name, which in cases.items()},
        'interval': {name: fraction_interval(which, clusters) for name, which in cases.items()},
        'accepted_wrong_at': {when: sum(which) / len(answers) for when, which in wrong.items()},
        'most_accepted_wrong': max(sum(which) / len(answers) for which in wrong.values()),
        'rejections': dict(Counter(one.reason for one in answers if one.reason).most_common()),
    }


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

TITLE_CHARACTERS = 62  # of a line as wide as the chart
MATERIALS = 'BioTac (biotac20), 20 materials, same path'
DRAWN = {'any-place-and-taxels': COLOURS[0], 'default': COLOURS[1], SVC: COLOURS[3], peers.CNN: COLOURS[5]}
LINES = {'accuracy': '-', 'accepted_correct': '--', 'accepted_wrong': ':'}
WORDS = {'accuracy': 'accuracy', 'accepted_correct': 'accepted and correct', 'accepted_wrong': 'accepted but wrong'}


def generalisation_chart(numbers: Mapping[str, Any], path: str | Path) -> Path:
    """Draw how slides end by the distance from the trained track, by the trained places, and on other days."""
    # Of the trained places one method of ours and the plain one: the table of the page has all
    few = {
        row: {name: cells[name] for name in (*DRAWN, SVC) if name in cells and name != 'default'}
        for row, cells in numbers[SPACING].items()
    }
    heights = [4.2, *(1.2 + 0.21 * sum(len(cells) + 1.5 for cells in rows.values()) for rows in (few, numbers[OTHER]))]
    with chart(path, (6.0, sum(heights))) as figure:
        parts: Any = figure.subfigures(3, 1, height_ratios=heights)
        distance, spacing, other = (part.subplots() for part in parts)
        _draw_distance(distance, numbers[DISTANCE])
        _draw_bars(spacing, few)
        _draw_bars(other, {f'{row}, n = {_tested(cells)}': cells for row, cells in numbers[OTHER].items()})
        drawn = {
            row: {name: cells[name] for name in DRAWN if name in cells} for row, cells in numbers[DISTANCE].items()
        }
        data = f'{MATERIALS}; {CELL_CM} cm (0.7 s) each, later slides tested'
        for part, title in zip(
            parts,
            (
                f'1. Other places: one of {CELLS} cells trained. {data}, n = {_n_of(drawn)}',
                f'2. Other places: several of {CELLS} cells trained. {data}, n = {_n_of(few)}',
                '3. Tested on another day, finger, run, speed or place than trained: n slides, recorded or simulated',
            ),
            strict=True,
        ):
            part.suptitle(fill(title, TITLE_CHARACTERS), x=0.02, ha='left')
        spacing.set_xlabel('')
        parts[2].legend(*other.get_legend_handles_labels(), loc='outside lower center', ncols=2)
    return Path(path)


def _n_of(rows: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the least and the most slides that methods were tested with in a row, and which methods."""
    names: defaultdict[str, list[str]] = defaultdict(list)
    for name in dict.fromkeys(name for cells in rows.values() for name in cells):
        names[_tested({row: cells[name] for row, cells in rows.items() if name in cells})].append(name)
    return '; '.join(f'{span} ({", ".join(methods)})' for span, methods in names.items())


def _tested(cells: Mapping[str, Any]) -> str:
    found = sorted({cell['slides'] for cell in cells.values()})
    return f'{found[0]}–{found[-1]}' if len(found) > 1 else f'{found[0]}'


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
    axes.figure.legend(*axes.get_legend_handles_labels(), loc='outside lower center', ncols=2)


def _draw_bars(axes: Any, rows: Mapping[str, Mapping[str, Any]]) -> None:
    """Draw accepted and correct in colour, rejected but correct in its shade, accepted but wrong in black."""
    ticks, names, at = [], [], 0.0
    from_the_left = blended_transform_factory(axes.figure.transSubfigure, axes.transData)
    for row, cells in rows.items():
        label = axes.text(0.02, at, row, va='center', fontweight='bold', transform=from_the_left)
        label.set(in_layout=False, bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 0})
        at += 1.0
        for name, cell in cells.items():
            correct, wrong, right = (100 * cell[key] for key in ('accepted_correct', 'accepted_wrong', 'accuracy'))
            colour = DRAWN.get(name, COLOURS[2])
            axes.barh(at, correct, 0.85, color=colour)
            axes.barh(at, right - correct, 0.85, left=correct, color=colour, alpha=0.35)
            axes.barh(at, wrong, 0.85, left=100 - wrong, color='black')
            ticks.append(at)
            names.append(name)
            at += 1.0
        at += 0.5
    axes.set_yticks(ticks, names)
    axes.set(xlim=(0, 101), ylim=(at - 0.8, -0.7), xlabel='slides (%)')
    for label, look in (
        ('accepted and correct', {'color': 'grey'}),
        ('correct, rejected', {'color': 'grey', 'alpha': 0.35}),
        ('accepted but wrong (peers: wrong)', {'color': 'black'}),
    ):
        axes.barh(0, 0, label=label, **look)

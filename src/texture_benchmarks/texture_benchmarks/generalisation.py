# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What recipes recognise and accept at a distance from what they were trained on: other places, days, fingers, runs."""

from __future__ import annotations

import json
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
from texture_benchmarks.study import (
    DATA,
    BenchmarkOptions,
    BenchmarkResult,
    finished_forked,
    imported,
    map_forked,
    with_spaced_windows,
)
from texture_benchmarks.trust import TRAINED, simulate
from texture_core.errors import InvalidData
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
QUARTER = 'three quarters, the fourth tested'
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
# For every draw; networks take ten times as long.
QUICK_RECIPES = ('any-place-and-taxels', 'any-place', SVC, 'force and speed alone', 'direction alone')
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
Figures = tuple[str, str, str, dict[str, Any]]  # table, row, recipe, figures
Reader = Callable[[BenchmarkOptions], SlideDataset]
Readers = Mapping[str, Reader]
FINISHED = 'generalisation.jsonl'  # a line for each recipe on each set, as it is finished
SLOW = ('default', 'vibration-and-taxels')  # begin first; the convolutional network last


def run(options: BenchmarkOptions, readers: Readers | None = None) -> BenchmarkResult:
    """Train recipes and peers at some places, days or fingers, and test them on other slides there and elsewhere.

    Accuracy at the end of a slide, slides accepted and correct, and accepted but wrong; the largest fraction accepted
    but wrong at 0.5, 1 and 2.5 s, once decided, and at the end. Peers have no rejection: each label of theirs counts
    as accepted. 95 % intervals by bootstrap over surface × part, date or run: slides over one track are no independent
    draws.
    """
    sets = REDUCED if options.quick else SETS
    slides = _read_all(list(dict.fromkeys(one.data for one in sets.values())), options, readers or READERS)
    parts = [(name, recipe) for name, one in sets.items() for recipe in one.recipes if one.data in slides]
    if not peers.available(peers.CNN):
        parts = [part for part in parts if part[1] != peers.CNN]
    # What was finished before, in the same folder, is not computed again.
    path = options.out / FINISHED
    options.out.mkdir(parents=True, exist_ok=True)
    found = _finished(path)
    if found:
        print(f"{len(found)} parts are of an earlier run, from '{path}'; remove it to compute all again", flush=True)
    left = [part for part in parts if ', '.join(part) not in found]
    left.sort(key=lambda part: (part[1] == peers.CNN, part[1] not in SLOW))
    work = partial(_run_part, slides, options.seed)
    with path.open('a', encoding='utf-8') as file:
        for part, cells in finished_forked(work, left, options.workers, options.budget_s):
            found[', '.join(part)] = cells
            file.write(json.dumps({'part': ', '.join(part), 'cells': cells}) + '\n')
            file.flush()
    missing = [part for part in map(', '.join, parts) if part not in found]
    missing += [f'{name} (no recordings)' for name, one in sets.items() if one.data not in slides]
    if not missing:
        path.unlink()
    return result_of(found, missing, options)


def _read_all(names: Sequence[str], options: BenchmarkOptions, readers: Readers) -> dict[str, SlideDataset]:
    """Return the sets that are there, by their names; where no recorded one is, refuse with what the first lacks."""
    read = {name: _read(readers[name], options) for name in names}
    slides = {name: found for name, found in read.items() if isinstance(found, SlideDataset)}
    refused = [error for error in read.values() if isinstance(error, InvalidData)]
    if refused and all(name.startswith('simulated') for name in slides):
        raise refused[0]
    for error in refused:
        print(f'generalisation: {error}', flush=True)
    return slides


def _read(reader: Reader, options: BenchmarkOptions) -> SlideDataset | InvalidData:
    try:
        return reader(options)
    except InvalidData as error:
        return error


def _finished(path: Path) -> dict[str, list[Figures]]:
    """Return the figures of the parts in a file, by their names."""
    lines = path.read_text(encoding='utf-8').splitlines() if path.is_file() else []
    return {line['part']: line['cells'] for line in map(json.loads, lines)}


def _run_part(slides: Mapping[str, SlideDataset], seed: int, part: tuple[str, str]) -> list[Figures]:
    """Return table, row and figures of each cell of one recipe on one set."""
    name, recipe = part
    source = {**SETS, **REDUCED}[name]
    found: defaultdict[tuple[str, str], dict[str, list[Answer]]] = defaultdict(lambda: defaultdict(list))
    for (table, row, _, draw), answers in answers_of(source.make(slides[source.data]), seed, recipe_of, recipe):
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
        recipe = with_spaced_windows(recipe_named(name)) if name == SVC and long else recipe_named(name)
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
        return estimate.label, accepts_all or estimate.accepted

    ends = {f'{s:g}': of(end) for s in TIMES_S if (end := result.after(s)) is not None}
    early = result.early()
    if early.decided and early.accepted:
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


def _cells_of(slides: SlideDataset) -> TrialSet:
    cells = slides.in_parts(CELLS)
    return TrialSet('cells of biotac20', cells, _cells(cells))


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


def _stretches(spans: Mapping[str, Span], trained: Span, slides: SlideDataset) -> TrialSet:
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
            trials.append(Trial(draw, there, tested, draw == FIRST_DRAW))
    return TrialSet(f'biotac20, {", ".join(spans)}', both, trials)


def _quarters(slides: SlideDataset) -> TrialSet:
    """Return trainings on three quarters of a track, tested on the fourth."""
    parts, places = slides.in_parts(4), [f'{number}/4' for number in range(1, 5)]
    trials = [
        Trial(
            draw,
            names_of(parts, before, *(other for other in places if other != place)),
            {(HALVES, QUARTER): names_of(parts, after, place)},
            draw == FIRST_DRAW,
        )
        for draw, (before, after) in DRAWS.items()
        for place in places
    ]
    return TrialSet('quarters of biotac20', parts, trials)


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


def _places(slides: SlideDataset) -> TrialSet:
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
    return TrialSet('simulated places', slides, trials)


def _read_track(options: BenchmarkOptions) -> SlideDataset:
    """Simulate slides over the halves of a track."""
    scene, rng = load_scene(SCENE), np.random.default_rng([options.seed, 1])
    n_surfaces = len(scene.surfaces)
    starts_m = np.stack([np.repeat(list(ANCHOR.values()), ANCHORED)] * n_surfaces)
    starts_m = np.stack([starts_m, 0.0 * starts_m]) + ASTRAY_M * rng.standard_normal((2, *starts_m.shape))
    halves = slides_at(scene, starts_m, 0.0 * starts_m[0], rng)
    return SlideDataset(tuple(replace(x, place=list(ANCHOR)[(x.number - 1) // ANCHORED]) for x in halves))


def _track(halves: SlideDataset) -> TrialSet:
    tested = {(HALVES, row): names_of(halves, _last(number), row) for number, row in enumerate(ANCHOR)}
    return TrialSet('simulated track', halves, [Trial('', names_of(halves, f'1-{ANCHORED * 2 // 3}'), tested)])


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


def _read_halves(options: BenchmarkOptions) -> SlideDataset:
    return simulate(TRAINED, 9, np.random.default_rng(options.seed), conditions=True)


def _simulated_halves(whole: SlideDataset) -> TrialSet:
    """Return the halves of few simulated slides, for a reduced run."""
    slides = whole.in_parts(2)
    trained, there, here = (names_of(slides, *which) for which in (('1-6', '1/2'), ('7-9', '1/2'), ('7-9', '2/2')))
    tested = {
        (DISTANCE, '0'): there,
        (DISTANCE, '1'): here,
        (SPACING, f'1, 7: {BETWEEN}'): here,
        (OTHER, 'simulated'): here,
    }
    return TrialSet('simulated halves', slides, [Trial('', trained, tested)])


# --------------------
# Other days, fingers, runs and speeds.


def _read_fingersense(options: BenchmarkOptions) -> SlideDataset:
    """Read the dates from which on levels are alike: before, they are twenty times lower."""
    with imported(options, 'fingersense') as bags:
        slides = SlideDataset.from_bags(bags).select(labels=FABRICS, where=lambda one: one.session >= DATES[0])
    return _middles(slides)


def _dates(slides: SlideDataset) -> TrialSet:
    """Return each date left out in turn."""
    trials = []
    for date in DATES:
        trained = [one for one in slides if one.session != date]
        surfaces = {one.surface for one in trained}
        left = [one.name for one in slides if one.session == date and one.surface in surfaces]
        trials.append(Trial('', [one.name for one in trained], {(OTHER, 'fingersense, another date'): left}))
    return TrialSet('dates of fingersense', slides, trials)


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


def _sessions(slides: SlideDataset) -> TrialSet:
    """Return one session of sandpapers trained, or two of a day, and other sessions tested."""
    rows: defaultdict[tuple[str, str], list[str]] = defaultdict(list)
    for one in slides:
        if one.session in SPIDER:
            rows[OTHER, f'spider_sandpaper, {SPIDER[one.session]}'].append(one.name)
    trained = [one.name for one in slides if one.session == SPIDER_TRAINED]
    days = [one.name for one in slides if one.session in (SPIDER_TRAINED, '2024-02-13b')]
    two = {(OTHER, f'{row}, two sessions trained'): names for (_, row), names in rows.items() if 'same day' not in row}
    return TrialSet('sessions of spider_sandpaper', slides, [Trial('', trained, rows), Trial('', days, two)])


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


def _runs(slides: SlideDataset) -> TrialSet:
    """Return the first runs over each ground trained, and its later runs at other places tested."""
    trained: list[str] = []
    tested: list[str] = []
    for _, group in groupby(slides, key=lambda one: one.surface):
        slides_of_material = list(group)
        runs = list(dict.fromkeys(one.session for one in slides_of_material))
        earlier = set(runs[: math.ceil(BOREAL_TRAINED * len(runs))])
        for one in slides_of_material:
            (trained if one.session in earlier else tested).append(one.name)
    return TrialSet('runs of borealtc', slides, [Trial('', trained, {(OTHER, 'borealtc, other runs'): tested})])


def _strokes(slides: SlideDataset) -> TrialSet:
    trial = Trial('', names_of(slides, '1-4'), {(OTHER, 'lmt29, other strokes by hand'): names_of(slides, '5-6')})
    return TrialSet('strokes of lmt29', slides, [trial])


def _speeds(slides: SlideDataset) -> TrialSet:
    """Return each speed left out in turn."""
    names, speeds = slides.names, slides.condition('speed')
    trials = [
        Trial('', names[speeds != speed].tolist(), {(OTHER, 'ntp21, another speed'): names[speeds == speed].tolist()})
        for speed in np.unique(speeds)
    ]
    return TrialSet('speeds of ntp21', slides, trials)


def _other_half(slides: SlideDataset) -> TrialSet:
    """Return one half of the path trained, with one of four forces out; half a faster slide is shorter than windows."""
    halves = slides.select(where=lambda one: one.speed_m_s < 0.05).in_parts(2)
    names, forces, places = halves.names, halves.condition('force'), halves.condition('place')
    trials = [
        Trial('', names[(forces != force) & (places == place)].tolist(),
              {(OTHER, 'ntp21, the other half'): names[(forces == force) & (places != place)].tolist()})
        for force in np.unique(forces)
        for place in ('1/2', '2/2')
    ]  # fmt: skip
    return TrialSet('halves of ntp21', halves, trials)


def _read_bags(name: str, options: BenchmarkOptions) -> SlideDataset:
    with imported(options, name) as bags:
        return SlideDataset.from_bags(bags)


def _read_biotac20(options: BenchmarkOptions) -> SlideDataset:
    """Read the materials in parallel processes: one after the other takes minutes."""
    names = sorted(path.stem for path in options.recordings('biotac20').glob('material*.npz'))
    return SlideDataset(tuple(one for slides in map_forked(partial(_read_material, options), names) for one in slides))


def _read_material(options: BenchmarkOptions, name: str) -> tuple[LabelledSlide, ...]:
    with imported(options, 'biotac20', materials=[name]) as bags:
        return SlideDataset.from_bags(bags).slides


class Source(NamedTuple):
    """A set of trials: the recordings that it is of, the recipes that are tried, and what makes the trials."""

    data: str
    recipes: Sequence[str]
    make: Callable[[SlideDataset], TrialSet]


READERS: Readers = {
    **{name: partial(_read_bags, name) for name in ('lmt29', 'ntp21')},
    'biotac20': _read_biotac20,
    'fingersense': _read_fingersense,
    'spider_sandpaper': _read_spider,
    'borealtc': _read_borealtc,
    'simulated places': _read_places,
    'simulated track': _read_track,
    'simulated halves': _read_halves,
}
SETS: Mapping[str, Source] = {
    'cells': Source('biotac20', (*PLACE_RECIPES, SVC, peers.CNN), _cells_of),
    **{
        ', '.join(spans): Source(
            'biotac20',
            (*PLACE_RECIPES, SVC, peers.CNN, *(CONTROLS if 'no gap' in spans else ())),
            partial(_stretches, spans, trained),
        )
        for trained, spans in GAPS
    },
    'quarters': Source('biotac20', (*PLACE_RECIPES, SVC), _quarters),
    'dates': Source('fingersense', TAXELS, _dates),
    'sessions': Source('spider_sandpaper', TAXELS, _sessions),
    'runs': Source('borealtc', ('default', SVC), _runs),
    'strokes': Source('lmt29', ('default', SVC), _strokes),
    'speeds': Source('ntp21', ('any-speed', SVC), _speeds),
    'other half': Source('ntp21', ('any-speed', SVC), _other_half),
    'simulated places': Source('simulated places', ('default', SVC), _places),
    'simulated track': Source('simulated track', ('default', SVC), _track),
}
REDUCED: Mapping[str, Source] = {'simulated halves': Source('simulated halves', ('default', SVC), _simulated_halves)}


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
        'interval': {
            name: interval(np.stack([which, np.ones(len(which))], axis=1), clusters) for name, which in cases.items()
        },
        'accepted_wrong_at': {when: sum(which) / len(answers) for when, which in wrong.items()},
        'most_accepted_wrong': max(sum(which) / len(answers) for which in wrong.values()),
        'rejections': dict(Counter(one.reason for one in answers if one.reason).most_common()),
    }


def result_of(
    found: Mapping[str, Sequence[Figures]], missing: Sequence[str], options: BenchmarkOptions
) -> BenchmarkResult:
    """Return the figures of all cells, their chart, and the missing parts."""
    numbers: dict[str, Any] = {table: {} for table in (DISTANCE, SPACING, HALVES, OTHER)}
    for table, row, name, cell in (one for cells in found.values() for one in cells):
        numbers[table].setdefault(row, {})[name] = cell
    numbers['missing'] = list(missing)
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

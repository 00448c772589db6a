# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What recipes recognise across borders: at another place, on another day, with another finger."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.discriminant_analysis import QuadraticDiscriminantAnalysis
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from texture_benchmarks.disturbances import ROWS, TRAINED, disturbed, simulate
from texture_benchmarks.places import NEW_PLACES, PATCH_M, SCENE, slides_at
from texture_benchmarks.places import PLACES as PLACES_TRAINED
from texture_benchmarks.study import DATA, BenchmarkOptions, BenchmarkResult, imported, map_forked
from texture_core.types import NANOSECONDS, Rejection, TextureEstimate
from texture_estimation.recipe import FAST_TOPIC, Recipe, load_recipe
from texture_estimation.training import train
from texture_evaluation.charts import COLOURS, chart
from texture_evaluation.cross_validation import interval, predict_slides
from texture_evaluation.metrics import TIMES_S, SlideResult
from texture_evaluation.train import training_examples
from texture_features.feature_set import read_recipe
from texture_recordings.dataset import LabelledSlide, SlideDataset
from texture_simulation.scene import load_scene

SAME, PLACE, DAY, FINGER = 'same track', 'other place', 'other day', 'other finger'
BORDERS = (PLACE, DAY, FINGER, SAME)
RESPONSE_DB = 2.0  # of the other finger
# Peers: the typical spectrum of each window, and a general classifier. They have no novelty of their own: what is known
# is decided as for the recipes.
PEERS: Mapping[str, Mapping[str, Any]] = {
    'SVC on log bands': {'svm_rbf': {'c': 10.0}},
    '1-NN on log bands': {'sklearn': {'estimator': 'sklearn.neighbors:KNeighborsClassifier', 'n_neighbors': 1}},
}
# Controls that see no signal: whether the textures differ in how the robot slid over them.
CONTROLS: Mapping[str, Callable[[LabelledSlide], tuple[float, ...]]] = {
    'force and speed alone': lambda one: (one.force_n, one.speed_m_s),
    'direction alone': lambda one: (math.cos(one.direction_rad), math.sin(one.direction_rad)),
}
PLACES = ('any-place', 'any-place-and-taxels')
VIBRATION = (*PLACES, 'default', 'fast', 'vibration-and-taxels', *PEERS)
TAXELS = ('taxels-any-day', 'taxels', 'fast', *PEERS)  # `fast` and the peers read the taxels as channels of a vibration
ARRAY = ('any-speed', 'taxels-signal', *PEERS)
SOUND = ('default', *PEERS)
FABRICS, DATES = ('BlackPolymer', 'BlackWool', 'GreenVelvet', 'NavyDenim'), ('2021-05-27', '2021-05-31', '2021-06-01')
COMPLETE = ('BeigeCotton', 'BrownCotton', 'Canvas', 'Linen')  # fabrics with all runs
EARLIER, LATER = '21-30', '31-40'
LONGEST_S = 8.0  # of a slide over taxels


@dataclass(frozen=True, eq=False)
class BorderTrial:
    """One training, and what is tested across each border."""

    data: str
    recipes: Sequence[str]
    trained: SlideDataset
    tested: Mapping[str, SlideDataset]  # By border


def recipe_of(name: str) -> Recipe:
    """Return a released recipe, or a peer."""
    if name not in PEERS:
        return load_recipe(name)
    _, content = read_recipe('fast')
    inputs = {FAST_TOPIC: {'features': [{'mean_log_bands': {'bands': 32}}]}}
    plain = {'inputs': inputs, 'learner': PEERS[name], 'evidence': 'soft_vote', 'training': {'hop_s': 0.25}}
    return Recipe.from_mapping({**content, **plain}, name)


def for_recipe(dataset: SlideDataset, recipe: Recipe) -> SlideDataset:
    """Return the slides with slow taxels read as a vibration, where a recipe needs one and there is none."""
    if FAST_TOPIC in dataset[0].signals or FAST_TOPIC not in recipe.feature_set.topics:
        return dataset
    return SlideDataset(tuple(replace(one, signals={FAST_TOPIC: one.signals['signal_static']}) for one in dataset))


def across_places(dataset: SlideDataset, trained: SlideDataset) -> Mapping[str, SlideDataset]:
    """Return the parts of other slides, as far as there are any, at the places trained and at the others."""
    places = set(trained.condition('place'))
    there = {SAME: [one for one in dataset if one.place in places], PLACE: []}
    there[PLACE] = [one for one in dataset if one.place not in places]
    return {border: SlideDataset(tuple(slides)) for border, slides in there.items() if slides}


def middles(dataset: SlideDataset) -> SlideDataset:
    """Return slides whose one state of sliding covers at most LONGEST_S of its middle: some last a minute."""

    def middle(slide: LabelledSlide) -> LabelledSlide:
        [state] = slide.sliding
        steady_s = min(state.steady_s, LONGEST_S)
        start_ns = state.stamp_ns + round((state.steady_s - steady_s) / 2 * NANOSECONDS)
        before = [one for one in slide.states if one.stamp_ns < state.stamp_ns]
        return replace(slide, states=[*before, replace(state, stamp_ns=start_ns, steady_s=steady_s)])

    return SlideDataset(tuple(map(middle, dataset)))


def _having(name: str, *values: str, but: bool = False) -> Callable[[LabelledSlide], bool]:
    """Return what says of a slide whether an attribute of it is one of these values, or is none of them."""
    return lambda slide: (getattr(slide, name) in values) is not but


def _with_other_finger(slides: SlideDataset) -> SlideDataset:
    row = ROWS['another finger']
    rng = np.random.default_rng(0)
    return SlideDataset(tuple(disturbed(one, row, RESPONSE_DB, rng) for one in slides))


def _biotac20(options: BenchmarkOptions) -> Iterator[BorderTrial]:
    with imported(options, 'biotac20') as bags:
        slides = SlideDataset.from_bags(bags, '21-40')
    halves, quarters = slides.in_parts(2), slides.in_parts(4)
    for place in ('1/2', '2/2'):
        trained = halves.select(EARLIER, where=_having('place', place))
        tested = across_places(halves.select(LATER), trained)
        yield BorderTrial(
            'biotac20 halves', (*VIBRATION, *CONTROLS), trained, {**tested, FINGER: _with_other_finger(tested[SAME])}
        )
    for place in ('1/4', '2/4', '3/4', '4/4'):
        trained = quarters.select(EARLIER, where=_having('place', place, but=True))
        other = {PLACE: across_places(quarters.select(LATER), trained)[PLACE]}
        yield BorderTrial('biotac20 quarters', (*PLACES, 'default', 'vibration-and-taxels', *PEERS), trained, other)


def _ntp21(options: BenchmarkOptions) -> Iterator[BorderTrial]:
    with imported(options, 'ntp21') as bags:
        halves = SlideDataset.from_bags(bags).in_parts(2)
    halves = halves.select(where=lambda one: one.speed_m_s < 0.05)  # half a faster slide is shorter than the windows
    forces = halves.condition('force')
    for force in np.unique(forces):
        left, rest = halves.take(forces == force), halves.take(forces != force)
        for place in ('1/2', '2/2'):
            trained = rest.select(where=_having('place', place))
            yield BorderTrial('ntp21 halves', ARRAY, trained, across_places(left, trained))


def _fabricslide(options: BenchmarkOptions) -> Iterator[BorderTrial]:
    with imported(options, 'fabricslide') as bags:
        halves = middles(SlideDataset.from_bags(bags).select(labels=COMPLETE).in_parts(2))
    first, second = (halves.take(halves.condition('number') % 2 == odd) for odd in (1, 0))  # repeats
    for place in ('1/2', '2/2'):
        trained = first.select(where=_having('place', place))
        yield BorderTrial('fabricslide halves', TAXELS, trained, across_places(second, trained))


def fingersense(options: BenchmarkOptions, since: str = DATES[0]) -> Iterator[BorderTrial]:
    """Yield each date left out in turn, and every other slide; before the first of them levels are twenty times lower.

    Parameters
    ----------
    options
        Where the recordings lie.
    since
        First date of the training.
    """
    with imported(options, 'fingersense') as bags:
        slides = SlideDataset.from_bags(bags).select(labels=FABRICS, where=lambda one: one.session >= since)
    slides = middles(slides)
    for date in DATES:
        trained = slides.select(where=_having('session', date, but=True))
        known = set(trained.labels.tolist())
        left = slides.select(labels=known, where=_having('session', date))
        yield BorderTrial('fingersense dates', TAXELS, trained, {DAY: left})
    odd, even = (slides.take(slides.condition('number') % 2 == odd) for odd in (1, 0))
    yield BorderTrial('fingersense dates', TAXELS, odd, {SAME: even.select(where=_having('session', *DATES))})


def _lmt29(options: BenchmarkOptions) -> Iterator[BorderTrial]:
    with imported(options, 'lmt29') as bags:
        slides = SlideDataset.from_bags(bags)
    yield BorderTrial('lmt29 recordings', SOUND, slides.select('1-4'), {PLACE: slides.select('5-6')})


def _simulated(options: BenchmarkOptions) -> Iterator[BorderTrial]:
    """Yield the halves of few simulated slides, for a quick run."""
    halves = simulate(TRAINED, 9, np.random.default_rng(options.seed), told=True).in_parts(2)
    trained = halves.select('1-6', where=lambda one: one.place == '1/2')
    yield BorderTrial('simulated halves', ('fast', *PEERS), trained, across_places(halves.select('7-9'), trained))


def _simulated_places(options: BenchmarkOptions) -> Iterator[BorderTrial]:
    """Yield six places of each surface trained, the same and new places tested."""
    scene, rng = load_scene(SCENE), np.random.default_rng(options.seed)
    places_m = rng.uniform(0.0, PATCH_M, (2, len(scene.surfaces), PLACES_TRAINED + NEW_PLACES))
    directions = rng.uniform(-np.pi, np.pi, places_m.shape[1:])
    once, again = (slides_at(scene, places_m, directions, rng) for _ in range(2))
    once, again = (
        SlideDataset(tuple(replace(one, place=f'at {one.number}') for one in slides)) for slides in (once, again)
    )
    trained = once.select(f'1-{PLACES_TRAINED}')
    yield BorderTrial('simulated places', ('default', 'fast', *PEERS), trained, across_places(again, trained))


SETS: Mapping[str, Callable[[BenchmarkOptions], Iterator[BorderTrial]]] = {
    'biotac20': _biotac20,
    'fingersense': fingersense,
    'ntp21': _ntp21,
    'fabricslide': _fabricslide,
    'lmt29': _lmt29,
    'simulated': _simulated_places,
}


def run(options: BenchmarkOptions) -> BenchmarkResult:
    """Train recipes and peers on one side of a border, and test them on slides of the other side and of the same.

    Slides whose label is right at the end, that are right and known, and that are wrong and known; the same after
    given times; slides that are wrong at the first decided estimate. 95 % intervals by bootstrap over surfaces × parts
    (or dates): slides over one track are no independent draws.
    """
    found: dict[Cell, list[SlideAnswer]] = {}
    for make in [_simulated] if options.quick else SETS.values():
        found |= tried(list(make(options)))
    return result_of(found, options)


Cell = tuple[str, str, str]  # border, data and recipe


def tried(
    trials: Sequence[BorderTrial], recipe_named: Callable[[str], Recipe] = recipe_of
) -> Mapping[Cell, list[SlideAnswer]]:
    """Return what each recipe says of the slides of each border."""
    found: defaultdict[Cell, list[SlideAnswer]] = defaultdict(list)
    jobs = [(index, name) for index, trial in enumerate(trials) for name in trial.recipes]
    for (index, name), tested in zip(jobs, map_forked(partial(_try, trials, recipe_named), jobs), strict=True):
        for border, results in tested.items():
            found[border, trials[index].data, name] += results
    return found


def result_of(found: Mapping[Cell, Sequence[SlideAnswer]], options: BenchmarkOptions) -> BenchmarkResult:
    """Return the figures of all cells and their chart."""
    numbers: dict[str, Any] = {border: {} for border in BORDERS}
    for (border, data, name), results in found.items():
        numbers[border].setdefault(data, {})[name] = figures(results)
    return BenchmarkResult(
        name='borders',
        measured=run.__doc__,
        data=f'simulated scene {SCENE}' if options.quick else DATA_SETS,
        split='simulated halves' if options.quick else SPLIT,
        numbers=numbers,
        charts=(borders_chart(numbers, options.out / 'borders.png'),),
    )


DATA_SETS = (
    f'{DATA["biotac20"]}; {DATA["ntp21"]}; fabricslide: four complete fabrics, 16 capacitive taxels; fingersense: four '
    'fabrics on dates of May and June 2021, 16 taxels at a nominal 50 Hz; lmt29: sound of 29 textures, by hand; '
    f'simulated scene {SCENE}'
)
SPLIT = (
    f'biotac20: one half, or three quarters, of the path of slides {EARLIER} trained, slides {LATER} tested, the other '
    f'finger by a random smooth response of {RESPONSE_DB:g} dB on the same half; ntp21: one half and one force out, '
    'slides of 20 and 40 mm/s; fabricslide: one half and one repeat out; fingersense: one date out of '
    f'{", ".join(DATES)}, trained on the others, same days by every other slide; lmt29: recordings 1-4 '
    'trained, 5 and 6 tested; simulated: six places trained, the same and eight new ones tested. Of slides over taxels '
    f'at most {LONGEST_S:g} s from the middle'
)


@dataclass(frozen=True, eq=False)
class SlideAnswer:
    """What a recipe says of one slide."""

    cluster: str  # surface and part or session: slides of one are no independent draws
    result: SlideResult


def control(trial: BorderTrial, name: str) -> dict[str, list[SlideAnswer]]:
    """Return what a Gaussian for each texture says of slides by the conditions of a control; it never says known."""
    conditions = CONTROLS[name]
    gaussians = make_pipeline(StandardScaler(), QuadraticDiscriminantAnalysis(reg_param=0.01))
    gaussians.fit([conditions(one) for one in trial.trained], trial.trained.labels)
    found = {}
    for border, slides in trial.tested.items():
        said = zip(slides, gaussians.predict([conditions(one) for one in slides]), strict=True)
        found[border] = [_unknown(one, str(label)) for one, label in said]
    return found


def _unknown(slide: LabelledSlide, label: str) -> SlideAnswer:
    estimate = TextureEstimate(0, slide.name, label, Rejection.NOVEL)
    return SlideAnswer(_cluster(slide), SlideResult(slide.surface, [label], [estimate]))


def _cluster(slide: LabelledSlide) -> str:
    return f'{slide.surface} {slide.place or slide.session}'


def _try(
    trials: Sequence[BorderTrial], recipe_named: Callable[[str], Recipe], job: tuple[int, str]
) -> dict[str, list[SlideAnswer]]:
    if job[1] in CONTROLS:
        return control(trials[job[0]], job[1])
    trial, recipe = trials[job[0]], recipe_named(job[1])
    model = train(recipe, training_examples(recipe, for_recipe(trial.trained, recipe)))
    found = {}
    for border, slides in trial.tested.items():
        features = for_recipe(slides, recipe).features(recipe.feature_set)
        clusters = {one.name: _cluster(one) for one in slides}
        results = predict_slides(model, features)
        found[border] = [SlideAnswer(clusters[name], result) for name, result in results.items()]
    return found


def figures(tested: Sequence[SlideAnswer]) -> dict[str, Any]:
    """Return how slides end, with intervals over clusters, and how they stand after the usual times."""
    results = [one.result for one in tested]
    shares = _shares([(result.end, result.surface) for result in results])
    early = [(result.early(), result.surface) for result in results]
    wrong = [end.decided and end.known and end.label != surface for end, surface in early]
    names = sorted({one.cluster for one in tested})
    row = np.array([names.index(one.cluster) for one in tested])
    return {
        'slides': len(tested),
        'clusters': len(names),
        **{name: float(np.mean(which)) for name, which in shares.items()},
        # Where a fabric was recorded more often than others, its clusters are larger: here each counts alike.
        'mean_of_clusters': {
            name: float(np.mean(np.bincount(row, which) / np.bincount(row))) for name, which in shares.items()
        },
        'slides_of_clusters': dict(zip(names, np.bincount(row).tolist(), strict=True)),
        'decided_wrong': float(np.mean(wrong)),
        'interval': {
            name: interval(np.stack([which, np.ones(len(which))], axis=1), row) for name, which in shares.items()
        },
        'after_s': {f'{seconds:g}': _after(results, seconds) for seconds in TIMES_S},
    }


def _after(results: Sequence[SlideResult], seconds: float) -> dict[str, float] | None:
    reached = [(end, one.surface) for one in results if (end := one.after(seconds)) is not None]
    if not reached:
        return None
    return {'slides': len(reached), **{name: float(np.mean(which)) for name, which in _shares(reached).items()}}


def _shares(ends: Sequence[tuple[TextureEstimate, str]]) -> dict[str, list[bool]]:
    return {
        'right': [end.label == surface for end, surface in ends],
        'accepted_correct': [end.known and end.label == surface for end, surface in ends],
        'accepted_wrong': [end.known and end.label != surface for end, surface in ends],
    }


def borders_chart(numbers: Mapping[str, Mapping[str, Mapping[str, Any]]], path: str | Path) -> Path:
    """Draw how slides end on the same track and across each border: a bar for each recipe, a dot for its labels."""
    pairs = [(border, data) for border in BORDERS if border != SAME for data in numbers[border]]
    counts = [len(numbers[border][data]) for border, data in pairs]
    with chart(path, (9.0, 1.2 + 0.22 * (sum(counts) + 2 * len(counts))), '') as figure:
        grid = figure.subplots(len(pairs), 2, sharex=True, squeeze=False, height_ratios=counts)
        for axes, (border, data) in zip(grid, pairs, strict=True):
            names = list(numbers[border][data])
            same = numbers[SAME].get(data, {})
            for side, cells, title in ((axes[0], same, SAME), (axes[1], numbers[border][data], border)):
                _bars(side, [cells.get(name) for name in names])
                side.set_title(f'{data}: {title}', fontsize=9)
                side.set(ylim=(len(names) - 0.4, -0.6), xlim=(0, 101))
            axes[0].set_yticks(range(len(names)), names, fontsize=8)
            axes[1].set_yticks(range(len(names)), [''] * len(names))
        for axes in grid[-1]:
            axes.set_xlabel('slides (%)')
        handles, labels = grid[0, 1].get_legend_handles_labels()
        figure.legend(handles, labels, loc='outside lower center', ncols=4)
    return Path(path)


def _bars(axes: Any, cells: Sequence[Mapping[str, Any] | None]) -> None:
    for row, cell in enumerate(cells):
        if cell is None:
            continue
        right, wrong = 100 * cell['accepted_correct'], 100 * cell['accepted_wrong']
        named = not row
        axes.barh(row, right, color=COLOURS[2], label='right and known' if named else '')
        axes.barh(row, 100 - right - wrong, left=right, color='#d9d9d9', label='unknown' if named else '')
        axes.barh(row, wrong, left=100 - wrong, color=COLOURS[5], label='wrong and known' if named else '')
        share = 100 * cell['right']
        low, high = (100 * edge for edge in cell['interval']['right'])
        errors = [[max(0.0, share - low)], [max(0.0, high - share)]]
        label = 'label right, 95 % interval' if named else ''
        axes.errorbar(share, row, xerr=errors, fmt='o', color='black', markersize=3, linewidth=1, label=label)
    if not any(cells):
        axes.text(50, (len(cells) - 1) / 2, 'not tested on the same track', ha='center', va='center', fontsize=8)

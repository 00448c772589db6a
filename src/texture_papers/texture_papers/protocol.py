# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Experiments of papers on simulated surfaces: what was done, by which recipes, over which seeds."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import re
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import lru_cache, partial
from importlib.metadata import version
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray
from scipy.stats import t
from sklearn.model_selection import BaseCrossValidator, RepeatedStratifiedKFold, ShuffleSplit, StratifiedShuffleSplit

from texture_core.errors import UnknownName
from texture_core.types import AnyArray, Array
from texture_estimation.learners.learner import Codes, of_examples
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.roughness import load_roughness_recipe
from texture_evaluation.charts import REDUCED, is_reduced
from texture_papers.roberge import UNDECIDED, decided_by_slide, fitted_predictor
from texture_papers.search import QUICK, Found, SearchParams, Tuned, search, tuned_pairs
from texture_papers.slides import Mask, Slides, Visits, gather, kinds_of
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import Scene, load_scene

NORMAL_95 = 1.959964


@dataclass(frozen=True)
class Interval:
    """A figure and the interval that holds it with 95 %: other slides over the same surfaces would give another one."""

    value: float
    low: float
    high: float

    def positive(self) -> bool | None:
        """Return whether the figure is above 0; None if the interval includes 0."""
        if self.low > 0.0:
            return True
        return False if self.high < 0.0 else None

    def less(self, limit: float) -> Interval:
        """Return how much the figure is above a limit."""
        return Interval(self.value - limit, self.low - limit, self.high - limit)

    def as_json(self) -> list[float]:
        """Return value, low and high, rounded."""
        return [round(self.value, 4), round(self.low, 4), round(self.high, 4)]


def wilson(right: Array) -> Interval:
    """Return the accuracy of slides (Wilson's interval)."""
    n, p, z2 = len(right), float(np.mean(right)), NORMAL_95**2
    middle = (p + z2 / (2 * n)) / (1 + z2 / n)
    reach = NORMAL_95 * np.sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
    # Where all or none are right, rounding may leave the fraction just outside.
    return Interval(p, min(p, float(middle - reach)), max(p, float(middle + reach)))


def mean(values: Array) -> Interval:
    """Return the mean over slides, such as that of differences between two methods on the same slides."""
    centre = float(np.mean(values))
    reach = NORMAL_95 * math.sqrt(_uncertainty(values))
    return Interval(centre, centre - reach, centre + reach)


def difference(first: Array, second: Array) -> Interval:
    """Return how much higher the mean of the first is, of slides that are not the same; (n,) and (m,)."""
    centre = float(np.mean(first) - np.mean(second))
    reach = NORMAL_95 * math.sqrt(_uncertainty(first) + _uncertainty(second))
    return Interval(centre, centre - reach, centre + reach)


def _uncertainty(values: Array) -> float:
    """Return the variance of a mean; one value does not determine it."""
    return float(np.var(values, ddof=1)) / len(values) if len(values) > 1 else math.inf


@dataclass(frozen=True, eq=False)
class MethodResult:
    """Decisions on all slides."""

    surfaces: tuple[str, ...]
    codes: Codes
    conditions: NDArray[np.str_]
    decided: NDArray[np.intp]
    trained_on: NDArray[np.bool_]
    train_s: float

    @property
    def learning(self) -> float | None:
        """Accuracy on the training slides; None if none is used for training as a whole."""
        return float((self.decided == self.codes)[self.trained_on].mean()) if self.trained_on.any() else None

    @property
    def tested(self) -> NDArray[np.bool_]:
        """Which slides were held out in some split, (n_slides,)."""
        return np.asarray(~self.trained_on.all(axis=0))

    @property
    def test(self) -> Interval:
        """Accuracy on the held-out slides."""
        return wilson(self.right())

    @property
    def unclassified(self) -> float:
        """Fraction of the held-out slides that are unclassified."""
        return float((self.decided == UNDECIDED)[~self.trained_on].mean())

    @property
    def confusion(self) -> AnyArray:
        """Fraction of the test slides of each surface (row) with each label, or unclassified (last)."""
        n = len(self.surfaces)
        table = np.zeros((n, n + 1))
        true, got = np.broadcast_to(self.codes, self.decided.shape)[~self.trained_on], self.decided[~self.trained_on]
        np.add.at(table, (true, np.where(got == UNDECIDED, n, got)), 1.0)
        return table / np.maximum(table.sum(axis=1, keepdims=True), 1.0)

    def right(self, of: NDArray[np.bool_] | None = None) -> Array:
        """Return how often each slide was recognised when held out, (n_tested,); `of` (n_slides,) chooses."""
        return self._tested(self.decided == self.codes, of)

    def taken_for(self, first: str, second: str, of: NDArray[np.bool_] | None = None) -> Array:
        """Return how often each slide was misidentified as the other one of two surfaces, (n_tested,)."""
        pair = [self.surfaces.index(first), self.surfaces.index(second)]
        other = np.select([self.codes == pair[0], self.codes == pair[1]], [pair[1], pair[0]], default=UNDECIDED - 1)
        return self._tested(self.decided == other, of)

    def wrong(self) -> Array:
        """Return how often each slide was misidentified as another surface, (n_tested,), without unclassified ones."""
        return self._tested((self.decided != self.codes) & (self.decided != UNDECIDED))

    def nothing(self) -> Array:
        """Return how often each slide was unclassified, (n_tested,)."""
        return self._tested(self.decided == UNDECIDED)

    def pairs(self) -> list[tuple[str, str]]:
        """Return all pairs of surfaces, those confused most often first."""
        n = len(self.surfaces)
        table = self.confusion[:, :n]
        both = table + table.T
        order = sorted(zip(*np.triu_indices(n, k=1), strict=True), key=lambda place: -both[place])
        return [(self.surfaces[first], self.surfaces[second]) for first, second in order]

    def _tested(self, events: NDArray[np.bool_], of: NDArray[np.bool_] | None = None) -> Array:
        chosen = self.tested if of is None else self.tested & of
        times = (~self.trained_on).sum(axis=0)[chosen]
        return (events & ~self.trained_on).sum(axis=0)[chosen] / times


# What of scikit-learn makes the splits, given `random_state`; or the condition whose slides are all that is trained on.
Splitter = Callable[..., BaseCrossValidator] | str


@dataclass(frozen=True)
class Figures:
    """Figures that a paper reports of a method, 0 to 1; None if it does not."""

    learning: float | None = None
    test: float | None = None
    unclassified: float | None = None  # of the test slides


BY_SPLIT, ON_ALL = 'slides of the split', 'all slides'


@dataclass(frozen=True)
class Method:
    """A recipe on trial."""

    recipe: str
    paper: Figures = Figures()
    learner: Mapping[str, Any] = field(default_factory=dict)
    label: str = ''
    views: tuple[int, ...] = ()
    training: str = BY_SPLIT
    sets: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    search: SearchParams | None = None  # the paper's, or smaller; None: not searched for
    of_whole: str = ''  # the recipe of whole scans, whose variables the parts of a vote have

    @property
    def name(self) -> str:
        """Name in the table."""
        return self.label or self.recipe


@dataclass(frozen=True)
class RecognitionTask:
    """Surfaces to recognise, how they are touched, and what tries to."""

    name: str
    visits: tuple[Visits, ...]
    methods: tuple[Method, ...]
    surfaces: tuple[str, ...] = ()


@dataclass(frozen=True)
class Finding:
    """Something a paper found, and whether it is found here."""

    claim: str
    here: str
    interval: Interval
    built_in: str = ''
    by_texture: Mapping[str, float] = field(default_factory=dict)

    @property
    def holds(self) -> bool | None:
        """Whether the claim holds; None if the interval does not decide."""
        return self.interval.positive()


MethodResults = Mapping[tuple[str, str], MethodResult]  # (task, method) -> what came out


@dataclass(frozen=True)
class Anchor:
    """The one reported figure by which the difficulty of a scene is set: the accuracy on test slides."""

    task: str
    method: str
    test: float
    source: str
    setting: str = 'noise of the fast channels'
    experiment: str = ''  # whose figure it is, if not this one's
    shortfall: str = ''


@dataclass(frozen=True)
class PaperProtocol:
    """A paper's experiment."""

    name: str
    scene: str
    paper: str
    tasks: tuple[RecognitionTask, ...]
    divide: Splitter
    split: str
    anchor: Anchor | None  # of a scene whose difficulty was set
    findings: Callable[[MethodResults], Sequence[Finding]]
    quick_count: int = 8
    by_condition: bool = False


def halves(count: int) -> Splitter:
    """Return what draws random halves, each surface halved."""
    return partial(StratifiedShuffleSplit, count, train_size=0.5)


def folds(count: int, repeats: int) -> Splitter:
    """Return what holds out each part of the slides in turn, each surface assigned at random, several times."""
    return partial(RepeatedStratifiedKFold, n_splits=count, n_repeats=repeats)


def drawn(fraction: float, count: int) -> Splitter:
    """Return what draws this fraction of all slides for training, whatever their surface."""
    return partial(ShuffleSplit, count, train_size=fraction)


def divided(splitter: Splitter, codes: Codes, conditions: NDArray[np.str_], seed: int) -> Mask:
    """Return which slides each split trains on, (n_splits, n_slides), of the surface and condition of each slide."""
    if isinstance(splitter, str):
        return (conditions == splitter)[None, :]
    splits = splitter(random_state=int(np.random.default_rng(seed).integers(2**31))).split(codes, codes)
    return np.array([np.isin(np.arange(len(codes)), training) for training, _ in splits])


@dataclass(frozen=True)
class Experiment:
    """Where an experiment writes, its seed, whether to hurry, whether to search, and on how many cores."""

    out: Path
    seed: int = 0
    quick: bool = False
    tune: bool = False
    jobs: int = 1


CPU_INFO = Path('/proc/cpuinfo')


def machine() -> str:
    """Return the processor, how many of its cores there are, and the Python in use."""
    lines = CPU_INFO.read_text(encoding='utf-8', errors='replace').splitlines() if CPU_INFO.exists() else []
    models = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    model = models[0] if models else platform.machine()
    return f'{model}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}'


@dataclass(frozen=True)
class ExperimentResult:
    """The numbers of one experiment, and what was measured on what."""

    name: str
    measured: str
    data: str
    split: str
    numbers: Mapping[str, Any]
    charts: tuple[Path, ...] = ()

    def lines(self) -> Iterator[str]:
        """Yield our figures next to the paper's, and the findings, as text: means over seeds if there are any."""
        seeds = self.numbers.get('seeds', [self.numbers['seed']])
        yield f'over {len(seeds)} seeds: mean, and its interval of 95 %' if seeds[1:] else f'seed {seeds[0]}'
        for task, methods in self.numbers.get('tasks', {}).items():
            for method, figures in methods.items():
                value, low, high = (100 * part for part in figures.get('over_seeds', figures['test']))
                paper = figures.get('paper', {}).get('test')
                shown = '' if paper is None else f'; paper {100 * paper:.1f} %'
                yield f'  {task}, {method}: {value:.1f} % ({low:.1f} to {high:.1f}){shown}'
        for name, parts in self.numbers.get('regressors', {}).items():
            for part, figures in parts.items():
                paper = self.numbers.get('paper', {}).get(name, {}).get(part)
                shown = '' if paper is None else f'; paper {paper:.2f}'
                error = figures.get('over_seeds', [figures['error'] or math.nan])[0]
                yield f'  {name}, {part} textures: error {error:.2f} grades{shown}'
        for name, facts in self.numbers.get('tuning', {}).items():
            yield f'  searched {name}: {facts["size"]}'
        for finding in self.numbers['findings']:
            value, low, high = finding.get('over_seeds', finding['interval'])
            yield f'  {finding["verdict"]:14} {finding["claim"]}: {value:+.3f} ({low:+.3f} to {high:+.3f})'
            yield f'  {"":14} here {finding["here"]}'
            if why := finding.get('built_in'):
                yield f'  {"":14} built in, not found: {why}'

    def write(self, out: Path) -> Path:
        """Write the JSON and return its path."""
        out.mkdir(parents=True, exist_ok=True)
        part_of = f'{REDUCED}; part of: ' if is_reduced.get() else ''
        content = {
            'name': self.name,
            **({'reduced': REDUCED} if is_reduced.get() else {}),
            'measured': self.measured,
            'data': part_of + self.data,
            'split': part_of + self.split,
            'machine': machine(),
            'numbers': self.numbers,
            'charts': [chart.name for chart in self.charts],
        }
        path = out / f'{self.name}.json'
        path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + '\n', encoding='utf-8')
        return path


Run = Callable[[Experiment], ExperimentResult]


# What of `training` decides the label after a whole slide. The rest decides on early ends and on what is outside.
DECISIVE_OF_TRAINING = frozenset({'augmentation', 'false_rejection_rate', 'hop_s', 'start_weight'})
# Values with which a parameter of evidence rule or learner changes nothing: stored digests are older than it.
NEUTRAL = {'late_weight': 1.0, 'passes': 1}
SUITE_CLASS = re.compile(r'texture_papers\.\w+:(\w+)')


def digest_of(recipe: str) -> str:
    """Return eight letters of what of a shipped recipe, by its name, decides the label after a whole slide.

    Descriptions, the tare of inputs, and rules for ending a slide early do not count.
    """
    try:
        definition = load_recipe(recipe).as_mapping()
    except UnknownName:
        definition = load_roughness_recipe(recipe).as_mapping()
    text = SUITE_CLASS.sub(_short_name, json.dumps(_decisive(definition), sort_keys=True))
    return hash_of(json.loads(text))


def hash_of(content: Any) -> str:
    """Return eight letters of plain values."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:8]


# Libraries that decide a figure, each with as many parts of its version as a change of it may move one.
LIBRARIES = {'numpy': 1, 'scipy': 2, 'scikit-learn': 2}


def versions() -> str:
    """Return the versions of the libraries that decide a figure."""
    return ', '.join(f'{name} {".".join(version(name).split(".")[:parts])}' for name, parts in LIBRARIES.items())


def digest_of_row(protocol: PaperProtocol, task: RecognitionTask, method: Method, *, tuned: bool = False) -> str:
    """Return eight letters of all that decides a row of figures, but for the seed.

    The recipe as it is run, the motions, the slides of each split of seed 0; and of a few slides of each kind the
    strength of the signals, the features, and what the learner, trained on half of them, takes each for: so they change
    with the code of simulation, features, learner and evidence.
    """
    recipe = recipe_of(method)
    surfaces = task.surfaces or tuple(load_scene(protocol.scene).surfaces)
    trained_on = divided(protocol.divide, *kinds_of(surfaces, task.visits, 0), 0)
    few, levels = probe(protocol.scene, surfaces, task.visits, slow=SLOW in recipe.feature_set.topics)
    half = np.array([np.count_nonzero(few.codes[:place] == code) % 2 == 0 for place, code in enumerate(few.codes)])
    with warnings.catch_warnings():
        warnings.filterwarnings('ignore', 'The number of unique classes', UserWarning)  # two slides of each on purpose
        outcome = evaluate_method(recipe, few, half[None], method.views, training=method.training)
    values, _ = few.extract(recipe.feature_set, method.views)
    definition = {key: value for key, value in _decisive(recipe.as_mapping()).items() if key != 'training'}
    settings = [
        method.training,
        method.views,
        sorted(method.sets),
        recipe.training.hop_s,
        str(method.search if tuned else None),
    ]
    visits = [{**asdict(one), 'sliding': _set(one.sliding)} for one in task.visits]
    return hash_of([definition, visits, settings, hashlib.sha256(trained_on.tobytes()).hexdigest(), levels,
                     strength(values), outcome.decided.tolist()])  # fmt: skip


@lru_cache(maxsize=4)
def probe(scene: str, surfaces: tuple[str, ...], visits: tuple[Visits, ...], *, slow: bool) -> tuple[Slides, list[str]]:
    """Return two slides of each kind over each surface, and the strength and roughness of their signals."""
    few = gather(load_scene(scene), surfaces, [replace(one, count=2) for one in visits], 0, slow=slow)
    streams = [stream.samples for view in few.views for stream in view.streams.values()]
    return few, [text for one in streams for part in (one, np.diff(one, axis=1)) for text in strength(part)]


def strength(values: AnyArray) -> list[str]:
    """Return the strength of each column to four digits: rounding on another machine changes none of them."""
    return [f'{level:.4g}' for level in np.sqrt(np.square(values).mean(axis=tuple(range(values.ndim - 1))))]


def _set(sliding: SimulatedSlide) -> dict[str, Any]:
    """Return what of a motion is not as by default: a field that is new changes no digest."""
    values = {one.name: (getattr(sliding, one.name), one.default) for one in fields(sliding)}
    return {name: value for name, (value, default) in values.items() if value is not default and value != default}


def _short_name(found: re.Match[str]) -> str:
    """Return 'region_peaks' of 'texture_papers.jamali:RegionPeaks': the module of a class decides nothing."""
    return re.sub(r'(?<!^)(?=[A-Z])', '_', found.group(1)).lower()


def _decisive(definition: Mapping[str, Any]) -> dict[str, Any]:
    decisive = {name: value for name, value in definition.items() if name != 'description'}
    if 'inputs' in decisive:
        decisive['inputs'] = {
            name: {key: value for key, value in part.items() if key != 'tare'}
            for name, part in decisive['inputs'].items()
        }
    for section in {'evidence', 'learner'} & decisive.keys():
        decisive[section] = {
            chosen: {key: value for key, value in params.items() if NEUTRAL.get(key) != value}
            if isinstance(params, Mapping)
            else params
            for chosen, params in decisive[section].items()
        }
    if 'training' in decisive:
        decisive['training'] = {
            name: value for name, value in decisive['training'].items() if name in DECISIVE_OF_TRAINING
        }
    return decisive


SLOW = 'signal_static'
TunedRecipes = Mapping[tuple[str, str], Tuned]  # by task and method
NONE: TunedRecipes = {}


def outcomes(
    protocol: PaperProtocol, scene: Scene, seed: int, *, quick: bool, tuned: TunedRecipes = NONE
) -> MethodResults:
    """Return what comes out of each method in each task."""
    return {
        (task.name, method): outcome
        for task in protocol.tasks
        for method, outcome in of_task(protocol, task, scene, seed, quick=quick, tuned=tuned)
    }


def of_task(
    protocol: PaperProtocol,
    task: RecognitionTask,
    scene: Scene,
    seed: int,
    *,
    quick: bool,
    tuned: TunedRecipes = NONE,
) -> Iterator[tuple[str, MethodResult]]:
    """Yield what comes out of each method in one task.

    One that was searched for is tried on the first split alone: in the others it would be tested on slides that the
    search has seen.
    """
    slides, trained_on = _gathered(protocol, task, scene, seed, quick=quick)
    for method in task.methods:
        found = tuned.get((task.name, method.name))
        if tuned and not found:
            continue
        recipe, splits = (found.recipe, trained_on[:1]) if found else (recipe_of(method), trained_on)
        yield method.name, evaluate_method(recipe, slides, splits, method.views, training=method.training)


SEARCHES = 'searches.jsonl'


def searched(protocol: PaperProtocol, experiment: Experiment) -> TunedRecipes:
    """Return the recipes with variables for each pair of textures, searched on what the first split is trained on.

    Each search is a line of a file in the folder of the results, written when it is done: another call continues there.
    """
    path = experiment.out / SEARCHES
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = path.read_text(encoding='utf-8').splitlines() if path.is_file() else []
    done = {line['search']: Found(**line['found']) for line in map(json.loads, lines)}
    tuned = {}
    for task in protocol.tasks:
        slides, trained_on = _gathered(
            protocol, task, load_scene(protocol.scene), experiment.seed, quick=experiment.quick
        )
        scans = slides.views[0].of(trained_on[0])
        of_pair = {pair: scans.of(np.isin(scans.labels, pair)) for pair in combinations(sorted(slides.surfaces), 2)}
        found: dict[str, dict[tuple[str, ...], Found]] = {'': {}}
        for method in task.methods:
            if not method.search:
                continue
            params = replace(QUICK if experiment.quick else method.search, seed=experiment.seed)
            digest = digest_of_row(protocol, task, method, tuned=True)
            names = {
                pair: f'{protocol.name}, {task.name}, {method.name}, {pair}, {params!r}, {digest}' for pair in of_pair
            }
            due = [pair for pair, name in names.items() if name not in done]
            # The search for parts begins with the best of that for whole scans.
            begun = {pair: one.best for pair, one in found[method.of_whole].items()}
            calls = [
                delayed(search)(recipe_of(method), of_pair[pair], params, start=begun.get(pair, ())) for pair in due
            ]
            for pair, one in zip(due, Parallel(n_jobs=experiment.jobs, return_as='generator')(calls), strict=True):
                done[names[pair]] = one
                with path.open('a', encoding='utf-8') as file:
                    file.write(json.dumps({'search': names[pair], 'found': asdict(one)}) + '\n')
            found[method.name] = {pair: done[name] for pair, name in names.items()}
            tuned[task.name, method.name] = tuned_pairs(
                recipe_of(method), params, found[method.name], len(scans.labels)
            )
    return tuned


def _gathered(
    protocol: PaperProtocol, task: RecognitionTask, scene: Scene, seed: int, *, quick: bool
) -> tuple[Slides, Mask]:
    """Return the slides of a task, and which of them each split is trained on."""
    task = reduced(task, protocol.quick_count) if quick else task
    slow = any(SLOW in recipe_of(method).feature_set.topics for method in task.methods)
    slides = gather(scene, task.surfaces, task.visits, seed, slow=slow)
    return slides, divided(protocol.divide, slides.codes, slides.conditions, seed)


def recipe_of(method: Method) -> Recipe:
    """Return the recipe as the protocol defines it."""
    recipe = load_recipe(method.recipe)
    learner: Any = recipe.learner
    return replace(recipe, learner=replace(learner, **method.learner))


def evaluate_method(
    recipe: Recipe,
    slides: Slides,
    trained_on: Mask,
    views: Sequence[int] = (),
    *,
    training: str = BY_SPLIT,
) -> MethodResult:
    """Learn from the slides of each split and evaluate all."""
    to_learn = replace(recipe.feature_set, windows=recipe.training_windows)
    trained, owner = slides.extract(to_learn, views)
    tested_values, _ = slides.extract(recipe.feature_set, views)
    learner = of_examples(recipe.learner, slides.names(to_learn, views), slides.surfaces)
    windows = recipe.feature_set.windows
    rows_of = trained_on[:, owner] if training == BY_SPLIT else np.ones((1, len(owner)), dtype=bool)
    decided = np.empty((len(rows_of), len(slides.codes)), dtype=np.intp)
    began = time.perf_counter()
    for number, rows in enumerate(rows_of):
        predictor = fitted_predictor(learner, trained[rows], slides.codes[owner[rows]], owner[rows])
        decided[number] = decided_by_slide(
            predictor(tested_values), len(slides.codes), recipe.evidence, windows.hop_s / windows.length_s
        )
    taken_s = (time.perf_counter() - began) / len(rows_of)
    known = trained_on if training == BY_SPLIT else np.zeros(decided.shape, dtype=bool)
    return MethodResult(slides.surfaces, slides.codes, slides.conditions, decided, known, taken_s)


def reduced(task: RecognitionTask, count: int) -> RecognitionTask:
    """Return the task with fewer slides: this many over each surface, as equally as may be among the visits."""
    each = max(1, count // len(task.visits))
    visits = tuple(replace(visit, count=min(visit.count, each)) for visit in task.visits)
    return replace(task, visits=visits)


LEVEL = 0.95
VERDICTS = {True: 'holds', False: 'does not hold', None: 'not decided'}


def with_seeds(first: Mapping[str, Any], others: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the numbers of the first seed with mean and interval over all seeds next to each figure and finding."""
    numbers: dict[str, Any] = json.loads(json.dumps(first))
    runs = [numbers, *others]
    numbers['seeds'] = [run['seed'] for run in runs]
    for task, methods in numbers.get('tasks', {}).items():
        for method, figures in methods.items():
            same = [run['tasks'][task][method] for run in runs]
            _add(figures, [one['test'][0] for one in same], fraction=True)
            figures['means'] = {
                key: mean_over_seeds([one[key] for one in same]).as_json()
                for key in ('learning', 'unclassified')
                if figures.get(key) is not None and len(same) > 1
            }
            for kind in ('conditions', 'sets'):
                for name, part in figures.get(kind, {}).items():
                    _add(part, [one[kind][name]['test'][0] for one in same], fraction=True)
    for regressor, parts in numbers.get('regressors', {}).items():
        for part, figures in parts.items():
            of_seeds = [run['regressors'][regressor] for run in runs]
            _regressor_over_seeds(figures, [one[part] for one in of_seeds if part in one])
    for finding in numbers['findings']:
        same = [one for run in runs for one in run['findings'] if one['claim'] == finding['claim']]
        _add(finding, [one['interval'][0] for one in same])
        if finding.get('by_texture') and len(same) > 1:  # seeds are other slides over the same few textures
            names = [name for name in finding['by_texture'] if all(name in one['by_texture'] for one in same)]
            means = [float(np.mean([one['by_texture'][name] for one in same])) for name in names]
            finding['over_seeds'] = mean_over_seeds(means).as_json()
        if 'over_seeds' in finding:
            finding['verdict'] = VERDICTS[Interval(*finding['over_seeds']).positive()]
    return numbers


def _regressor_over_seeds(figures: dict[str, Any], same: Sequence[Mapping[str, Any]]) -> None:
    """Add mean and interval of the error of a regressor over seeds, and of its other figures, and over textures."""
    _add(figures, [one['error'] for one in same])
    if len(same) > 1:
        keys = ('error_none_as_0', 'std', 'without_grade')
        figures['means'] = {key: mean_over_seeds([one[key] for one in same]).as_json() for key in keys}
    errors = [
        float(np.mean([one['by_texture'][name] for one in same if name in one['by_texture']]))
        for name in figures['by_texture']
    ]
    figures['over_textures'] = mean_over_seeds(errors).as_json()
    worst = int(np.argmax(errors))
    figures['worst'] = [list(figures['by_texture'])[worst], round(errors[worst], 2)]


def mean_over_seeds(values: Sequence[float]) -> Interval:
    """Return the mean of one figure of each seed or texture, and its interval by Student's t, 95 %."""
    array = np.asarray(values, dtype=np.float64)
    centre, n = float(array.mean()), len(array)
    reach = float(t.ppf(0.5 + LEVEL / 2.0, n - 1) * array.std(ddof=1) / np.sqrt(n))
    return Interval(centre, centre - reach, centre + reach)


def _add(figures: dict[str, Any], found: Sequence[float], *, fraction: bool = False) -> None:
    """Add values and interval of the seeds, which is cut to the range of fractions."""
    if len(found) > 1:
        figures['by_seed'] = list(found)
        interval = mean_over_seeds(found).as_json()
        figures['over_seeds'] = [min(max(value, 0.0), 1.0) for value in interval] if fraction else interval

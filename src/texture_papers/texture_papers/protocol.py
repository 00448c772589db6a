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
import tempfile
import time
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.stats import t
from sklearn.model_selection import BaseCrossValidator, RepeatedStratifiedKFold, ShuffleSplit, StratifiedShuffleSplit

from texture_core.config import find, writing
from texture_core.errors import InvalidData, InvalidParameter, UnknownName
from texture_core.types import AnyArray, Array, Samples
from texture_estimation.learners.learner import Codes, of_examples
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.roughness import load_roughness_recipe
from texture_estimation.search import (
    UNDECIDED,
    ClassificationTask,
    LabelledWindows,
    RecipeSpace,
    RoughnessTask,
    SearchParams,
    SearchResult,
    SearchSlides,
    decided_by_slide,
    optimise,
    space_for,
)
from texture_evaluation.cross_validation import workers
from texture_features.feature_set import FeatureSet, InputFeatures
from texture_features.features.temporal import Stretched
from texture_features.windows import SEPARATOR, WindowBatch, WindowParams, axis_along
from texture_simulation.offline import simulate_slide_streams
from texture_simulation.path import SimulatedSlide
from texture_simulation.scene import Scene
from texture_simulation.sensor_models import SENSORS
from texture_simulation.surfaces import Curved

NORMAL_95 = 1.959964


@dataclass(frozen=True)
class Interval:
    """A figure and the interval that holds it with 95 %: other slides over the same surfaces would give another one."""

    value: float
    low: float
    high: float

    def positive(self) -> bool | None:
        """Tell whether the figure is above 0; None if the interval does not tell."""
        if self.low > 0.0:
            return True
        return False if self.high < 0.0 else None

    def less(self, border: float) -> Interval:
        """Return how much the figure is above a border."""
        return Interval(self.value - border, self.low - border, self.high - border)

    def as_json(self) -> list[float]:
        """Return value, low and high, rounded."""
        return [round(self.value, 4), round(self.low, 4), round(self.high, 4)]


def share(right: Array) -> Interval:
    """Return the share of slides that are right (Wilson's interval)."""
    n, p, z2 = len(right), float(np.mean(right)), NORMAL_95**2
    middle = (p + z2 / (2 * n)) / (1 + z2 / n)
    reach = NORMAL_95 * np.sqrt(p * (1 - p) / n + z2 / (4 * n * n)) / (1 + z2 / n)
    # Where all or none are right, rounding may leave the share just outside.
    return Interval(p, min(p, float(middle - reach)), max(p, float(middle + reach)))


def mean(values: Array) -> Interval:
    """Return the mean over slides, such as that of differences between two methods on the same slides."""
    centre = float(np.mean(values))
    reach = NORMAL_95 * math.sqrt(_uncertainty(values))
    return Interval(centre, centre - reach, centre + reach)


def apart(first: Array, second: Array) -> Interval:
    """Return how much higher the mean of the first is, of slides that are not the same; (n,) and (m,)."""
    centre = float(np.mean(first) - np.mean(second))
    reach = NORMAL_95 * math.sqrt(_uncertainty(first) + _uncertainty(second))
    return Interval(centre, centre - reach, centre + reach)


def _uncertainty(values: Array) -> float:
    """Return the variance of a mean; one value says nothing of it."""
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
    note: str = ''

    @property
    def learning(self) -> float | None:
        """Share of the training slides that are recognised; None if none is used for training as a whole."""
        return float((self.decided == self.codes)[self.trained_on].mean()) if self.trained_on.any() else None

    @property
    def tested(self) -> NDArray[np.bool_]:
        """Which slides were held out in some split, (n_slides,)."""
        return np.asarray(~self.trained_on.all(axis=0))

    @property
    def test(self) -> Interval:
        """Share of the slides held out that are recognised."""
        return share(self.right())

    @property
    def unclassified(self) -> float:
        """Share of the slides held out that are taken for nothing."""
        return float((self.decided == UNDECIDED)[~self.trained_on].mean())

    @property
    def confusion(self) -> AnyArray:
        """Share of the test slides of each surface (row) that are taken for each surface, or for nothing (last)."""
        n = len(self.surfaces)
        table = np.zeros((n, n + 1))
        true, said = np.broadcast_to(self.codes, self.decided.shape)[~self.trained_on], self.decided[~self.trained_on]
        np.add.at(table, (true, np.where(said == UNDECIDED, n, said)), 1.0)
        return table / np.maximum(table.sum(axis=1, keepdims=True), 1.0)

    def right(self, of: NDArray[np.bool_] | None = None) -> Array:
        """Return how often each slide was recognised when held out, (n_tested,); `of` (n_slides,) chooses."""
        return self._tested(self.decided == self.codes, of)

    def taken_for(self, first: str, second: str, of: NDArray[np.bool_] | None = None) -> Array:
        """Return how often each slide was taken for the other one of two surfaces, (n_tested,)."""
        pair = [self.surfaces.index(first), self.surfaces.index(second)]
        other = np.select([self.codes == pair[0], self.codes == pair[1]], [pair[1], pair[0]], default=UNDECIDED - 1)
        return self._tested(self.decided == other, of)

    def wrong(self) -> Array:
        """Return how often each slide was taken for another surface, (n_tested,); what is unclassified is not."""
        return self._tested((self.decided != self.codes) & (self.decided != UNDECIDED))

    def nothing(self) -> Array:
        """Return how often each slide was taken for nothing, (n_tested,)."""
        return self._tested(self.decided == UNDECIDED)

    def pairs(self) -> list[tuple[str, str]]:
        """Return all pairs of surfaces, those taken for each other most often first."""
        n = len(self.surfaces)
        table = self.confusion[:, :n]
        both = table + table.T
        order = sorted(zip(*np.triu_indices(n, k=1), strict=True), key=lambda place: -both[place])
        return [(self.surfaces[first], self.surfaces[second]) for first, second in order]

    def _tested(self, events: NDArray[np.bool_], of: NDArray[np.bool_] | None = None) -> Array:
        chosen = self.tested if of is None else self.tested & of
        times = (~self.trained_on).sum(axis=0)[chosen]
        return (events & ~self.trained_on).sum(axis=0)[chosen] / times


Mask = NDArray[np.bool_]
# (surface and condition of each slide, randomness, whether to hurry) -> which slides are used for training, by split
Splitter = Callable[[Codes, NDArray[np.str_], np.random.Generator, bool], Mask]
Table = Sequence[Sequence[float]]


@dataclass(frozen=True)
class View:
    """One of the ways in which a trial measures a surface; the features of all views of a trial are joined."""

    finger: int = 0
    turned_rad: float = 0.0


@dataclass(frozen=True)
class Visits:
    """Trials that are alike, over each surface."""

    condition: str
    count: int
    sliding: SimulatedSlide
    views: tuple[View, ...] = (View(),)
    radius_m: float = 0.0
    random: float = 0.0


@dataclass(frozen=True)
class Figures:
    """What a paper tells of a method, as shares; None if it does not."""

    learning: float | None = None
    test: float | None = None
    unclassified: float | None = None  # of the test slides


BY_SPLIT, BY_WINDOW, ON_ALL = 'slides of the split', 'half of the windows', 'all slides'


@dataclass(frozen=True)
class Method:
    """A recipe on trial."""

    recipe: str
    paper: Figures = Figures()
    learner: Mapping[str, Any] = field(default_factory=dict)
    features: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    label: str = ''
    views: tuple[int, ...] = ()
    training: str = BY_SPLIT
    sets: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    splits: int = 0
    confusion: Table | None = None

    @property
    def name(self) -> str:
        """Name in the table."""
        return self.label or self.recipe


FEW = 2  # splits: enough for a variation that is shown next to the paper's method, where it takes long


@dataclass(frozen=True)
class RecognitionTask:
    """Surfaces to tell apart, how they are touched, and what tries to."""

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
    """The one stated figure by which the difficulty of a scene is set: so many test slides are right by this method."""

    task: str
    method: str
    test: float
    source: str
    setting: str = 'noise of the fast channels'
    experiment: str = ''
    shortfall: str = ''
    parts: Mapping[str, float] = field(default_factory=dict)

    @property
    def figures(self) -> Mapping[str, float]:
        """All figures that are set, by task."""
        return {self.task: self.test, **self.parts}


@dataclass(frozen=True)
class PaperProtocol:
    """A paper's experiment."""

    name: str
    scene: str
    paper: str
    tasks: tuple[RecognitionTask, ...]
    divide: Splitter
    split: str
    anchor: Anchor
    findings: Callable[[MethodResults], Sequence[Finding]]
    quick_count: int = 8
    by_condition: bool = False


def halves(count: int) -> Splitter:
    """Return what draws random halves, each surface halved."""
    return _of(lambda quick, seed: StratifiedShuffleSplit(2 if quick else count, train_size=0.5, random_state=seed))


def _of(make: Callable[[bool, int], BaseCrossValidator]) -> Splitter:
    """Return the splits of one of scikit-learn's splitters, as which slides each trains on."""

    def divide(codes: Codes, conditions: NDArray[np.str_], rng: np.random.Generator, quick: bool) -> Mask:
        parts = list(make(quick, int(rng.integers(2**31))).split(codes, codes))
        trained_on = np.zeros((len(parts), len(codes)), dtype=bool)
        for row, (training, _) in zip(trained_on, parts, strict=True):
            row[training] = True
        return trained_on

    return divide


def folds(count: int, repeats: int) -> Splitter:
    """Return what holds out each part of the slides in turn, each surface assigned at random, several times."""

    def splitter(quick: bool, seed: int) -> BaseCrossValidator:
        return RepeatedStratifiedKFold(
            n_splits=2 if quick else count, n_repeats=1 if quick else repeats, random_state=seed
        )

    return _of(splitter)


def drawn(share: float, count: int) -> Splitter:
    """Return what draws so large a share of all slides for training, whatever their surface."""
    return _of(lambda quick, seed: ShuffleSplit(2 if quick else count, train_size=share, random_state=seed))


def training_in(condition: str) -> Splitter:
    """Return what is trained on the slides of one condition and tests on all others."""

    def divide(codes: Codes, conditions: NDArray[np.str_], rng: np.random.Generator, quick: bool) -> Mask:
        return (conditions == condition)[None, :]

    return divide


@dataclass(frozen=True)
class Experiment:
    """Where an experiment writes, its seed, and whether to hurry."""

    out: Path
    seed: int = 0
    quick: bool = False
    tune: bool = False
    splits: int = 0
    search: SearchParams | None = None


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
        """Yield our figures beside the paper's, and the findings, for people: means over seeds where there are some."""
        seeds = self.numbers.get('seeds', [self.numbers['seed']])
        yield f'over {len(seeds)} seeds: mean, and its interval of 95 %' if seeds[1:] else f'seed {seeds[0]}'
        for task, methods in self.numbers.get('tasks', {}).items():
            for method, figures in methods.items():
                value, low, high = (100 * part for part in figures.get('over_seeds', figures['test']))
                paper = figures.get('paper', {}).get('test')
                told = '' if paper is None else f'; paper {100 * paper:.1f} %'
                yield f'  {task}, {method}: {value:.1f} % ({low:.1f} to {high:.1f}){told}'
        for name, parts in self.numbers.get('regressors', {}).items():
            for part, figures in parts.items():
                paper = self.numbers.get('paper', {}).get(name, {}).get(part)
                told = '' if paper is None else f'; paper {paper:.2f}'
                error = figures.get('over_seeds', [figures['error'] or math.nan])[0]
                yield f'  {name}, {part} textures: error {error:.2f} grades{told}'
        for name, facts in self.numbers.get('tuning', {}).items():
            yield f'  searched {name}: {facts["individuals_tried"]} individuals, {facts["seconds"]:.0f} s'
        for finding in self.numbers['findings']:
            value, low, high = finding.get('over_seeds', finding['interval'])
            yield f'  {finding["verdict"]:14} {finding["claim"]}: {value:+.3f} ({low:+.3f} to {high:+.3f})'
            yield f'  {"":14} here {finding["here"]}'
            if why := finding.get('built_in'):
                yield f'  {"":14} built in, not found: {why}'

    def write(self, out: Path) -> Path:
        """Write the JSON and return its path."""
        out.mkdir(parents=True, exist_ok=True)
        content = {
            'name': self.name,
            'measured': self.measured,
            'data': self.data,
            'split': self.split,
            'machine': f'{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}',
            'numbers': self.numbers,
            'charts': [chart.name for chart in self.charts],
        }
        path = out / f'{self.name}.json'
        path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + '\n', encoding='utf-8')
        return path


Run = Callable[[Experiment], ExperimentResult]


# What of `training` decides the label after a whole slide. The rest says when a slide ends early, or what is outside.
DECISIVE_OF_TRAINING = frozenset({'augmentation', 'false_rejection_rate', 'hop_s', 'start_weight'})
# Values with which a parameter of evidence rule or learner changes nothing: stored digests are older than it.
NEUTRAL = {'late_weight': 1.0, 'passes': 1}
OWN_CLASS = re.compile(r'texture_papers\.\w+:(\w+)')


def digest_of(recipe: str) -> str:
    """Return eight letters of what of a shipped recipe, by its name, decides the label after a whole slide.

    Descriptions, the tare of inputs, and rules for ending a slide early do not count.
    """
    try:
        definition = load_recipe(recipe).as_mapping()
    except UnknownName:
        definition = load_roughness_recipe(recipe).as_mapping()
    text = OWN_CLASS.sub(_short_name, json.dumps(_decisive(definition), sort_keys=True))
    return _letters(json.loads(text))


def digest_of_row(recipe: Any, scene: Scene, task: RecognitionTask, *settings: Any) -> str:
    """Return eight letters of all that decides a row of figures, but for the seed.

    The recipe as it is run, the motions and their number, the settings, and what the simulator makes of one slide of
    each kind over each surface: this changes with the scene, with the sensor's model and with the simulation.
    """
    definition = _decisive(recipe.as_mapping())
    visits = [{**asdict(visits), 'sliding': _set(visits.sliding)} for visits in task.visits]
    return _letters([definition, visits, _probed(scene, task), settings])


def _set(sliding: SimulatedSlide) -> dict[str, Any]:
    """Return what of a motion is not as by default: a field that is new changes no digest."""
    values = {one.name: (getattr(sliding, one.name), one.default) for one in fields(sliding)}
    return {name: value for name, (value, default) in values.items() if value is not default and value != default}


def _letters(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:8]


PROBES: dict[Any, list[str]] = {}


def _probed(scene: Scene, task: RecognitionTask) -> list[str]:
    """Return strength and roughness of the signals of one slide of each kind over each surface, to three digits."""
    key = repr((scene, task.visits, task.surfaces))
    if key not in PROBES:
        few = replace(task, visits=tuple(replace(visits, count=1) for visits in task.visits))
        streams = [stream for view in gather(scene, few, 0, slow=False).views for stream in view.streams.values()]
        levels = [
            level for one in streams for level in (one.samples.std(axis=1), np.diff(one.samples, axis=1).std(axis=1))
        ]
        PROBES[key] = [f'{value:.3g}' for level in levels for value in np.ravel(level.mean(axis=-1))]
    return PROBES[key]


def _short_name(found: re.Match[str]) -> str:
    """Return 'region_peaks' of 'texture_papers.jamali:RegionPeaks': in which module a class stands decides nothing."""
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


FULL = SearchParams()  # 20 individuals, 30 generations, 20 halves: the paper's
QUICK = SearchParams(population=4, generations=2, halves=2, finalists=1)


@dataclass(frozen=True, eq=False)
class TunedRecipe:
    """A recipe that was searched for, and what it took."""

    found: SearchResult
    seconds: float
    cpu_seconds: float
    scans: int

    @property
    def recipe(self) -> Any:
        """The best."""
        return self.found.best.recipe

    def figures(self) -> dict[str, Any]:
        """Return what the search took and how good it thinks the best is."""
        learning, test = np.mean(self.found.best.scores, axis=0).tolist()
        history = self.found.history
        return {
            'seconds': round(self.seconds, 1),
            'cpu_seconds': round(self.cpu_seconds, 1),  # of all cores: what a busy machine would have needed alone
            'scans': self.scans,
            'generations': len(history),
            'individuals_tried': history[-1].tried,
            'learning': learning,
            'test': test,
        }

    def write(self, path: Path) -> Path:
        """Write the recipe as a file that training reads; return its path."""
        text = yaml.safe_dump(self.recipe.as_mapping(), sort_keys=False, allow_unicode=True, width=120)
        with writing(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding='utf-8')
        return path


def tune(
    space: RecipeSpace, scans: SlideArrays, task: ClassificationTask | RoughnessTask, params: SearchParams
) -> TunedRecipe:
    """Return the best recipe of a space on these scans, and what it took to find it."""
    began, cpu_began = time.perf_counter(), time.process_time()
    with workers():
        found = optimise(space, SearchSlides(scans, params.halves, params.seed), params, task)
    return TunedRecipe(found, time.perf_counter() - began, time.process_time() - cpu_began, len(scans.labels))


ROUNDING = 1e-6  # of a sample: lengths in seconds are seldom exact


@dataclass(frozen=True, eq=False)
class ArrayStream:
    """Scans of one input: samples (n_scans, n_samples, n_channels) at a rate, and names of the channels."""

    samples: Samples
    rate_hz: float
    channels: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SlideArrays:
    """Equally long scans of known surfaces, such as simulated ones; called with window parameters it cuts them."""

    streams: Mapping[str, ArrayStream]
    labels: NDArray[np.str_]
    speed_m_s: Array
    force_n: Array
    _known: dict[WindowParams, LabelledWindows] = field(default_factory=dict, repr=False)

    def of(self, chosen: Mask) -> SlideArrays:
        """Return some of the scans; `chosen` is (n_scans,)."""
        streams = {topic: replace(stream, samples=stream.samples[chosen]) for topic, stream in self.streams.items()}
        return SlideArrays(streams, self.labels[chosen], self.speed_m_s[chosen], self.force_n[chosen])

    def __call__(self, windows: WindowParams) -> LabelledWindows:
        """Return the windows, scan by scan."""
        if windows not in self._known:
            self._known[windows] = self._cut(windows)
        return self._known[windows]

    def _cut(self, windows: WindowParams) -> LabelledWindows:
        duration_s = min(stream.samples.shape[1] / stream.rate_hz for stream in self.streams.values())
        if duration_s - windows.skip_s < windows.length_s - ROUNDING:
            raise InvalidData(
                f'scans of {duration_s:g} s have no window of {windows.length_s:g} s after {windows.skip_s:g} s; '
                'use shorter windows or longer scans'
            )
        count = int((duration_s - windows.skip_s - windows.length_s) / windows.hop_s + ROUNDING) + 1
        speed, force = np.repeat(self.speed_m_s, count), np.repeat(self.force_n, count)
        inputs = {}
        for topic, stream in self.streams.items():
            length = round(windows.length_s * stream.rate_hz)
            starts = [round((windows.skip_s + n * windows.hop_s) * stream.rate_hz) for n in range(count)]
            samples = np.stack([stream.samples[:, start : start + length] for start in starts], axis=1)
            samples = samples.reshape(-1, *samples.shape[2:])
            inputs[topic] = WindowBatch(samples, stream.rate_hz, speed, force, channels=stream.channels)
        groups = np.array([f'{number:06d}' for number in range(len(self.labels))])
        return LabelledWindows(inputs, np.repeat(self.labels, count), np.repeat(groups, count))


@dataclass(frozen=True, eq=False)
class Slides:
    """Trials over known surfaces, in a random order.

    Parameters
    ----------
    surfaces
        Names.
    codes : (n_slides,)
        Number of the surface of each.
    conditions : (n_slides,) of text
        How it was touched.
    views
        What each consists of.
    axes
        Axis along which the slides of each view go: 'x', 'y', or '' for neither.
    """

    surfaces: tuple[str, ...]
    codes: Codes
    conditions: NDArray[np.str_]
    views: tuple[SlideArrays, ...]
    axes: tuple[str, ...] = ()

    @cached_property
    def _along_axes(self) -> SlideArrays:
        """Inputs with an axis, 'signal@x': the streams of the view along it."""
        streams = {
            f'{topic}{SEPARATOR}{axis}': stream
            for axis, view in zip(self.axes, self.views, strict=True)
            for topic, stream in view.streams.items()
        }
        return replace(self.views[0], streams=streams, _known={})

    def extract(self, feature_set: FeatureSet, views: Sequence[int] = ()) -> tuple[Array, Codes]:
        """Return the features of all windows, of some or all views, (n, n_features), and their slides, (n,).

        A feature set whose inputs have an axis joins the views itself.

        Parameters
        ----------
        feature_set
            Windows and features.
        views
            Numbers of the views; () for all.

        Returns
        -------
        (n, n_features)
            Features of windows.
        (n,)
            Number of the slide of each.
        """
        joins = feature_set.window_names != feature_set.topics
        chosen = [self._along_axes] if joins else [self.views[n] for n in views or range(len(self.views))]
        values = np.concatenate([view(feature_set.windows).values(feature_set) for view in chosen], axis=1)
        return values, self.views[0](feature_set.windows).slides

    def names(self, feature_set: FeatureSet, views: Sequence[int] = ()) -> tuple[str, ...]:
        """Return the names of what `extract` returns, (n_features,)."""
        joins = feature_set.window_names != feature_set.topics
        streams = (self._along_axes if joins else self.views[0]).streams
        layout = tuple((streams[name].rate_hz, streams[name].channels) for name in feature_set.window_names)
        return feature_set.names(layout) * (1 if joins else len(views or self.views))


def gather(scene: Scene, task: RecognitionTask, seed: int, *, slow: bool) -> Slides:
    """Return the slides of a task.

    A slide is the same in all tasks that hold it: its randomness follows from seed, surface and condition.
    """
    surfaces = task.surfaces or tuple(scene.surfaces)
    kinds = [(surface, visits) for surface in surfaces for visits in task.visits]
    counts = [visits.count for _, visits in kinds]
    order = np.random.default_rng(seed).permutation(sum(counts))
    codes = np.repeat([surfaces.index(surface) for surface, _ in kinds], counts)[order]
    conditions = np.repeat([visits.condition for _, visits in kinds], counts)[order]
    speed = np.repeat([float(visits.sliding.speed_m_s) for _, visits in kinds], counts)[order]
    force = np.repeat([float(visits.sliding.force_n) for _, visits in kinds], counts)[order]
    kind = find(SENSORS, scene.sensor, 'sensor model')
    measured = {stream.topic: stream for stream in kind.streams}
    views = []
    for number in range(len(task.visits[0].views)):
        parts = [_measured(scene, surface, visits, number, seed, slow=slow) for surface, visits in kinds]
        streams = {
            topic: ArrayStream(
                np.concatenate([part[topic] for part in parts])[order],
                measured[topic].rate_hz,
                measured[topic].channels,
            )
            for topic in parts[0]
        }
        views.append(SlideArrays(streams, np.asarray(surfaces)[codes], speed, force))
    axes = tuple(axis_along(float(task.visits[0].sliding.direction_rad) + v.turned_rad) for v in task.visits[0].views)
    return Slides(surfaces, codes, conditions, tuple(views), axes)


def _measured(
    scene: Scene, surface: str, visits: Visits, number: int, seed: int, *, slow: bool
) -> Mapping[str, Samples]:
    view: View = visits.views[number]
    kind = find(SENSORS, scene.sensor, 'sensor model')
    # A window is cut where every stream has samples: the slowest decides, and a slide ends with one of its samples.
    slowest_hz = min(stream.rate_hz for stream in kind.streams[: None if slow else 1])
    duration_s = math.ceil(visits.sliding.duration_s * slowest_hz - ROUNDING) / slowest_hz
    own = [seed, list(scene.surfaces).index(surface), zlib.crc32(visits.condition.encode())]
    rng = np.random.default_rng([*own, number])
    sliding = replace(_sliding(visits, np.random.default_rng(own)), duration_s=duration_s)
    sliding = replace(sliding, direction_rad=sliding.direction_rad + view.turned_rad)
    touched = _shaped(scene, surface, visits.radius_m)
    return simulate_slide_streams(touched, surface, visits.count, sliding, rng, finger=view.finger, slow=slow)


def _sliding(visits: Visits, rng: np.random.Generator) -> SimulatedSlide:
    """Return how the fingers of each trial go: all views of a trial alike."""
    if not visits.random:
        return visits.sliding
    speed, force = (1.0 + visits.random * rng.uniform(-1.0, 1.0, (2, visits.count))) * np.array(
        [[visits.sliding.speed_m_s], [visits.sliding.force_n]]
    )
    heading = rng.uniform(0.0, 2.0 * math.pi, visits.count)
    return replace(visits.sliding, speed_m_s=speed, force_n=force, direction_rad=heading)


def _shaped(scene: Scene, surface: str, radius_m: float) -> Scene:
    """Return the scene with one object curved in another way; as it is for a radius of 0."""
    if not radius_m:
        return scene
    curved = replace(scene.surface(surface), shape=Curved(radius_m))
    return replace(scene, surfaces={**scene.surfaces, surface: curved})


SLOW = 'signal_static'
TunedRecipes = Mapping[tuple[str, str], TunedRecipe]  # by task and recipe
NONE: TunedRecipes = {}


def outcomes(
    protocol: PaperProtocol, scene: Scene, seed: int, *, quick: bool, tuned: TunedRecipes = NONE, splits: int = 0
) -> MethodResults:
    """Return what comes out of each method in each task."""
    return {
        (task.name, method): outcome
        for task in protocol.tasks
        for method, outcome in of_task(protocol, task, scene, seed, quick=quick, tuned=tuned, splits=splits)
    }


def of_task(
    protocol: PaperProtocol,
    task: RecognitionTask,
    scene: Scene,
    seed: int,
    *,
    quick: bool,
    tuned: TunedRecipes = NONE,
    splits: int = 0,
) -> Iterator[tuple[str, MethodResult]]:
    """Yield what comes out of each method in one task.

    One with a recipe that was searched for is tried on the first split alone: in the others it would be tested on
    slides that the search has seen.
    """
    slides, trained_on = _gathered(protocol, task, scene, seed, quick=quick)
    for method in task.methods:
        found = tuned.get((task.name, method.recipe))
        recipe = found.recipe if found else recipe_of(method)
        most = 1 if found else min(filter(None, (method.splits, splits)), default=len(trained_on))
        yield method.name, evaluate_method(recipe, slides, trained_on[:most], method.views, training=method.training)


def searched(protocol: PaperProtocol, scene: Scene, params: SearchParams, *, quick: bool) -> TunedRecipes:
    """Return the recipes for which the paper has a genetic search, found on what the first split is trained on."""
    methods = {
        (task.name, method.recipe): (task, method)
        for task in protocol.tasks
        for method in reversed(task.methods)  # of several with one recipe, the first
        if space_for('recipes', method.recipe)
    }
    found = {}
    for key, (task, method) in methods.items():
        slides, trained_on = _gathered(protocol, task, scene, params.seed, quick=quick)
        space = RecipeSpace.load(str(space_for('recipes', method.recipe)), recipe_of(method))
        found[key] = tune(space, slides.views[0].of(trained_on[0]), ClassificationTask(), params)
    return found


def _gathered(
    protocol: PaperProtocol, task: RecognitionTask, scene: Scene, seed: int, *, quick: bool
) -> tuple[Slides, Mask]:
    """Return the slides of a task, and which of them each split is trained on."""
    task = reduced(task, protocol.quick_count) if quick else task
    slow = any(SLOW in recipe_of(method).feature_set.topics for method in task.methods)
    slides = gather(scene, task, seed, slow=slow)
    return slides, protocol.divide(slides.codes, slides.conditions, np.random.default_rng(seed), quick)


def recipe_of(method: Method) -> Recipe:
    """Return the recipe as the protocol asks for it."""
    recipe = load_recipe(method.recipe)
    inputs = tuple(_changed(item, method.features) for item in recipe.feature_set.inputs)
    learner: Any = recipe.learner
    return replace(
        recipe,
        feature_set=replace(recipe.feature_set, inputs=inputs, _layouts={}),
        learner=replace(learner, **method.learner),
    )


def _changed(item: InputFeatures, parameters: Mapping[str, Mapping[str, Any]]) -> InputFeatures:
    features: list[tuple[str, Any]] = list(item.features)
    changed = tuple((name, _with_parameters(feature, parameters.get(name, {}))) for name, feature in features)
    return replace(item, features=changed)


def _with_parameters(feature: Any, parameters: Mapping[str, Any]) -> Any:
    if isinstance(feature, Stretched):
        return replace(feature, feature=_with_parameters(feature.feature, parameters))
    return replace(feature, **parameters)


def evaluate_method(
    recipe: Recipe,
    slides: Slides,
    trained_on: Mask,
    views: Sequence[int] = (),
    *,
    training: str = BY_SPLIT,
    beside: Array | None = None,
) -> MethodResult:
    """Learn from the slides of each split and evaluate all."""
    to_learn = replace(recipe.feature_set, windows=recipe.training_windows, _layouts={})
    trained, owner = slides.extract(to_learn, views)
    asked, slide = slides.extract(recipe.feature_set, views)
    if beside is not None:
        trained, asked = np.hstack((trained, beside[owner])), np.hstack((asked, beside[slide]))
    learner = of_examples(recipe.learner, slides.names(to_learn, views), slides.surfaces)
    windows = recipe.feature_set.windows
    rows_of = trained_on[:, owner]
    if training == BY_WINDOW:
        rows_of = _halves_of_windows(owner, len(trained_on))
    elif training == ON_ALL:
        rows_of = np.ones((1, len(owner)), dtype=bool)
    decided = np.empty((len(rows_of), len(slides.codes)), dtype=np.intp)
    began = time.perf_counter()
    for number, rows in enumerate(rows_of):
        fitted = learner.fit(trained[rows], slides.codes[owner[rows]], owner[rows])
        scores = learner.predictor(fitted.parameters)(asked)
        decided[number], _ = decided_by_slide(scores, slide, recipe.evidence, windows.hop_s / windows.length_s)
    taken_s = (time.perf_counter() - began) / len(rows_of)
    known = trained_on if training == BY_SPLIT else np.zeros(decided.shape, dtype=bool)
    return MethodResult(slides.surfaces, slides.codes, slides.conditions, decided, known, taken_s, fitted.note)


def _halves_of_windows(owner: Codes, count: int) -> Mask:
    rng = np.random.default_rng(count)
    return np.stack([rng.permutation(len(owner)) < len(owner) // 2 for _ in range(count)])


def reduced(task: RecognitionTask, count: int) -> RecognitionTask:
    """Return the task with fewer slides: so many over each surface, as equally as may be among the visits."""
    each = max(1, count // len(task.visits))
    visits = tuple(replace(visit, count=min(visit.count, each)) for visit in task.visits)
    return replace(task, visits=visits)


LEVEL = 0.95
VERDICTS = {True: 'holds', False: 'does not hold', None: 'not decided'}
SEED_SPLITS = 2  # of a further seed: what differs between seeds are the slides


def over_seeds(run: Run, name: str, experiment: Experiment, count: int, digests: Mapping[str, str]) -> ExperimentResult:
    """Run an experiment with so many seeds, and add means and intervals over them to the result of the first.

    The first seed is run as the experiment asks, and written. Each further one is run on at most two splits and kept
    in the folder `seeds`. What is there already, with the digests of now, is not run again.
    """
    if count < 2:
        raise InvalidParameter(f'{count} seeds were asked for; two or more are needed for an interval over seeds')
    first = _first(run, name, experiment, digests)
    further = replace(experiment, splits=SEED_SPLITS)
    others = [_kept(run, name, replace(further, seed=experiment.seed + number), digests) for number in range(1, count)]
    return replace(first, numbers=with_seeds(first.numbers, others))


def _first(run: Run, name: str, experiment: Experiment, digests: Mapping[str, str]) -> ExperimentResult:
    """Return the result of the first seed, as it was written if it was."""
    path = experiment.out / f'{name}.json'
    if path.is_file() and not experiment.quick and not experiment.tune:
        content = json.loads(path.read_text(encoding='utf-8'))
        numbers = content['numbers']
        if numbers.get('seed') == experiment.seed and numbers.get('digests') == digests:
            texts = {key: content[key] for key in ('name', 'measured', 'data', 'split')}
            return ExperimentResult(**texts, numbers=numbers, charts=tuple(map(Path, content['charts'])))
    result = run(experiment)
    result.write(experiment.out)
    return result


def _kept(run: Run, name: str, experiment: Experiment, digests: Mapping[str, str]) -> Mapping[str, Any]:
    """Return the numbers of one further seed, from the folder if they are there."""
    kind = f'{"-tuned" if experiment.tune else ""}-{experiment.seed}{"-reduced" if experiment.quick else ""}'
    path = experiment.out / 'seeds' / f'{name}{kind}.json'
    if path.is_file():
        numbers: Mapping[str, Any] = json.loads(path.read_text(encoding='utf-8'))
        if numbers.get('digests') == digests:
            return numbers
    with tempfile.TemporaryDirectory() as folder:
        numbers = run(replace(experiment, out=Path(folder))).numbers
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(numbers, ensure_ascii=False) + '\n', encoding='utf-8')
    return numbers


def with_seeds(first: Mapping[str, Any], others: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the numbers of the first seed with mean and interval over all seeds beside each figure and finding."""
    numbers: dict[str, Any] = json.loads(json.dumps(first))
    runs = [numbers, *others]
    numbers['seeds'] = [run['seed'] for run in runs]
    for task, methods in numbers.get('tasks', {}).items():
        for method, figures in methods.items():
            found = [run['tasks'][task][method]['test'][0] for run in runs if method in run['tasks'][task]]
            _add(figures, found, share=True)
            for kind in ('conditions', 'sets'):
                for name, part in figures.get(kind, {}).items():
                    same = [run['tasks'][task].get(method, {}).get(kind, {}).get(name) for run in runs]
                    _add(part, [one['test'][0] for one in same if one], share=True)
    for regressor, parts in numbers.get('regressors', {}).items():
        for part, figures in parts.items():
            same = [run['regressors'][regressor][part] for run in runs if part in run['regressors'].get(regressor, {})]
            _add(figures, [one['error'] for one in same])
            if len(same) > 1:
                figures['means'] = {
                    key: mean_over_seeds([one[key] for one in same]).as_json() for key in ('error_none_as_0', 'std')
                }
            errors = [float(np.mean([one['by_texture'][name] for one in same if name in one['by_texture']]))
                      for name in figures['by_texture']]  # fmt: skip
            figures['over_textures'] = mean_over_seeds(errors).as_json()
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


def mean_over_seeds(values: Sequence[float]) -> Interval:
    """Return the mean of one figure of each seed or texture, and its interval by Student's t, 95 %."""
    array = np.asarray(values, dtype=np.float64)
    centre, n = float(array.mean()), len(array)
    reach = float(t.ppf(0.5 + LEVEL / 2.0, n - 1) * array.std(ddof=1) / np.sqrt(n))
    return Interval(centre, centre - reach, centre + reach)


def _add(figures: dict[str, Any], found: Sequence[float], *, share: bool = False) -> None:
    """Add values and interval of the seeds, which is cut where no share can lie."""
    if len(found) > 1:
        figures['by_seed'] = list(found)
        interval = mean_over_seeds(found).as_json()
        figures['over_seeds'] = [min(max(value, 0.0), 1.0) for value in interval] if share else interval

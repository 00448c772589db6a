"""Search of a recipe's parameters by genetic algorithm: spaces, fitness, surrogates, caches."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import json
import math
import os
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import combinations
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import numpy as np
import yaml
from joblib import Parallel, delayed, parallel_config
from numpy.typing import NDArray
from scipy.stats import t as student_t
from threadpoolctl import threadpool_limits

from texture_core.config import (
    MB,
    find,
    find_file,
    library,
    load_json,
    load_yaml,
    param,
    safe_repr,
    shipped,
    unknown_name,
    writing,
)
from texture_core.errors import InvalidData, InvalidParameter
from texture_core.types import Array, Samples, Window
from texture_estimation.evidence_rules import EvidenceRule, MajorityVote, deciding_rows
from texture_estimation.learners.learner import Codes, Learner
from texture_estimation.numerics import log_softmax
from texture_estimation.recipe import Recipe
from texture_estimation.roughness import (
    LEVEL,
    REGRESSOR_GRADES,
    ROUGH,
    SMOOTH,
    STICK_SLIP,
    Grades,
    RoughnessRecipe,
    RoughnessRegressor,
)
from texture_features.feature import Feature, WindowBatch
from texture_features.feature_set import AGAIN, JOINT, FeatureSet, InputFeatures
from texture_features.features.temporal import Force, Speed
from texture_features.windows import CutWindow, Stretched, WindowEvent, WindowParams

# --------------------
# What a window costs: operations counted, not timed, so that a search ends alike on any machine.

# Operations of one exponential or hyperbolic tangent.
EXPONENTIAL = 10.0
# Of a feature without an entry, for each sample.
UNKNOWN = 50.0


def operations(
    features: Sequence[Feature], learner: Any, *, n_samples: int, n_values: int, n_labels: int, n_training: int
) -> float:
    """Return about how many operations it takes from the samples of one window to the decision.

    A feature or learner says it itself, if it has a method `operations`.

    Parameters
    ----------
    features, learner
        What is done; the learner may be a regressor that grades.
    n_samples
        Of a window, all channels together.
    n_values
        Values of all features.
    n_labels, n_training
        Surfaces or grades, and training examples, all of which may become support vectors.

    Returns
    -------
    float
        Additions and multiplications.
    """
    extracted = sum(_feature(feature, n_samples) for feature in features)
    own = getattr(learner, 'operations', None)
    return extracted + (own(n_values, n_labels, n_training) if own else float(n_training * n_values))


def _feature(feature: Any, n: int) -> float:
    if isinstance(feature, Stretched):
        return 2.0 * of_transform(n) + _feature(feature.feature, n)
    if isinstance(feature, Speed | Force):
        return 1.0
    own = getattr(feature, 'operations', None)
    return float(own(n)) if own else UNKNOWN * n


def of_networks(count: float, hidden: int, n_values: int) -> float:
    """Return the operations of so many networks with a hidden layer."""
    return count * hidden * (2.0 * n_values + EXPONENTIAL)


def of_machines(count: float, n_values: int, n_training: int) -> float:
    """Return the operations of so many machines that share their support vectors."""
    return n_training * (2.0 * n_values + EXPONENTIAL + 2.0 * count)


def of_transform(n: int) -> float:
    """Return the operations of a Fourier transform of n samples."""
    return 5.0 * n * math.log2(max(n, 2))


# --------------------
# Random halves of labelled slides: one for training, one to test on.

Mask = NDArray[np.bool_]


def random_halves(codes: Codes, groups: Codes, count: int, rng: np.random.Generator) -> Mask:
    """Return which examples are used for training in each of `count` splits, (count, n).

    Half of the slides of each label, rounded down, are used for training; all windows of a slide are on one side.

    Parameters
    ----------
    codes, groups : (n,)
        Label and slide number of each example.
    count
        How many splits.
    rng
        Draws the slides.

    Returns
    -------
    (count, n) bool
        True for training.

    Raises
    ------
    InvalidData
        If a label has fewer than two slides.

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.
    """
    slides, first = np.unique(groups, return_index=True)
    of_label = [slides[codes[first] == code] for code in np.unique(codes)]
    if min(len(members) for members in of_label) < 2:
        raise InvalidData(
            f'a surface has {min(len(members) for members in of_label)} slides; '
            'two at least are needed, one for training and one to test on'
        )
    halves = np.zeros((count, len(codes)), dtype=bool)
    for mask in halves:
        training = [rng.permutation(members)[: len(members) // 2] for members in of_label]
        mask[:] = np.isin(groups, np.concatenate(training))
    return halves


# --------------------
# How well an individual does: shares of right decisions on what was trained and on what was not.

UNDECIDED = -1


def fitness(learning: Sequence[float] | Array, test: Sequence[float] | Array) -> float:
    """Return the mean of learning and test accuracy over all halves.

    Source: Roberge et al., "Textures recognition through tactile exploration", section IV.

    Parameters
    ----------
    learning, test : (n_halves,)
        Accuracy on the examples that were trained on, and on the others, 0 to 1.
    """
    return float((np.mean(learning) + np.mean(test)) / 2.0)


def decisions(scores: Array) -> Codes:
    """Return the label with the highest score, (n,) of (n, n_labels); UNDECIDED where several share it.

    Parameters
    ----------
    scores : (n, n_labels)
    """
    best = scores.max(axis=1, keepdims=True)
    chosen: Codes = scores.argmax(axis=1)
    chosen[(scores == best).sum(axis=1) > 1] = UNDECIDED
    return chosen


def shares_right(decided: Codes, codes: Codes, training: Mask) -> tuple[float, float]:
    """Return the shares of right decisions among the training and among the other examples; undecided is not right.

    Parameters
    ----------
    decided, codes : (n,)
        Number of the label that was decided, and of the true one.
    training : (n,) bool
        Which examples were trained on.

    Returns
    -------
    (float, float)
        0 to 1 each.
    """
    right = decided == codes
    return float(right[training].mean()), float(right[~training].mean())


def decided_by_slide(scores: Array, slides: Codes, rule: EvidenceRule, hop_share: float) -> tuple[Codes, Codes]:
    """Return what each slide is taken for by all its windows, (n_slides,), and the row of its first window.

    Parameters
    ----------
    scores : (n, n_labels)
        Of each window; equal highest ones are a tie.
    slides : (n,)
        Number of each window's slide.
    rule
        Joins the windows; of a slide with several groups that decide by themselves, the newest complete one counts.
    hop_share
        Distance of the windows over their length: of what overlaps, only the new part counts.

    Returns
    -------
    (n_slides,)
        Number of the label, or UNDECIDED.
    (n_slides,)
        Row of the first window of each slide.
    """
    _, first, member = np.unique(slides, return_index=True, return_inverse=True)
    member = member.reshape(-1)
    if rule.group:
        kept = np.zeros(len(member), dtype=bool)
        for number in range(len(first)):
            rows = np.flatnonzero(member == number)
            kept[rows[deciding_rows(len(rows), rule.group)]] = True
        member, scores = member[kept], scores[kept]
    counts = np.bincount(member)
    overlap = min(hop_share, 1.0)
    order = np.argsort(member, kind='stable')
    place = np.empty(len(member))
    place[order] = np.arange(len(member)) - np.repeat(np.cumsum(counts) - counts, counts)
    weights = rule.window_weights(1.0 + overlap * place)
    window_evidence_rows = weights[:, None] * rule.window_evidence(log_softmax(scores))
    sums = np.stack([np.bincount(member, weights=column) for column in window_evidence_rows.T], axis=1)
    means = sums / np.bincount(member, weights=weights)[:, None]
    effective_windows = 1.0 + overlap * (counts[:, None].astype(np.float64) - 1.0)
    return decisions(rule.log_posterior(means, effective_windows, 1.0)), first


# --------------------
# One recipe of the recipes that the searches of all pairs have found.

LEARNER = 'texture_papers.roberge:TunedPairs'
SHARED = ('windows', 'evidence', 'training')


def joined_recipe(recipes: Mapping[tuple[str, str], Recipe], base: Recipe) -> Recipe:
    """Return the recipe of one model in which each pair of textures has the features and the learner of its own recipe.

    Each input of a pair's recipe becomes an input of the joined one, named 'signal#1' and so on; pairs with the same
    features share one.

    Parameters
    ----------
    recipes
        Recipe of each pair, by the two labels.
    base
        From which they were searched: gives windows, evidence rule and training, and decides pairs that are not listed.

    Returns
    -------
    Recipe
        With the learner `TunedPairs` of texture_papers.

    Raises
    ------
    InvalidParameter
        If the pairs differ in what all windows share: their length, the evidence rule or the training.

    Examples
    --------
    >>> from texture_estimation.recipe import load_recipe
    >>> one = load_recipe('ets-linear-svm')
    >>> joined = joined_recipe({('cork', 'felt'): one, ('cork', 'wood'): one, ('felt', 'wood'): one}, one)
    >>> [item.topic for item in joined.feature_set.inputs], len(joined.learner.pairs)
    (['signal#1'], 3)
    """
    contents = {pair: recipe.as_mapping() for pair, recipe in recipes.items()}
    shared = _shared(contents)
    inputs: dict[str, Any] = {}
    pairs = []
    for pair, content in contents.items():
        own = [_placed(inputs, topic, section) for topic, section in content['inputs'].items()]
        pairs.append({'pair': list(pair), 'inputs': own, 'learner': content['learner']})
    of_base = base.as_mapping()
    return Recipe.from_mapping(
        {
            'description': f'{base.description} Each pair with variables of its own.'.strip(),
            **shared,
            'inputs': inputs,
            'learner': {LEARNER: {'learner': of_base['learner'], 'pairs': pairs}},
        },
        f'{base.name}-pairs',
    )


def _shared(contents: Mapping[tuple[str, str], Mapping[str, Any]]) -> dict[str, Any]:
    """Return the sections that all pairs have in common."""
    first_pair, first = next(iter(contents.items()))
    for pair, content in contents.items():
        for section in SHARED:
            if content[section] != first[section]:
                raise InvalidParameter(
                    f"the pairs {list(first_pair)} and {list(pair)} differ in '{section}', which a model has once; "
                    'search without varying it'
                )
    return {section: first[section] for section in SHARED}


def _placed(inputs: dict[str, Any], topic: str, section: Any) -> str:
    """Return the name under which an input of a pair stands among the inputs; it is added if it is new."""
    plain = topic.partition(AGAIN)[0]
    for name, known in inputs.items():
        if name.partition(AGAIN)[0] == plain and known == section:
            return name
    name = f'{plain}{AGAIN}{1 + sum(known.partition(AGAIN)[0] == plain for known in inputs)}'
    inputs[name] = section
    return name


# --------------------
# Windows of labelled slides, not yet described: what an individual's features are computed from.


@dataclass(frozen=True, eq=False)
class LabelledWindows:
    """Windows of labelled slides, all of one rate and length in each input.

    Parameters
    ----------
    inputs
        Topic → windows with samples (n, n_samples, n_channels), speed and force.
    labels, groups : (n,) of text
        Surface and slide of each window.

    Examples
    --------
    >>> batch = WindowBatch(np.zeros((3, 50, 1)), 100.0, np.full(3, 0.05), np.ones(3))
    >>> labels, groups = np.array(['cork', 'felt', 'felt']), np.array(['a', 'b', 'b'])
    >>> windows = LabelledWindows({'signal': batch}, labels, groups)
    >>> some, chosen = windows.of(['felt'])
    >>> some.labels.tolist(), chosen.tolist()
    (['felt', 'felt'], [False, True, True])
    """

    inputs: Mapping[str, WindowBatch]
    labels: NDArray[np.str_]
    groups: NDArray[np.str_]

    @classmethod
    def from_events(cls, events: Iterable[WindowEvent], topics: Sequence[str]) -> LabelledWindows:
        """Stack the windows of labelled slides.

        Raises
        ------
        InvalidData
            If there is none, or they differ in rate, length or channels.
        """
        cut = [event for event in events if isinstance(event, CutWindow) and event.surface]
        if not cut:
            raise InvalidData('there is no window of a labelled surface; record slides with a surface named')
        speed = np.array([event.speed_m_s for event in cut])
        force = np.array([event.force_n for event in cut])
        inputs = {topic: _stacked([event.windows[topic] for event in cut], topic, speed, force) for topic in topics}
        labels = np.array([event.surface for event in cut])
        return cls(inputs, labels, np.array([event.exploration_id for event in cut]))

    def of(self, names: Sequence[str]) -> tuple[LabelledWindows, NDArray[np.bool_]]:
        """Return the examples of some surfaces alone, and which of all these are, (n,).

        Parameters
        ----------
        names
            Surfaces to keep.

        Returns
        -------
        LabelledWindows
            Those examples.
        (n,) bool
            Which of all examples they are.
        """
        rows = np.isin(self.labels, names)
        inputs = {
            topic: WindowBatch(
                item.samples[rows], item.rate_hz, item.speed_m_s[rows], item.force_n[rows], channels=item.channels
            )
            for topic, item in self.inputs.items()
        }
        return LabelledWindows(inputs, self.labels[rows], self.groups[rows]), rows

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The surfaces, in the order of their numbers."""
        return tuple(np.unique(self.labels).tolist())

    @cached_property
    def codes(self) -> Codes:
        """Number of each window's surface, (n,)."""
        codes: Codes = np.unique(self.labels, return_inverse=True)[1].reshape(-1)
        return codes

    @cached_property
    def slides(self) -> Codes:
        """Number of each window's slide, (n,)."""
        numbers: Codes = np.unique(self.groups, return_inverse=True)[1].reshape(-1)
        return numbers

    @cached_property
    def digest(self) -> str:
        """What tells these examples from others, in eight letters."""
        digest = hashlib.sha256()
        for name in ('labels', 'groups'):
            digest.update('\n'.join(getattr(self, name).tolist()).encode())
        for topic, windows in self.inputs.items():
            digest.update(topic.encode())
            digest.update(np.ascontiguousarray(windows.samples).tobytes())
        return digest.hexdigest()[:8]


# Cuts the windows that a recipe asks for; called with equal parameters, it should answer with the same object.
Cut = Callable[[WindowParams], LabelledWindows]


def _stacked(
    windows: Sequence[Window], topic: str, speed: NDArray[np.float64], force: NDArray[np.float64]
) -> WindowBatch:
    kinds = {(item.rate_hz, item.samples.shape, item.channels) for item in windows}
    if len(kinds) > 1:
        raise InvalidData(
            f"the windows of '{topic}' differ in rate, length or channels: "
            f'{sorted(str(kind) for kind in kinds)}; use slides of one sensor'
        )
    samples = np.stack([item.samples for item in windows])
    return WindowBatch(samples, windows[0].rate_hz, speed, force, channels=windows[0].channels)


# --------------------
# Spread work over the cores of this machine, or over a Dask cluster.

In = TypeVar('In')
Out = TypeVar('Out')
# For a scheduler to answer, and for its workers to come.
ANSWER_S, WORKERS_S = 20, 30
LOCAL, MAX_LOCAL_WORKERS = 'local:', 64


class ParallelMap(Protocol):
    """Apply a function to many items, somewhere; results come in the order of the items."""

    def __call__(self, function: Callable[[In], Out], items: Sequence[In]) -> list[Out]:
        """Return function(item) for each item."""


def serial_map(function: Callable[[In], Out], items: Sequence[In]) -> list[Out]:
    """Apply the function here, one after the other."""
    return [function(item) for item in items]


@contextmanager
def threaded_map(jobs: int = -1) -> Iterator[ParallelMap]:
    """Give what spreads work over so many cores; -1 for all.

    Threads, not processes: what takes the time (libsvm, products of arrays) lets go of Python's lock, and nothing is
    copied.
    """
    with single_blas_thread(), Parallel(n_jobs=jobs, backend='threading') as parallel:
        yield _Joblib(parallel)


@contextmanager
def dask_map(address: str) -> Iterator[ParallelMap]:
    """Give what spreads work over the workers of a Dask cluster; see `dask_backend`."""
    with dask_backend(address):
        yield _Joblib(Parallel())


@contextmanager
def dask_backend(address: str) -> Iterator[None]:
    """Have joblib use the workers of a Dask cluster, which have this suite installed, within a `with` block.

    Parameters
    ----------
    address
        Address of its scheduler, such as 'tcp://192.168.1.5:8786', or 'local:2' to start a cluster of two workers on
        this machine.

    Raises
    ------
    InvalidParameter
        If no scheduler answers there.
    """
    cluster_of = library('distributed', "Dask clusters ('--dask')", 'dask')

    if address.startswith(LOCAL):
        workers = address.removeprefix(LOCAL)
        if not workers.isdecimal() or not 1 <= int(workers) <= MAX_LOCAL_WORKERS:
            raise InvalidParameter(
                f"the local cluster has '{workers}' workers; 1 to {MAX_LOCAL_WORKERS} are allowed, such as '{LOCAL}2'"
            )
        cluster: Any = cluster_of.LocalCluster(n_workers=int(workers), threads_per_worker=1, dashboard_address=None)
        with cluster, dask_backend(cluster.scheduler_address):
            yield
        return

    try:
        client: Any = cluster_of.Client(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise InvalidParameter(
            f"no Dask scheduler answers at '{address}' ({reason}); "
            "start one with 'dask scheduler', or leave '--dask' out to use this machine's cores"
        ) from error
    with client, client.as_current(), parallel_config(backend='dask', wait_for_workers_timeout=WORKERS_S):
        yield


class _Joblib:
    def __init__(self, parallel: Any) -> None:
        self._parallel = parallel

    def __call__(self, function: Callable[[In], Out], items: Sequence[In]) -> list[Out]:
        return list(self._parallel(delayed(_alone)(function, item) for item in items))


def _alone(function: Callable[[In], Out], item: In) -> Out:
    """Call the function; a worker elsewhere, too, gives each call one core."""
    with single_blas_thread():
        return function(item)


@contextmanager
def single_blas_thread() -> Iterator[None]:
    """Keep linear algebra from starting threads of its own: the cores are busy already."""
    with threadpool_limits(limits=1, user_api='blas'):
        yield


def parallel_map_for(jobs: int, dask: str) -> Callable[[], AbstractContextManager[ParallelMap]]:
    """Return what spreads over so many cores (-1: all), or over a Dask cluster if its address is given."""
    return (lambda: dask_map(dask)) if dask else (lambda: threaded_map(jobs))


# --------------------
# Features computed once, however many individuals ask for them.

# Windows described in one go: what they and their spectra take should fit the processor's cache.
CHUNK = 64
Key = tuple[WindowParams, str, Hashable]


class FeatureCache:
    """Values of feature sets on the same slides.

    A feature is computed once for all feature sets that hold it. One whose values are among those of a wider one, as
    the n highest peaks are among more, says so by its methods `widest` and `of_widest`: the wider one is computed.

    Parameters
    ----------
    cut
        Gives the windows.
    most_peaks
        Largest number of spectral peaks that will be asked for.

    Examples
    --------
    >>> from texture_estimation.search import ArrayStream, SlideArrays
    >>> samples = np.random.default_rng(0).standard_normal((8, 50, 1)) * np.repeat([1.0, 9.0], 4)[:, None, None]
    >>> labels = np.repeat(['cork', 'felt'], 4)
    >>> slides = SlideArrays({'signal': ArrayStream(samples, 100.0)}, labels, np.full(8, 0.05), np.ones(8))
    >>> inputs = {'signal': {'features': ['log_variance']}}
    >>> features = FeatureSet.from_mapping({'windows': {'length_s': 0.5}, 'inputs': inputs})
    >>> FeatureCache(slides).values(features).shape
    (8, 1)
    """

    def __init__(self, cut: Cut, most_peaks: int = 15) -> None:
        self._cut = cut
        self._most_peaks = most_peaks
        self._chunks: dict[Key, list[WindowBatch]] = {}
        self._blocks: dict[Key, Array] = {}
        self.hits = 0
        self.misses = 0

    def values(self, feature_set: FeatureSet, parallel_map: ParallelMap = serial_map) -> Array:
        """Return the values of each window, (n, n_values).

        Parameters
        ----------
        feature_set
            Windows, inputs and features.
        parallel_map
            Over what missing features are computed.

        Returns
        -------
        (n, n_values)
            In the order of the features of the set.
        """
        return self.many([feature_set], parallel_map)[0]

    def many(self, feature_sets: Sequence[FeatureSet], parallel_map: ParallelMap = serial_map) -> list[Array]:
        """Return the values of each feature set, (n, n_values) each; missing ones are computed in parallel.

        Parameters
        ----------
        feature_sets
            All of the same windows.
        parallel_map
            Over what missing features are computed.

        Returns
        -------
        list of (n, n_values)
            In the order of the sets.

        Raises
        ------
        InvalidData
            If a value is not finite.
        """
        wanted = {
            self._key(feature_set.windows, item, feature): (feature_set.windows, item, self._source(feature))
            for feature_set in feature_sets
            for item in feature_set.inputs
            for _, feature in item.features
        }
        missing = [key for key in wanted if key not in self._blocks]
        self.hits += len(wanted) - len(missing)
        self.misses += len(missing)
        jobs = [(self._windows(windows, item), feature) for windows, item, feature in map(wanted.__getitem__, missing)]
        for key, block in zip(missing, parallel_map(_describe, jobs), strict=True):
            if not np.isfinite(block).all():
                raise InvalidData(
                    f"feature {key[2]!r} of '{key[1]}' is not finite in some windows; leave it out of the search"
                )
            self._blocks[key] = block
        return [self._joined(feature_set) for feature_set in feature_sets]

    def _joined(self, feature_set: FeatureSet) -> Array:
        blocks = []
        for item in feature_set.inputs:
            for _, feature in item.features:
                block = self._blocks[self._key(feature_set.windows, item, feature)]
                blocks.append(_derived(block, feature).reshape(len(block), -1))
        return np.concatenate(blocks, axis=1)

    def _windows(self, params: WindowParams, item: InputFeatures) -> list[WindowBatch]:
        key = (params, JOINT.join(item.window_names), None)
        if key not in self._chunks:
            inputs = self._cut(params).inputs
            first, *others = (inputs[topic] for topic in item.window_names)
            self._chunks[key] = [
                replace(_some(first, rows), joined=tuple(_some(other, rows) for other in others))
                for rows in (slice(start, start + CHUNK) for start in range(0, len(first.samples), CHUNK))
            ]
        return self._chunks[key]

    def _key(self, params: WindowParams, item: InputFeatures, feature: Feature) -> Key:
        return params, JOINT.join(item.window_names), self._source(feature)

    def _source(self, feature: Feature) -> Any:
        """Return the feature from whose values those of `feature` are taken."""
        if isinstance(feature, Stretched):
            return replace(feature, feature=self._source(feature.feature))
        widest = getattr(feature, 'widest', None)
        return widest(self._most_peaks) if widest else feature


def _some(windows: WindowBatch, rows: slice) -> WindowBatch:
    speed, force = windows.speed_m_s[rows], windows.force_n[rows]
    return WindowBatch(windows.samples[rows], windows.rate_hz, speed, force, channels=windows.channels)


def _derived(block: Array, feature: Feature) -> Array:
    """Return the values of `feature` of those of its source, (n, n_channels, n_names)."""
    if isinstance(feature, Stretched):
        return _derived(block, feature.feature)
    of_widest = getattr(feature, 'of_widest', None)
    return np.asarray(of_widest(block)) if of_widest else block


def _describe(job: tuple[list[WindowBatch], Feature]) -> Array:
    chunks, feature = job
    return np.concatenate([feature(windows) for windows in chunks])


# --------------------
# Racing: evaluate an individual on half split after half split until it is significantly worse.

HalfScorer = Callable[[int], tuple[float, float]]  # number of a half → learning and test score
# Halves after which an individual may have lost; the first look is for the hopeless.
TEST_POINTS = (2, 4, 7, 12)
# Probability, at each look, of giving up one that is as good as its rival; it is ranked by its estimate even so.
SIGNIFICANCE = 0.05
# Shares come in steps: two differences may be equal by chance, and seem to have no scatter at all.
MIN_SCATTER = 0.005


class FitnessFunction(Protocol):
    """What an individual needs to be evaluated; plain data that may travel to another process."""

    def start(self) -> HalfScorer:
        """Prepare what all halves share, such as a matrix of distances, and return what classifies one half."""


@dataclass(frozen=True, eq=False)
class HalfScores:
    """Learning and test scores on the first halves, (n_done,) each; fewer than all if the individual lost.

    Examples
    --------
    >>> scores = HalfScores.of([(1.0, 0.8), (0.9, 0.7)])
    >>> scores.halves, scores.means.round(2).tolist()
    (2, [0.9, 0.8])
    """

    learning: Array
    test: Array

    @classmethod
    def of(cls, scores: Sequence[tuple[float, float]]) -> HalfScores:
        """Return the record of (learning, test) scores of the first halves."""
        learning, test = np.array(scores, dtype=np.float64).reshape(-1, 2).T
        return cls(learning, test)

    @property
    def means(self) -> Array:
        """Mean of learning and test score on each half, (n_done,)."""
        mean: Array = (self.learning + self.test) / 2.0
        return mean

    @property
    def halves(self) -> int:
        """How many halves were done."""
        return len(self.test)


EMPTY = HalfScores(np.zeros(0), np.zeros(0))


def race(fitness_function: FitnessFunction, known: HalfScores, incumbent: Array | None, n_halves: int) -> HalfScores:
    """Evaluate an individual on the halves until it has clearly lost against its rival, or all are done.

    Individuals are compared half by half, each half being the same for all: differences scatter far less than scores.

    Parameters
    ----------
    fitness_function
        Of the individual; not started if all that is needed is known.
    known
        Scores that are remembered.
    incumbent : (n_halves,) or None
        Mean scores on each half of one that is to be beaten; None: all halves are done.
    n_halves
        How many there are.

    Returns
    -------
    HalfScores
        Those that were known, and the new ones.
    """
    scores = list(zip(known.learning.tolist(), known.test.tolist(), strict=True))
    half: HalfScorer | None = None
    for number in range(n_halves):
        if (
            incumbent is not None
            and number in TEST_POINTS
            and is_clearly_worse(HalfScores.of(scores).means[:number], incumbent[:number])
        ):
            break
        if number >= len(scores):
            half = half or fitness_function.start()
            scores.append(half(number))
    return HalfScores.of(scores)


def raced_fitness(record: HalfScores, incumbent: Array | None, n_halves: int) -> tuple[float, int]:
    """Return the fitness and the halves it rests on, as `race` would have found them: what else is known is not used.

    One that lost is placed below its rival by their mean difference on the halves that both did.

    Parameters
    ----------
    record
        Scores of an individual on each half.
    incumbent : (n_halves,) or None
        Mean scores of the one that is to be beaten.
    n_halves
        Number of halves.

    Returns
    -------
    (float, int)
        Fitness, 0 to 1, and number of halves.
    """
    for number in range(1, n_halves):
        means = record.means[:number]
        if incumbent is not None and number in TEST_POINTS and is_clearly_worse(means, incumbent[:number]):
            return float(incumbent.mean() + (means - incumbent[:number]).mean()), number
    return float(record.means[:n_halves].mean()), n_halves


def is_clearly_worse(means: Array, incumbent: Array) -> bool:
    """Tell whether an individual is worse than its rival beyond chance (paired, one-sided t test).

    Parameters
    ----------
    means : (n,)
        Scores on each half.
    incumbent : (n,)
        Scores of the rival on the same halves.
    """
    difference = means - incumbent
    standard_error = max(float(difference.std(ddof=1)), MIN_SCATTER) / np.sqrt(len(difference))
    return bool(difference.mean() + _quantile(len(difference) - 1) * standard_error < 0.0)


@lru_cache
def _quantile(freedom: int) -> float:
    return float(student_t.ppf(1.0 - SIGNIFICANCE, freedom))


# --------------------
# Edits that a search applies to a recipe.


@dataclass(frozen=True)
class Edit:
    """One change of a recipe: `path` ('inputs/signal/features/force') is set to a value, used, or dropped.

    Examples
    --------
    >>> recipe = {'windows': {'length_s': 0.5}}
    >>> Edit('set', ('windows', 'length_s'), 1.0).apply(recipe)
    >>> recipe
    {'windows': {'length_s': 1.0}}
    """

    action: str
    path: tuple[str, ...]
    value: Any = None

    def apply(self, recipe: dict[str, Any]) -> None:
        """Change a recipe written as mappings and lists.

        Raises
        ------
        InvalidParameter
            If the recipe has no such place.
        """
        *way, last = self.path
        place: Any = recipe
        for step in way:
            place = enter_place(place, step, self.path)
        ACTIONS[self.action](place, last, self.value)


def edit_from(step: Mapping[str, Any]) -> Edit:
    """Return the edit that a step of a search space describes."""
    [(action, path)] = [(key, value) for key, value in step.items() if key != 'to']
    find(ACTIONS, str(action), 'change of a recipe')
    return Edit(str(action), path_of(path), step.get('to'))


def path_of(text: str) -> tuple[str, ...]:
    """Return the steps of a path such as 'inputs/signal/features'."""
    return tuple(str(text).split('/'))


def _set(place: Any, last: str, value: Any) -> None:
    old = place.get(last)
    place[last] = float(value) if isinstance(old, float) and isinstance(value, int) else value


def _use_feature(features: list[Any], name: str, value: Any) -> None:
    if _position(features, name) is None:
        features.append({name: dict(value or {})})


def _drop_feature(features: list[Any], name: str, value: Any) -> None:
    position = _position(features, name)
    if position is not None:
        del features[position]


def _position(features: Sequence[Any], name: str) -> int | None:
    return next((index for index, entry in enumerate(features) if name in entry), None)


def enter_place(place: Any, step: str, path: Sequence[str]) -> Any:
    """Return what a recipe holds below a place.

    Parameters
    ----------
    place
        A mapping, or a list of features.
    step
        Its key, or the name of a feature.
    path
        The whole path, for messages.

    Returns
    -------
    object

    Raises
    ------
    InvalidParameter
        If there is nothing of this name.
    """
    if isinstance(place, list):
        position = _position(place, step)
        place = place[position] if position is not None else {}
    if not isinstance(place, Mapping) or step not in place:
        raise InvalidParameter(
            f"the recipe has no '{'/'.join(path)}', which the search varies ('{step}' is not there); "
            'add it to the recipe, or give a search space that fits with --search'
        )
    return place[step]


ACTIONS = {'set': _set, 'use': _use_feature, 'drop': _drop_feature}


# --------------------
# The slides that a search classifies on, and how they are divided into halves.


@dataclass(frozen=True, eq=False)
class SearchSlides:
    """Windows and halves of the same slides, however the windows are cut.

    Parameters
    ----------
    cut
        Gives the windows of all labelled slides.
    n_halves, seed
        How many random halves, and what they are drawn from.
    labels
        Surfaces to tell apart; () for all. The halves of some are those of all, less the other surfaces.

    Examples
    --------
    >>> import numpy as np
    >>> from texture_estimation.search import ArrayStream, SlideArrays
    >>> samples = np.random.default_rng(0).standard_normal((8, 50, 1)) * np.repeat([1.0, 9.0], 4)[:, None, None]
    >>> labels = np.repeat(['cork', 'felt'], 4)
    >>> slides = SlideArrays({'signal': ArrayStream(samples, 100.0)}, labels, np.full(8, 0.05), np.ones(8))
    >>> halves = SearchSlides(slides, n_halves=5).halves(WindowParams(length_s=0.5, hop_s=0.5))
    >>> halves.sum(axis=1).tolist()  # half of the eight slides, each one window long
    [4, 4, 4, 4, 4]
    """

    cut: Cut
    n_halves: int = 20
    seed: int = 0
    labels: tuple[str, ...] = ()
    _known: dict[WindowParams, tuple[LabelledWindows, Mask, Mask]] = field(default_factory=dict, repr=False)

    def examples(self, windows: WindowParams) -> LabelledWindows:
        """Return the windows."""
        return self._split(windows)[0]

    def halves(self, windows: WindowParams) -> Mask:
        """Return which windows are used for training in each half, (n_halves, n).

        Returns
        -------
        (n_halves, n) bool
            True for training.
        """
        return self._split(windows)[1]

    def rows(self, windows: WindowParams) -> Mask:
        """Return which of all windows that `cut` gives are those, (n_all,).

        Returns
        -------
        (n_all,) bool
        """
        return self._split(windows)[2]

    def only(self, labels: Sequence[str]) -> SearchSlides:
        """Return the same split of some surfaces alone."""
        return SearchSlides(self.cut, self.n_halves, self.seed, tuple(labels))

    def _split(self, windows: WindowParams) -> tuple[LabelledWindows, Mask, Mask]:
        if windows not in self._known:
            examples = self.cut(windows)
            halves = random_halves(examples.codes, examples.slides, self.n_halves, np.random.default_rng(self.seed))
            rows: Mask = np.ones(len(examples.codes), dtype=bool)
            if self.labels:
                examples, rows = examples.of(self.labels)
                halves = halves[:, rows]
            self._known[windows] = (examples, halves, rows)
        return self._known[windows]


# --------------------
# What a search is for: which recipes it varies, and how one of them is tried.


class Searchable(Protocol):
    """A recipe of any kind, as a file holds it."""

    @property
    def name(self) -> str:
        """Of the recipe."""

    @property
    def feature_set(self) -> FeatureSet:
        """Windows, inputs and features."""

    @property
    def training_windows(self) -> WindowParams:
        """How the windows are cut that are used for training."""

    def as_mapping(self) -> dict[str, Any]:
        """Return what a file holds."""

    @classmethod
    def from_mapping(cls, content: Mapping[str, Any], name: str) -> Any:
        """Build from what a file holds."""


R = TypeVar('R', bound=Searchable)
R_contra = TypeVar('R_contra', bound=Searchable, contravariant=True)


class SearchTask(Protocol[R_contra]):
    """Tries recipes of one kind; see `telling_apart` and `grading`."""

    def feature_set_of(self, recipe: R_contra) -> FeatureSet:
        """Return the features that are used for training, with the windows of the training."""

    def fitness_function(
        self, recipe: R_contra, values: Array, examples: LabelledWindows, halves: Mask, *, quick: bool
    ) -> FitnessFunction:
        """Return the trial of a recipe.

        Parameters
        ----------
        recipe
            What is tried.
        values : (n, n_features)
            Of the features of `extracted`.
        examples
            The windows, (n,) of them.
        halves : (n_halves, n)
            Which windows are used for training in each half.
        quick
            Whether a quick stand-in will do, or the learner itself is wanted.

        Returns
        -------
        FitnessFunction
            Gives the accuracies on each half.
        """

    def cost(self, recipe: R_contra, n_samples: int, n_values: int, examples: LabelledWindows) -> float:
        """Return about how many operations a window costs, of so many samples and values.

        Parameters
        ----------
        recipe
            What is tried.
        n_samples
            Samples of a window, all channels together.
        n_values
            Values of all features.
        examples
            The windows, which say how many labels and examples there are.

        Returns
        -------
        float
            Additions and multiplications.
        """


# --------------------
# Which shipped search space belongs to a recipe, or else to its learner.


def space_for(key: str, name: str) -> str | None:
    """Return the name of the search space that lists a name under `key`; None if none does.

    Parameters
    ----------
    key
        'recipes', 'learners', or 'pairs_of' where each pair of surfaces of a recipe is searched for by itself.
    name
        Of the recipe or learner.
    """
    spaces = shipped('texture_estimation', 'config/search')
    return next((stem for stem, path in spaces.items() if name in load_yaml(path, 'search space').get(key, ())), None)


def shipped_space(recipe: str, learner: str, *, per_pair: bool = False) -> str:
    """Return the name of the search space of a recipe, or else of its learner.

    Raises
    ------
    InvalidParameter
        If neither has one.
    """
    of_pairs = space_for('pairs_of', recipe) if per_pair else None
    name = of_pairs or space_for('recipes', recipe) or space_for('learners', learner)
    if not name:
        raise InvalidParameter(
            f"recipe '{recipe}' has no search space of its own, nor has '{learner}'; "
            'say with --search FILE what is to be varied'
        )
    return name


# --------------------
# Scans as plain arrays, such as simulated ones, cut into the windows that a recipe asks for.

# Of a sample: lengths in seconds are seldom exact.
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class ArrayStream:
    """Scans of one input.

    Parameters
    ----------
    samples : (n_scans, n_samples, n_channels)
    rate_hz
        Sampling rate.
    channels
        Name of each channel; () where nothing names them.
    """

    samples: Samples
    rate_hz: float
    channels: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class SlideArrays:
    """Equally long scans of known surfaces; called with window parameters it gives their windows.

    Parameters
    ----------
    streams
        By topic.
    labels : (n_scans,) of text
        Surface of each scan.
    speed_m_s, force_n : (n_scans,)
        As the exploration tells them.

    Examples
    --------
    >>> stream = ArrayStream(np.zeros((2, 100, 1)), rate_hz=100.0)
    >>> slides = SlideArrays({'signal': stream}, np.array(['cork', 'felt']), np.full(2, 0.05), np.ones(2))
    >>> slides(WindowParams(length_s=0.5, hop_s=0.5)).labels.tolist()  # two windows of each
    ['cork', 'cork', 'felt', 'felt']
    """

    streams: Mapping[str, ArrayStream]
    labels: NDArray[np.str_]
    speed_m_s: Array
    force_n: Array
    _known: dict[WindowParams, LabelledWindows] = field(default_factory=dict, repr=False)

    def of(self, chosen: NDArray[np.bool_]) -> SlideArrays:
        """Return some of the scans; `chosen` is (n_scans,).

        Parameters
        ----------
        chosen : (n_slides,) bool
            Which are kept.
        """
        streams = {topic: replace(stream, samples=stream.samples[chosen]) for topic, stream in self.streams.items()}
        return SlideArrays(streams, self.labels[chosen], self.speed_m_s[chosen], self.force_n[chosen])

    def __call__(self, windows: WindowParams) -> LabelledWindows:
        """Return the windows, scan by scan.

        Raises
        ------
        InvalidData
            If a scan is shorter than a window.
        """
        if windows not in self._known:
            self._known[windows] = self._cut(windows)
        return self._known[windows]

    def _cut(self, windows: WindowParams) -> LabelledWindows:
        duration_s = min(stream.samples.shape[1] / stream.rate_hz for stream in self.streams.values())
        count = int((duration_s - windows.skip_s - windows.length_s) / windows.hop_s + ROUNDING) + 1
        if duration_s - windows.skip_s < windows.length_s - ROUNDING:
            raise InvalidData(
                f'scans of {duration_s:g} s have no window of {windows.length_s:g} s after {windows.skip_s:g} s; '
                'use shorter windows or longer scans'
            )
        speed, force = np.repeat(self.speed_m_s, count), np.repeat(self.force_n, count)
        inputs = {
            topic: WindowBatch(
                _cut_stream(stream, windows, count), stream.rate_hz, speed, force, channels=stream.channels
            )
            for topic, stream in self.streams.items()
        }
        groups = np.array([f'{number:06d}' for number in range(len(self.labels))])
        return LabelledWindows(inputs, np.repeat(self.labels, count), np.repeat(groups, count))


def _cut_stream(stream: ArrayStream, windows: WindowParams, count: int) -> Samples:
    length = round(windows.length_s * stream.rate_hz)
    starts = [round((windows.skip_s + number * windows.hop_s) * stream.rate_hz) for number in range(count)]
    cut = np.stack([stream.samples[:, start : start + length] for start in starts], axis=1)
    return cut.reshape(-1, *cut.shape[2:])


# --------------------
# Protocol of regressor surrogates: the grades of a regressor for many half splits of the same examples.

# Which examples are used for training, (n,) → the grade of every example, (n,); NaN: none.
GradesOfHalf = Callable[[Mask], Array]


class RegressorSurrogate(Protocol):
    """Prepare what all half splits share, and then score each."""

    def __call__(self, regressor: Any, X: Array, y: Array, groups: Codes) -> GradesOfHalf:
        """Return a scorer of one half split.

        Parameters
        ----------
        regressor
            Parameters of the regressor that is stood for.
        X : (n, n_features)
        y, groups : (n,)
            Grade that people gave, and number of the texture.

        Returns
        -------
        callable
            Takes which examples are used for training, (n,).
        """


# --------------------
# Fitness of a roughness recipe on half splits of extracted windows.

WORST = ROUGH - SMOOTH


@dataclass(frozen=True, eq=False)
class RoughnessFitness:
    """Evaluation of one recipe; see `texture_estimation.search.FitnessFunction`.

    The score is 1 for the grade that people gave, and falls by a quarter for each grade off; 0 where there is no grade.
    So it is 1 - (mean absolute error) / 4. The paper says that its search takes "the results of learning and testing",
    which it tells as errors, and does not say what a missing grade counts.

    Parameters
    ----------
    surrogate
        The head, or what stands for it.
    regressor
        As the recipe has it.
    values : (n, n_features)
    grades, textures : (n,)
        Grade by people, and number of the texture.
    halves : (n_halves, n)

    Examples
    --------
    >>> from texture_estimation.roughness import GaussianProcess
    >>> from texture_estimation.search import exact_grades
    >>> textures = np.repeat(np.arange(4), 4)
    >>> grades = 1.0 + textures
    >>> values = grades[:, None] + 0.01 * np.random.default_rng(0).standard_normal((16, 1))
    >>> halves = (np.arange(16) % 2 == 0)[None]
    >>> fitness = RoughnessFitness(exact_grades, GaussianProcess(), values, grades, textures, halves)
    >>> min(fitness.start()(0)) > 0.9
    True
    """

    surrogate: RegressorSurrogate
    regressor: RoughnessRegressor
    values: Array
    grades: Array
    textures: Codes
    halves: Mask

    def start(self) -> HalfScorer:
        """Return what gives the scores of training and other windows of a half."""
        graded = self.surrogate(self.regressor, self.values, self.grades, self.textures)

        def half(number: int) -> tuple[float, float]:
            training = self.halves[number]
            scores = nearness(graded(training), self.grades)
            return float(scores[training].mean()), float(scores[~training].mean())

        return half


def nearness(grades: Array, true: Array) -> Array:
    """Return 1 - |error| / 4 of each grade, (n,); 0 for NaN.

    Parameters
    ----------
    grades : (n,)
        Estimated grades; NaN for none.
    true : (n,)
        Grades that people gave.

    Returns
    -------
    (n,)
        0 to 1.
    """
    near: Array = 1.0 - np.minimum(np.abs(np.nan_to_num(grades, nan=np.inf) - true), WORST) / WORST
    return near


# --------------------
# The head itself, fitted to each half as `train` would.


def exact_grades(regressor: RoughnessRegressor, X: Array, y: Array, groups: Codes) -> GradesOfHalf:
    """Return what fits the head to a half, standardisation included, and lets its exported predictor grade.

    Parameters
    ----------
    regressor
        Regressor of the recipe.
    X : (n, n_features)
        Features of all examples.
    y, groups : (n,)
        Grade and number of the texture of each.

    Returns
    -------
    callable
        Takes which examples are used for training, (n,), returns grades (n,).
    """

    def graded(training: Mask) -> Array:
        parameters = regressor.fit(X[training], y[training], groups[training])
        return regressor.predictor(parameters)(X)[0]

    return graded


# --------------------
# Protocol of surrogates: the predictions of a learner for many half splits of the same examples.

# Which examples are used for training, (n,) → a score of each label for every example, (n, n_labels); equal highest: a
# tie.
ScoresOfHalf = Callable[[Mask], Array]


class Surrogate(Protocol):
    """Prepare what all half splits share, and then score each."""

    def __call__(self, learner: Any, X: Array, y: Codes, groups: Codes) -> ScoresOfHalf:
        """Return a scorer of one half split.

        Parameters
        ----------
        learner
            Parameters of the learner that is stood for.
        X : (n, n_features)
        y, groups : (n,)
            Number of each example's label and slide.

        Returns
        -------
        callable
            Takes which examples are used for training, (n,).
        """


# --------------------
# Fitness of a classification recipe on half splits of extracted windows.


@dataclass(frozen=True, eq=False)
class ClassificationFitness:
    """Evaluation of one recipe; see `texture_estimation.search.FitnessFunction`.

    What is counted is right windows; with a majority vote, whose windows are parts of a slide, right slides.

    Parameters
    ----------
    surrogate
        The learner, or what stands for it.
    learner, rule
        As the recipe has them.
    values : (n, n_features)
    codes, slides : (n,)
    halves : (n_halves, n)
    hop_share
        Distance of the windows over their length.

    Examples
    --------
    >>> import numpy as np
    >>> from texture_estimation.evidence_rules import SoftVote
    >>> from texture_estimation.learners.svm import SvmRbf
    >>> from texture_estimation.search import exact
    >>> codes, slides = np.repeat([0, 1], 4), np.arange(8)
    >>> values = codes[:, None] + 0.1 * np.random.default_rng(0).standard_normal((8, 1))
    >>> halves = (slides % 2 == 0)[None]
    >>> fitness = ClassificationFitness(exact, SvmRbf(), SoftVote(), values, codes, slides, halves)
    >>> fitness.start()(0)  # accuracy on the slides that were trained on, and on the others
    (1.0, 1.0)
    """

    surrogate: Surrogate
    learner: Learner
    rule: EvidenceRule
    values: Array
    codes: Codes
    slides: Codes
    halves: Mask
    hop_share: float = 1.0

    def start(self) -> HalfScorer:
        """Return what gives learning and test accuracy on a half."""
        scores_of = self.surrogate(self.learner, self.values, self.codes, self.slides)

        def half(number: int) -> tuple[float, float]:
            decided, first = self.decided(scores_of, number)
            return shares_right(decided, self.codes[first], self.halves[number][first])

        return half

    def decided(self, scores_of: ScoresOfHalf, number: int) -> tuple[Codes, Codes | slice]:
        """Return the decisions on a half, and the rows of the windows, or of the slides' first ones."""
        scores = scores_of(self.halves[number])
        if isinstance(self.rule, MajorityVote):
            return decided_by_slide(scores, self.slides, self.rule, self.hop_share)
        return decisions(scores), slice(None)


# --------------------
# The learner itself, fitted to each half as `train` would.


def exact(learner: Learner, X: Array, y: Codes, groups: Codes) -> ScoresOfHalf:
    """Return what fits the learner to a half, standardisation included, and lets its exported predictor evaluate.

    Parameters
    ----------
    learner
        Learner of the recipe.
    X : (n, n_features)
        Features of all examples.
    y, groups : (n,)
        Number of the label and of the slide of each.

    Returns
    -------
    callable
        Takes which examples are used for training, (n,), returns scores (n, n_labels).
    """

    def scores(training: Mask) -> Array:
        fitted = learner.fit(X[training], y[training], groups[training])
        return learner.predictor(fitted.parameters)(X)

    return scores


# --------------------
# Which surrogate replaces a learner or a regressor in a search.


def surrogate_of(learner: Any, *, quick: bool = True) -> Surrogate:
    """Return the method `surrogate` of a learner if it has one and it is wanted, else what fits the learner itself."""
    found: Surrogate = getattr(type(learner), 'surrogate', exact) if quick else exact
    return found


def regressor_surrogate_of(regressor: Any, *, quick: bool = True) -> RegressorSurrogate:
    """Return the method `surrogate` of a regressor if it has one and it is wanted, else what fits it itself."""
    found: RegressorSurrogate = getattr(type(regressor), 'surrogate', exact_grades) if quick else exact_grades
    return found


# --------------------
# Searches for recipes that distinguish surfaces.


@dataclass(frozen=True)
class ClassificationTask:
    """What is counted is right decisions; see `texture_estimation.search.SearchTask`.

    Examples
    --------
    >>> from texture_estimation.recipe import Recipe
    >>> recipe = Recipe.from_mapping({'inputs': {'signal': {'features': ['mean']}}}, 'mine')
    >>> ClassificationTask().feature_set_of(recipe).topics
    ('signal',)
    """

    def feature_set_of(self, recipe: Recipe) -> FeatureSet:
        """Return the feature set with the windows that `train` is trained on."""
        return dataclasses.replace(recipe.feature_set, windows=recipe.training_windows, _layouts={})

    def fitness_function(
        self, recipe: Recipe, values: Array, examples: LabelledWindows, halves: Mask, *, quick: bool
    ) -> ClassificationFitness:
        """Return the trial of a recipe."""
        windows = recipe.training_windows
        return ClassificationFitness(
            surrogate=surrogate_of(recipe.learner, quick=quick),
            learner=recipe.learner,
            rule=recipe.evidence,
            values=values,
            codes=examples.codes,
            slides=examples.slides,
            halves=halves,
            hop_share=windows.hop_s / windows.length_s,
        )

    def cost(self, recipe: Recipe, n_samples: int, n_values: int, examples: LabelledWindows) -> float:
        """Return about how many operations a window costs, with half the examples for training."""
        features = [feature for item in recipe.feature_set.inputs for _, feature in item.features]
        return operations(
            features,
            recipe.learner,
            n_samples=n_samples,
            n_values=n_values,
            n_labels=len(examples.names),
            n_training=len(examples.codes) // 2,
        )


# --------------------
# Searches for recipes that grade roughness.


@dataclass(frozen=True)
class RoughnessTask:
    """What is counted is how near the grades come; see `texture_estimation.search.SearchTask`.

    Parameters
    ----------
    grades
        Of each surface, by people.

    Examples
    --------
    >>> task = RoughnessTask(Grades({'silk': 1.0, 'jute': 5.0}))
    >>> task.grades.of('jute')
    5.0
    """

    grades: Grades

    def feature_set_of(self, recipe: RoughnessRecipe) -> FeatureSet:
        """Return the features of the regressor, without those of the checks, with the training windows."""
        inputs = tuple(
            dataclasses.replace(
                item,
                features=tuple((name, feature) for name, feature in item.features if name not in (STICK_SLIP, LEVEL)),
            )
            for item in recipe.feature_set.inputs
        )
        kept = tuple(item for item in inputs if item.features)
        return dataclasses.replace(recipe.feature_set, inputs=kept, windows=recipe.training_windows, _layouts={})

    def fitness_function(
        self, recipe: RoughnessRecipe, values: Array, examples: LabelledWindows, halves: Mask, *, quick: bool
    ) -> RoughnessFitness:
        """Return the trial of a recipe."""
        table = np.array([self.grades.of(name) for name in examples.names])
        return RoughnessFitness(
            regressor_surrogate_of(recipe.regressor, quick=quick),
            recipe.regressor,
            values,
            table[examples.codes],
            examples.codes,
            halves,
        )

    def cost(self, recipe: RoughnessRecipe, n_samples: int, n_values: int, examples: LabelledWindows) -> float:
        """Return about how many operations a window costs, with half the examples for training."""
        features = [feature for item in self.feature_set_of(recipe).inputs for _, feature in item.features]
        return operations(
            features,
            recipe.regressor,
            n_samples=n_samples,
            n_values=n_values,
            n_labels=len(REGRESSOR_GRADES),
            n_training=len(examples.codes) // 2,
        )


# --------------------
# What a search varies: whole numbers, choices, and numbers whose logarithm counts.

Value = int | float | str
Individual = tuple[Value, ...]  # one value for each variable, in the order of the space


class Variable(Protocol):
    """Finitely many values in an order; the search sees them as points between 0 and 1."""

    @property
    def count(self) -> int:
        """How many values there are."""

    def value(self, index: int) -> Value:
        """Return the value of that number, from 0."""

    def index(self, value: Value) -> int:
        """Return the number of a value, or of the nearest one; ValueError if there is none near."""


@dataclass(frozen=True)
class Integer:
    """Whole numbers from `low` to `high`, both included.

    Examples
    --------
    >>> Integer(1, 3).count, Integer(1, 3).value(2)
    (3, 3)
    """

    low: int
    high: int

    def __post_init__(self) -> None:
        _check_range(self.low, self.high)

    @property
    def count(self) -> int:
        """How many values there are."""
        return self.high - self.low + 1

    def value(self, index: int) -> int:
        """Return the value of that number."""
        return self.low + index

    def index(self, value: Value) -> int:
        """Return the number of the nearest value."""
        return round(min(max(_number(value), self.low), self.high)) - self.low


@dataclass(frozen=True)
class LogReal:
    """Numbers from `low` to `high` in equal steps of their logarithm.

    Steps, because nobody tells 1.00 from 1.01 of a box constraint by its accuracy, and what repeats is remembered.

    Examples
    --------
    >>> rate = LogReal(0.1, 10.0, per_decade=1)
    >>> [round(rate.value(index), 3) for index in range(rate.count)]
    [0.1, 1.0, 10.0]
    """

    low: float
    high: float
    per_decade: int = 20

    def __post_init__(self) -> None:
        _check_range(self.low, self.high)
        if not (self.low > 0 and self.high / self.low < math.inf):
            raise InvalidParameter(f'a logarithmic range is {self.low} to {self.high}; it must start above 0 and end')

    @property
    def count(self) -> int:
        """How many values there are."""
        return round(math.log10(self.high / self.low) * self.per_decade) + 1

    def value(self, index: int) -> float:
        """Return the value of that number, in four digits."""
        share = index / max(1, self.count - 1)
        return float(f'{self.low * (self.high / self.low) ** share:.4g}')

    def index(self, value: Value) -> int:
        """Return the number of the nearest value."""
        number = min(max(_number(value), self.low), self.high)
        return round(math.log(number / self.low) / math.log(self.high / self.low) * (self.count - 1))


@dataclass(frozen=True)
class Categorical:
    """One of some names.

    Examples
    --------
    >>> Categorical(('svm', 'mlp')).value(1)
    'mlp'
    """

    options: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.options or len(set(self.options)) != len(self.options):
            raise InvalidParameter(
                f'the options of a choice are {list(self.options)}; name each once, and one at least'
            )

    @property
    def count(self) -> int:
        """How many values there are."""
        return len(self.options)

    def value(self, index: int) -> str:
        """Return the option of that number."""
        return self.options[index]

    def index(self, value: Value) -> int:
        """Return the number of an option."""
        return self.options.index(str(value))


@dataclass(frozen=True)
class SearchSpace:
    """The variables of a search by name, and the way between individuals and points of the unit cube.

    Examples
    --------
    >>> space = SearchSpace({'bands': Integer(1, 4), 'learner': Categorical(('svm', 'mlp'))})
    >>> space.decode(np.array([0.9, 0.1])), space.encode((4, 'svm')).tolist()
    ((4, 'svm'), [0.875, 0.25])
    """

    variables: Mapping[str, Variable]
    _counts: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.variables:
            raise InvalidParameter('the search space has no variables; name one at least')
        counts = np.array([variable.count for variable in self.variables.values()], dtype=np.float64)
        object.__setattr__(self, '_counts', counts)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables, in order."""
        return tuple(self.variables)

    def decode(self, point: Array) -> Individual:
        """Return the individual in whose cell a point of the unit cube lies, (n_variables,).

        Parameters
        ----------
        point : (n_variables,)
            0 to 1 each.
        """
        cells = self._cells(point).astype(int).tolist()
        return tuple(variable.value(cell) for variable, cell in zip(self.variables.values(), cells, strict=True))

    def encode(self, individual: Sequence[Value]) -> Array:
        """Return the middle of an individual's cell, (n_variables,).

        Returns
        -------
        (n_variables,)
            0 to 1 each.

        Raises
        ------
        InvalidParameter
            If a value is none of its variable's.
        """
        try:
            cells = [variable.index(value) for variable, value in zip(self.variables.values(), individual, strict=True)]
        except ValueError as error:
            raise InvalidParameter(
                f'individual {tuple(individual)} is not of the space {self.names}: {error}'
            ) from error
        middle: Array = (np.array(cells) + 0.5) / self._counts
        return middle

    def snap(self, points: Array) -> Array:
        """Return the middles of the cells in which points lie, (..., n_variables): what is alike becomes equal.

        Parameters
        ----------
        points : (..., n_variables)
            0 to 1 each.

        Returns
        -------
        (..., n_variables)
            0 to 1 each.
        """
        middle: Array = (self._cells(points) + 0.5) / self._counts
        return middle

    def named(self, individual: Individual) -> dict[str, Value]:
        """Return the values by the names of the variables."""
        return dict(zip(self.names, individual, strict=True))

    def _cells(self, points: Array) -> Array:
        cells: Array = np.minimum(np.floor(points * self._counts), self._counts - 1)
        return cells


def _number(value: Value) -> float:
    if isinstance(value, str):
        raise ValueError(f'{value!r} is no number')
    return float(value)


def _check_range(low: float, high: float) -> None:
    if not low < high:
        raise InvalidParameter(f'a range goes from {low} to {high}; the first must be the smaller')


# --------------------
# The evolutionary algorithms of pymoo, set up for a search space.

# Crossover and mutation reach this far: low indices make wide steps, which variables of few values need.
WIDTH_INDEX = 3.0
CROSSOVER_SHARE = 0.9


def algorithm_for(
    space: SearchSpace, population: int, n_objectives: int, seed: int, start: Sequence[Individual] = ()
) -> Any:
    """Return a genetic algorithm (one objective) or NSGA-II (two), to be asked for points and given their objectives.

    Parameters
    ----------
    space
        Points are in its unit cube.
    population
        Individuals of a generation.
    n_objectives
        1 or 2; smaller is better.
    seed
        Of all that it draws.
    start
        Individuals of the first generation; the others are drawn.

    Returns
    -------
    pymoo's Algorithm
        Set up, before its first generation.
    """
    library('pymoo', 'searches', 'search')
    from pymoo.algorithms.moo.nsga2 import NSGA2  # noqa: PLC0415
    from pymoo.algorithms.soo.nonconvex.ga import GA  # noqa: PLC0415
    from pymoo.config import Config  # noqa: PLC0415
    from pymoo.core.problem import Problem  # noqa: PLC0415
    from pymoo.core.repair import Repair  # noqa: PLC0415
    from pymoo.core.termination import NoTermination  # noqa: PLC0415
    from pymoo.operators.crossover.sbx import SBX  # noqa: PLC0415
    from pymoo.operators.mutation.pm import PM  # noqa: PLC0415

    class Snap(Repair):  # type: ignore[misc]
        """Bring points to the middles of their cells, so that equal individuals are known as such."""

        def _do(self, problem: Any, points: Array, **_: Any) -> Array:
            return space.snap(points)

    # Its compiled parts would save nothing here, and it prints a notice of their lack.
    Config.warnings['not_compiled'] = False
    problem = Problem(n_var=len(space.names), n_obj=n_objectives, xl=0.0, xu=1.0)
    algorithm = (GA, NSGA2)[n_objectives - 1](
        pop_size=population,
        sampling=_first_points(space, population, seed, start),
        crossover=SBX(eta=WIDTH_INDEX, prob=CROSSOVER_SHARE),
        mutation=PM(eta=WIDTH_INDEX),
        repair=Snap(),
        eliminate_duplicates=True,
    )
    algorithm.setup(problem, termination=NoTermination(), seed=seed)
    return algorithm


def _first_points(space: SearchSpace, population: int, seed: int, start: Sequence[Individual]) -> Array:
    """Return the first generation, (population, n_variables)."""
    given = np.array([space.encode(individual) for individual in start]).reshape(-1, len(space.names))[:population]
    drawn = np.random.default_rng(seed).random((population - len(given), len(space.names)))
    return np.concatenate([given, drawn])


# --------------------
# Individuals of a genetic search with their scores, and how a generation is ranked.

OBJECTIVES = ('accuracy', 'front')


@dataclass(frozen=True)
class SearchParams:
    """How long and for what is searched; the defaults are those of Roberge et al.

    Examples
    --------
    >>> SearchParams(population=10).population
    10
    """

    population: int = param(
        20, 'Sets the number of individuals in a generation; more search wider and take longer.', low=4, high=1000
    )
    generations: int = param(
        30, 'Sets the number of generations, including the first one; more search longer.', low=1, high=10_000
    )
    halves: int = param(20, 'Number of random half splits on which each individual is evaluated.', low=2, high=1000)
    seed: int = param(
        0, 'Sets the seed of the random half splits and of the search; equal seeds give equal results.', low=0
    )
    objective: str = param(
        'accuracy',
        "Sets the objective: 'accuracy', or the Pareto 'front' of accuracy and computing cost (NSGA-II).",
        choices=OBJECTIVES,
    )
    finalists: int = param(
        3, 'Number of best individuals that are evaluated again with the learner itself.', low=1, high=1000
    )
    race: bool = param(True, 'Stop evaluating an individual once it is significantly worse than the best one (racing).')


@dataclass(frozen=True)
class ScoredIndividual:
    """An individual with its fitness (larger is better), its cost and the number of halves behind the fitness.

    Examples
    --------
    >>> ScoredIndividual((3, 'svm'), fitness=0.9, cost=1e4, halves=20).individual
    (3, 'svm')
    """

    individual: Individual
    fitness: float
    cost: float
    halves: int


@dataclass(frozen=True)
class Generation:
    """What is reported after each generation.

    Parameters
    ----------
    number, of
        Of the generation, and how many there will be.
    best
        Of the individuals alive.
    evaluated
        Different individuals met so far.
    cache_hits
        How often one was met again.
    halves
        Evaluated so far: `evaluated` times the number of halves, had none been given up early.

    Examples
    --------
    >>> best = ScoredIndividual((3, 'svm'), fitness=0.9, cost=1e4, halves=20)
    >>> Generation(1, of=30, best=best, evaluated=20, cache_hits=0, halves=400).best.individual
    (3, 'svm')
    """

    number: int
    of: int
    best: ScoredIndividual
    evaluated: int
    cache_hits: int
    halves: int


def rank(one: ScoredIndividual) -> tuple[float, float, str]:
    """Return by what individuals are ranked, the best highest."""
    return one.fitness, -one.cost, str(one.individual)


# --------------------
# Which parts of a recipe a search varies: a table in YAML, and the recipes that individuals stand for.

MAX_INCLUDES = 10
KEYS = ('description', 'include', 'variables', 'recipes', 'pairs_of', 'learners')  # the last three: whom it belongs to
PACKAGE, FOLDER = 'texture_estimation', 'config/search'


@dataclass(frozen=True)
class Axis:
    """A variable, and what each of its values does to a recipe.

    Parameters
    ----------
    variable
        Its values.
    path
        What is set to the value; () if `edits` tell.
    edits
        For each option of a choice.

    Examples
    --------
    >>> from texture_estimation.search import Integer
    >>> [edit] = Axis(Integer(1, 5), ('learner', 'folds')).edits_for(3)
    >>> edit.path, edit.value
    (('learner', 'folds'), 3)
    """

    variable: Variable
    path: tuple[str, ...] = ()
    edits: Mapping[str, tuple[Edit, ...]] | None = None

    def edits_for(self, value: Value) -> tuple[Edit, ...]:
        """Return the changes that a value stands for."""
        return (Edit('set', self.path, value),) if self.edits is None else self.edits[str(value)]


@dataclass(frozen=True)
class RecipeSpace(Generic[R]):
    """The variables of a recipe, of textures or of roughness.

    Examples
    --------
    >>> import numpy as np
    >>> from texture_estimation.recipe import load_recipe
    >>> space = RecipeSpace.load('svm-rbf', load_recipe('any-speed'))
    >>> space.recipe(space.variables.decode(np.full(len(space.variables.names), 0.5))).learner_name
    'svm_rbf'
    """

    base: R
    axes: Mapping[str, Axis]
    name: str = ''

    @classmethod
    def load(cls, name_or_path: str, base: R) -> RecipeSpace[R]:
        """Read a table of variables, by the name of a shipped one or by path.

        Raises
        ------
        UnknownName, InvalidParameter
            If there is none, it is wrong, or the recipe lacks what it varies.
        """
        space = cls(base, _read(name_or_path), Path(name_or_path).stem)
        space.recipe(tuple(axis.variable.value(0) for axis in space.axes.values()))  # refused now, not amid a search
        return space

    @property
    def variables(self) -> SearchSpace:
        """What the search sees."""
        return SearchSpace({name: axis.variable for name, axis in self.axes.items()})

    def recipe(self, individual: Individual) -> R:
        """Return the recipe that an individual stands for."""
        content = copy.deepcopy(self.base.as_mapping())
        for axis, value in zip(self.axes.values(), individual, strict=True):
            for edit in axis.edits_for(value):
                edit.apply(content)
        recipe: R = self.base.from_mapping(content, self.base.name)
        return recipe

    def of_base(self) -> Individual:
        """Return the individual nearest to the recipe itself."""
        content = self.base.as_mapping()
        return tuple(self._present(axis, content) for axis in self.axes.values())

    def table(self) -> list[tuple[str, str, str]]:
        """Return name, kind and range of each variable, for people."""
        return [(name, *_extracted(axis.variable)) for name, axis in self.axes.items()]

    def _present(self, axis: Axis, content: Mapping[str, Any]) -> Value:
        variable = axis.variable
        if axis.edits is not None:
            return next(
                (option for option in axis.edits if self._changes_nothing(axis.edits[option], content)),
                variable.value(0),
            )
        place: Any = content
        for step in axis.path:
            place = enter_place(place, step, axis.path)
        try:
            return variable.value(variable.index(place))
        except ValueError:
            return variable.value(0)

    def _changes_nothing(self, edits: Sequence[Edit], content: Mapping[str, Any]) -> bool:
        changed = copy.deepcopy(dict(content))
        for edit in edits:
            edit.apply(changed)
        same: bool = self.base.from_mapping(changed, '').as_mapping() == content
        return same


def _read(name_or_path: str, depth: int = 0) -> dict[str, Axis]:
    path = find_file(name_or_path, PACKAGE, FOLDER, 'search space')
    content = load_yaml(path, 'search space')
    if not isinstance(content, Mapping):
        raise InvalidParameter(f"search space '{path}' holds no mapping; 'variables' is needed")
    for key in content:
        if key not in KEYS:
            raise InvalidParameter(f"search space '{path}': {unknown_name(str(key), KEYS, 'key')}")
    included, variables = content.get('include') or [], content.get('variables') or {}
    if not isinstance(included, list) or not isinstance(variables, Mapping) or depth > MAX_INCLUDES:
        raise InvalidParameter(
            f"search space '{path}': 'include' is a list, at most {MAX_INCLUDES} deep, and 'variables' a mapping"
        )
    axes: dict[str, Axis] = {}
    for other in included:
        axes.update(_read(str(other), depth + 1))
    for name, entry in variables.items():
        axes[str(name)] = _axis(entry, f"search space '{path.stem}', variable '{name}'")
    return axes


def _axis(entry: Any, where: str) -> Axis:
    if not isinstance(entry, Mapping) or 'kind' not in entry:
        raise InvalidParameter(
            f"{where}: came {safe_repr(entry)}; a mapping with 'kind' ({', '.join(KINDS)}) is needed"
        )
    values = {key: value for key, value in entry.items() if key != 'kind'}
    try:
        return find(KINDS, str(entry['kind']), 'kind of variable')(values)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise InvalidParameter(f'{where}: {dict(entry)} cannot be used ({type(error).__name__}: {error})') from error
    except InvalidParameter as error:
        raise InvalidParameter(f'{where}: {error}') from error


def _integer(entry: Mapping[str, Any]) -> Axis:
    return Axis(Integer(int(entry['low']), int(entry['high'])), path_of(entry['set']))


def _log(entry: Mapping[str, Any]) -> Axis:
    return Axis(LogReal(float(entry['low']), float(entry['high'])), path_of(entry['set']))


def _choice(entry: Mapping[str, Any]) -> Axis:
    options = entry['options']
    if not isinstance(options, Mapping):
        return Axis(Categorical(tuple(map(str, options))), path_of(entry['set']))
    edits = {str(option): tuple(edit_from(step) for step in steps or ()) for option, steps in options.items()}
    return Axis(Categorical(tuple(edits)), edits=edits)


def _use(entry: Mapping[str, Any]) -> Axis:
    path = path_of(entry['feature'])
    return Axis(Categorical(('no', 'yes')), edits={'no': (Edit('drop', path),), 'yes': (Edit('use', path),)})


def _extracted(variable: Variable) -> tuple[str, str]:
    if isinstance(variable, Categorical):
        return 'choice', ', '.join(variable.options)
    kind = 'whole number' if isinstance(variable, Integer) else 'logarithmic'
    return kind, f'{variable.value(0):g} to {variable.value(variable.count - 1):g}'


KINDS = {'integer': _integer, 'log': _log, 'choice': _choice, 'use': _use}


# --------------------
# What was scored is remembered, and kept in a file: a search that is run again goes on where it ended.

FORMAT = 1
MAX_BYTES = 50 * MB  # of a checkpoint; a search of 10 000 individuals writes 10


@dataclass
class ScoreCache:
    """Scores of the individuals met so far.

    A search is a function of its seed and of the scores. So a checkpoint holds the scores alone: begun again with the
    same seed, the search finds them all remembered, and arrives within a second at the generation it had reached.

    Parameters
    ----------
    identity
        What the scores belong to: data, halves, variables. Scores of another identity are refused.

    Examples
    --------
    >>> cache = ScoreCache({'recipe': 'mine'})
    >>> cache.store((3,), HalfScores.of([(1.0, 0.8)]))
    >>> cache.get((3,)).halves
    1
    """

    identity: Mapping[str, Any]
    records: dict[Individual, HalfScores] = field(default_factory=dict)
    hits: int = 0

    def get(self, individual: Individual) -> HalfScores:
        """Return what is known of an individual, EMPTY if nothing is."""
        return self.records.get(individual, EMPTY)

    def store(self, individual: Individual, record: HalfScores) -> None:
        """Remember scores."""
        if record.halves >= self.records.get(individual, EMPTY).halves:
            self.records[individual] = record

    def save(self, path: str | Path) -> None:
        """Write the checkpoint; a reader never sees half a file.

        Raises
        ------
        InvalidParameter
            If the file cannot be written.
        """
        target = Path(path).expanduser()
        content = {
            'format': FORMAT,
            'identity': dict(self.identity),
            'scores': [
                {'individual': list(individual), 'learning': record.learning.tolist(), 'test': record.test.tolist()}
                for individual, record in self.records.items()
            ],
        }
        beside = target.with_name(f'.{target.name}.{os.getpid()}')
        try:
            beside.write_text(json.dumps(content) + '\n', encoding='utf-8')
            beside.replace(target)
        except OSError as error:
            raise InvalidParameter(
                f"the checkpoint cannot be written to '{target}': {error.strerror}; name another file"
            ) from error
        finally:
            beside.unlink(missing_ok=True)

    def load(self, path: str | Path) -> None:
        """Remember what a checkpoint holds.

        Raises
        ------
        InvalidData
            If it cannot be read, or belongs to other data, another search space or another seed.
        """
        try:
            content = load_json(Path(path).expanduser(), MAX_BYTES)
            identity = dict(content['identity']) if content['format'] == FORMAT else None
            records = {
                tuple(entry['individual']): HalfScores(
                    np.array(entry['learning'], float), np.array(entry['test'], float)
                )
                for entry in content['scores']
            }
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InvalidData(
                f"checkpoint '{path}' cannot be read: {error}; give a file that 'texture optimise' has written"
            ) from error
        differing = [name for name, value in self.identity.items() if not identity or identity.get(name) != value]
        if differing:
            raise InvalidData(
                f"checkpoint '{path}' belongs to another search (other {', '.join(differing)}); "
                'give the same recipe, bags and options as then, or start again without it'
            )
        self.records.update(records)


# --------------------
# The genetic search: which individuals are tried, generation by generation.

# Halves on which the first generation finds its leader.
FIRST_LOOK = 4


@dataclass(frozen=True)
class SearchOutcome:
    """What a search found.

    Parameters
    ----------
    ranked
        The last population, best first.
    front
        Those of it that no other beats in both accuracy and cost, cheapest first.
    history
        One entry a generation.

    Examples
    --------
    >>> SearchOutcome(ranked=(), front=(), history=()).history
    ()
    """

    ranked: tuple[ScoredIndividual, ...]
    front: tuple[ScoredIndividual, ...]
    history: tuple[Generation, ...]


def search(
    space: SearchSpace,
    fitness_functions: Callable[[Sequence[Individual]], Sequence[FitnessFunction]],
    params: SearchParams,
    score_cache: ScoreCache,
    *,
    start: Sequence[Individual] = (),
    cost: Callable[[Individual], float] = lambda _: 0.0,
    parallel_map: ParallelMap = serial_map,
    tell: Callable[[Generation], None] = lambda _: None,
) -> SearchOutcome:
    """Return the best individuals of a space.

    Parameters
    ----------
    space
        What is varied.
    fitness_functions
        Makes the trials of individuals; called once a generation with those that need to be evaluated.
    params
        Population, generations, halves, seed and objective.
    score_cache
        Remembers scores; filled from a checkpoint, the search goes on where that one ended.
    start
        Individuals that belong to the first generation; the others are drawn.
    cost
        Second objective of 'front', such as operations a window.
    parallel_map
        Over what the trials are spread.
    tell
        Called after each generation.

    Returns
    -------
    SearchOutcome
        The best individuals, and what each generation was like.
    """
    n_objectives = 2 if params.objective == 'front' else 1
    algorithm = algorithm_for(space, params.population, n_objectives, params.seed, start)
    racer = _Racer(fitness_functions, params, score_cache, cost, parallel_map)
    history: list[Generation] = []
    members: dict[Individual, ScoredIndividual] = {}
    for number in range(1, params.generations + 1):
        offspring = algorithm.ask()
        if offspring is None:  # nothing new is left in a small space
            break
        tried = [space.decode(point) for point in offspring.get('X')]
        scored = racer.score(tried, list(members.values()))
        offspring.set('F', np.array([_objectives(one, params) for one in scored]))
        algorithm.tell(infills=offspring)
        known = {**members, **{one.individual: one for one in scored}}
        members = {key: known[key] for key in (space.decode(point) for point in algorithm.pop.get('X'))}
        best = max(members.values(), key=rank)
        history.append(
            Generation(number, params.generations, best, len(score_cache.records), score_cache.hits, racer.halves)
        )
        tell(history[-1])
    ranked = tuple(sorted(members.values(), key=rank, reverse=True))
    return SearchOutcome(ranked, _front(ranked), tuple(history))


class _Racer:
    """Score individuals, each against one that it must beat to survive."""

    def __init__(
        self,
        fitness_functions: Callable[[Sequence[Individual]], Sequence[FitnessFunction]],
        params: SearchParams,
        score_cache: ScoreCache,
        cost: Callable[[Individual], float],
        parallel_map: ParallelMap,
    ) -> None:
        self._fitness_functions, self._params, self._score_cache = fitness_functions, params, score_cache
        self._cost, self._parallel_map = cost, parallel_map
        self.halves = 0

    def score(self, individuals: Sequence[Individual], parents: Sequence[ScoredIndividual]) -> list[ScoredIndividual]:
        """Return the scores of one generation."""
        self._score_cache.hits += sum(one in self._score_cache.records for one in individuals)
        costs = [self._cost(one) for one in individuals]
        leaders = parents or (self._first_leaders(individuals, costs) if self._params.race else [])
        incumbents = [self._incumbent(leaders, cost) for cost in costs]
        self._race(individuals, incumbents, self._params.halves)
        scored = []
        for one, incumbent, cost in zip(individuals, incumbents, costs, strict=True):
            value, halves = raced_fitness(self._score_cache.records[one], incumbent, self._params.halves)
            scored.append(ScoredIndividual(one, value, cost, halves))
        return scored

    def _first_leaders(self, individuals: Sequence[Individual], costs: Sequence[float]) -> list[ScoredIndividual]:
        """Return the one that does best on a few halves, when there are no parents, evaluated on all."""
        few = min(FIRST_LOOK, self._params.halves)
        self._race(individuals, [None] * len(individuals), few)
        glimpses = [float(self._score_cache.records[one].means[:few].mean()) for one in individuals]
        best = max(range(len(individuals)), key=lambda index: (glimpses[index], -costs[index], -index))
        self._race([individuals[best]], [None], self._params.halves)
        record = self._score_cache.records[individuals[best]]
        return [ScoredIndividual(individuals[best], float(record.means.mean()), costs[best], self._params.halves)]

    def _race(self, individuals: Sequence[Individual], incumbents: Sequence[Array | None], n_halves: int) -> None:
        """Have the memory hold what a verdict on each needs."""
        score_cache = self._score_cache
        known = [score_cache.get(one) for one in individuals]
        open_cases = [index for index, record in enumerate(known) if not _settled(record, incumbents[index], n_halves)]
        fitness_functions = self._fitness_functions([individuals[index] for index in open_cases]) if open_cases else ()
        cases = [
            (fitness_function, known[index], incumbents[index], n_halves)
            for index, fitness_function in zip(open_cases, fitness_functions, strict=True)
        ]
        for index, record in zip(open_cases, self._parallel_map(_race, cases), strict=True):
            self.halves += record.halves - known[index].halves
            score_cache.store(individuals[index], record)

    def _incumbent(self, leaders: Sequence[ScoredIndividual], cost: float) -> Array | None:
        """Return the mean scores on each half of the best of those that cost no more; None without any.

        Whoever is clearly worse than the best need not be known exactly: it is ranked by its estimate.
        """
        n_halves = self._params.halves
        if not self._params.race:
            return None
        fair = [one for one in leaders if one.cost <= cost and one.halves == n_halves]
        if not fair:
            return None
        return self._score_cache.records[max(fair, key=rank).individual].means[:n_halves]


def _race(case: tuple[FitnessFunction, HalfScores, Array | None, int]) -> HalfScores:
    return race(*case)


def _settled(known: HalfScores, incumbent: Array | None, n_halves: int) -> bool:
    """Tell whether what is remembered is enough for a verdict."""
    if known is EMPTY:
        return False
    return known.halves >= n_halves or (
        incumbent is not None and raced_fitness(known, incumbent, known.halves + 1)[1] <= known.halves
    )


def _objectives(one: ScoredIndividual, params: SearchParams) -> list[float]:
    return [-one.fitness, one.cost] if params.objective == 'front' else [-one.fitness]


def _front(scored: Sequence[ScoredIndividual]) -> tuple[ScoredIndividual, ...]:
    """Return those that none beats in accuracy at the same cost or less, cheapest first."""
    front: list[ScoredIndividual] = []
    for one in sorted(scored, key=lambda s: (s.cost, -s.fitness)):
        if not front or one.fitness > front[-1].fitness:
            front.append(one)
    return tuple(front)


# --------------------
# Find the best recipe of a space on labelled slides.


@dataclass(frozen=True, eq=False)
class Finalist(Generic[R]):
    """A recipe evaluated by its own learner on every half.

    Parameters
    ----------
    recipe
        As a file would hold it.
    searched
        Score and cost in the search.
    record
        Learning and test accuracy on each half, by the learner itself.

    Examples
    --------
    >>> from texture_estimation.search import ScoredIndividual
    >>> finalist = Finalist('a recipe', ScoredIndividual((3,), 0.9, 0.0, 2), HalfScores.of([(1.0, 0.8), (1.0, 0.6)]))
    >>> round(finalist.fitness, 3)
    0.85
    """

    recipe: R
    searched: ScoredIndividual
    record: HalfScores

    @property
    def fitness(self) -> float:
        """Mean of learning and test accuracy over all halves."""
        return fitness(self.record.learning, self.record.test)


@dataclass(frozen=True, eq=False)
class SearchResult(Generic[R]):
    """What was found.

    Parameters
    ----------
    best
        The finalist with the highest fitness.
    finalists
        The best of the search, or the whole front of accuracy and cost; best first.
    found
        What the search says of its last generation.
    score_cache
        All scores.

    Examples
    --------
    >>> from texture_estimation.search import ScoredIndividual
    >>> one = ScoredIndividual((3,), 0.9, 0.0, 1)
    >>> finalist = Finalist('a recipe', one, HalfScores.of([(1.0, 0.8)]))
    >>> SearchResult(finalist, (finalist,), SearchOutcome((one,), (one,), ()), ScoreCache({})).best.recipe
    'a recipe'
    """

    best: Finalist[R]
    finalists: tuple[Finalist[R], ...]
    found: SearchOutcome
    score_cache: ScoreCache


def optimise(
    space: RecipeSpace[R],
    search_slides: SearchSlides,
    params: SearchParams,
    task: SearchTask[R],
    *,
    features: FeatureCache | None = None,
    parallel_map: ParallelMap = serial_map,
    checkpoint: str | Path | None = None,
    resume: str | Path | None = None,
    tell: Callable[[Generation], None] = lambda _: None,
) -> SearchResult[R]:
    """Search the space with quick surrogate, then evaluate the best again with the learner itself.

    Parameters
    ----------
    space
        The recipe, and what of it is varied. The recipe itself takes part in the first generation.
    search_slides
        Slides and their halves; with as many halves as `params` has, and its seed.
    params
        Population, generations and so on.
    task
        `ClassificationTask()`, or `RoughnessTask(grades)`.
    features
        Of earlier searches on the same slides, all surfaces included.
    parallel_map
        Over cores or a cluster.
    checkpoint, resume
        File that is written after each generation, and file that is read first.
    tell
        Called after each generation.

    Returns
    -------
    SearchResult
        The best recipes, each evaluated by its own learner.

    Raises
    ------
    InvalidParameter
        If the split has other halves than `params`.
    TextureError
        If slides, features or checkpoint cannot be used.
    """
    if (search_slides.n_halves, search_slides.seed) != (params.halves, params.seed):
        raise InvalidParameter(
            f'the slides have {search_slides.n_halves} half splits with seed {search_slides.seed}, the search asks for '
            f'{params.halves} with seed {params.seed}; give both the same'
        )
    plan = _Plan(space, search_slides, task, features or FeatureCache(search_slides.cut), parallel_map)
    score_cache = ScoreCache(plan.identity)
    if resume:
        score_cache.load(resume)

    def after_generation(generation: Generation) -> None:
        if checkpoint:
            score_cache.save(checkpoint)
        tell(generation)

    found = search(
        space.variables,
        plan.fitness_functions,
        params,
        score_cache,
        start=[space.of_base()],
        cost=plan.cost if params.objective == 'front' else lambda _: 0.0,
        parallel_map=parallel_map,
        tell=after_generation,
    )
    chosen = found.front if params.objective == 'front' else found.ranked[: params.finalists]
    finalists = plan.evaluated_exactly(chosen)
    return SearchResult(finalists[0], finalists, found, score_cache)


class _Plan(Generic[R]):
    """Trials, costs and exact predictions of individuals."""

    def __init__(
        self,
        space: RecipeSpace[R],
        search_slides: SearchSlides,
        task: SearchTask[R],
        features: FeatureCache,
        parallel_map: ParallelMap,
    ) -> None:
        self._space, self._split, self._task, self._features = space, search_slides, task, features
        self._parallel_map = parallel_map
        self.cost = lru_cache(maxsize=None)(self._cost)

    @property
    def identity(self) -> dict[str, Any]:
        """What the scores of this search belong to."""
        examples = self._split.examples(self._space.base.training_windows)
        recipe = json.dumps(self._space.base.as_mapping(), sort_keys=True)
        return {
            'recipe': _digest(recipe),
            'task': _digest(repr(self._task)),
            'variables': {name: repr(axis) for name, axis in self._space.axes.items()},
            'slides': examples.digest,
            'surfaces': list(examples.names),
            'halves': self._split.n_halves,
            'seed': self._split.seed,
        }

    def fitness_functions(self, individuals: Sequence[Individual], *, quick: bool = True) -> list[FitnessFunction]:
        """Return the trials of individuals."""
        recipes = [self._space.recipe(individual) for individual in individuals]
        extracted = self._features.many([self._task.feature_set_of(recipe) for recipe in recipes], self._parallel_map)
        return [
            self._fitness_function(recipe, values[self._split.rows(recipe.training_windows)], quick)
            for recipe, values in zip(recipes, extracted, strict=True)
        ]

    def evaluated_exactly(self, chosen: Sequence[ScoredIndividual]) -> tuple[Finalist[R], ...]:
        """Return the recipes with the scores of their learners on all halves, best first."""
        fitness_functions = self.fitness_functions([one.individual for one in chosen], quick=False)
        n_halves = self._split.n_halves
        cases = [(fitness_function, number) for fitness_function in fitness_functions for number in range(n_halves)]
        scores = self._parallel_map(_one_half, cases)
        finalists = []
        for place, one in enumerate(chosen):
            mine = scores[place * n_halves : (place + 1) * n_halves]
            recipe = self._space.recipe(one.individual)
            finalists.append(Finalist(recipe, one, HalfScores.of(mine)))
        return tuple(sorted(finalists, key=lambda finalist: -finalist.fitness))

    def _fitness_function(self, recipe: R, values: Array, quick: bool) -> FitnessFunction:
        windows = recipe.training_windows
        examples, halves = self._split.examples(windows), self._split.halves(windows)
        return self._task.fitness_function(recipe, values, examples, halves, quick=quick)

    def _cost(self, individual: Individual) -> float:
        recipe = self._space.recipe(individual)
        examples = self._split.examples(recipe.training_windows)
        n_samples = sum(item.samples[0].size for item in examples.inputs.values())
        n_values = self._features.values(self._task.feature_set_of(recipe)).shape[1]
        return self._task.cost(recipe, n_samples, n_values, examples)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def _one_half(case: tuple[FitnessFunction, int]) -> tuple[float, float]:
    fitness_function, number = case
    return fitness_function.start()(number)


# --------------------
# A recipe for each pair of surfaces, found by a search of its own; the surface that wins most pairs is the answer.

Pair = tuple[str, str]


@dataclass(frozen=True, eq=False)
class PairSearchResult:
    """What was found for each pair, and how all pairs do together.

    Parameters
    ----------
    by_pair
        The search of each pair.
    record
        Learning and test accuracy of the most pairs won, over all surfaces, on each half.

    Examples
    --------
    >>> from texture_estimation.search import HalfScores
    >>> round(PairSearchResult({}, HalfScores.of([(1.0, 0.8), (1.0, 0.6)])).fitness, 3)
    0.85
    """

    by_pair: Mapping[Pair, SearchResult[Recipe]]
    record: HalfScores

    @property
    def fitness(self) -> float:
        """Mean of learning and test accuracy of all pairs together."""
        return fitness(self.record.learning, self.record.test)


def optimise_pairs(
    space: RecipeSpace[Recipe],
    search_slides: SearchSlides,
    params: SearchParams,
    *,
    parallel_map: ParallelMap = serial_map,
    checkpoint: str | Path | None = None,
    resume: str | Path | None = None,
    tell: Callable[[Pair, Generation], None] = lambda *_: None,
) -> PairSearchResult:
    """Search for each pair of surfaces by itself, then evaluate all pairs together.

    Arguments are those of `optimise`; each pair has its own checkpoint, named after it.

    Source: Roberge et al., "Textures recognition through tactile exploration", section III.C: the learning is adapted
    to each pair of textures.

    Parameters
    ----------
    space
        The recipe, and what of it is varied.
    search_slides
        Slides and their halves.
    params
        Population, generations and so on.
    parallel_map
        Over cores or a cluster.
    checkpoint, resume
        Files that are written after each generation, and read first.
    tell
        Called after each generation of a pair.

    Returns
    -------
    PairSearchResult
        The recipe of each pair, and what all decide together.
    """
    features = FeatureCache(search_slides.cut)
    names = search_slides.examples(space.base.training_windows).names
    found = {
        pair: optimise(
            space,
            search_slides.only(pair),
            params,
            ClassificationTask(),
            features=features,
            parallel_map=parallel_map,
            checkpoint=checkpoint and beside(checkpoint, pair),
            resume=_reached(resume, pair),
            tell=lambda generation, pair=pair: tell(pair, generation),  # type: ignore[misc]
        )
        for pair in combinations(names, 2)
    }
    votes = [_votes_of(pair, result, search_slides, features) for pair, result in found.items()]
    scores = parallel_map(_evaluated_together, [(votes, number) for number in range(search_slides.n_halves)])
    return PairSearchResult(found, HalfScores.of(scores))


def beside(path: str | Path, pair: Pair) -> Path:
    """Return the path with the pair's name in it: 'best.yaml' → 'best-cork-vs-measured.yaml'."""
    path = Path(path)
    return path.with_name(f'{path.stem}-{pair[0]}-vs-{pair[1]}{path.suffix}')


def _reached(resume: str | Path | None, pair: Pair) -> Path | None:
    """Return the checkpoint of a pair; None if the search that is gone on with had not come to it."""
    path = resume and beside(resume, pair)
    return path if path and path.is_file() else None


@dataclass(frozen=True, eq=False)
class _PairVotes:
    """What the recipe of one pair says of the slides of all surfaces."""

    pair: tuple[int, int]
    learner: Learner
    rule: EvidenceRule
    values: Array
    codes: Codes
    slides: Codes
    halves: Mask
    hop_share: float

    def winners(self, number: int) -> tuple[Codes, Codes]:
        """Return the label that each slide is taken for, by number, or UNDECIDED, and the row of its first window."""
        training = self.halves[number] & np.isin(self.codes, self.pair)
        of_pair = (self.codes[training] == self.pair[1]).astype(np.intp)
        fitted = self.learner.fit(self.values[training], of_pair, self.slides[training])
        scores = self.learner.predictor(fitted.parameters)(self.values)
        decided, first = decided_by_slide(scores, self.slides, self.rule, self.hop_share)
        return np.where(decided == UNDECIDED, UNDECIDED, np.array(self.pair)[decided]), first


def _votes_of(
    pair: Pair, result: SearchResult[Recipe], search_slides: SearchSlides, features: FeatureCache
) -> _PairVotes:
    recipe = result.best.recipe
    windows = recipe.training_windows
    examples = search_slides.examples(windows)
    return _PairVotes(
        pair=(examples.names.index(pair[0]), examples.names.index(pair[1])),
        learner=recipe.learner,
        rule=recipe.evidence,
        values=features.values(ClassificationTask().feature_set_of(recipe)),
        codes=examples.codes,
        slides=examples.slides,
        halves=search_slides.halves(windows),
        hop_share=windows.hop_s / windows.length_s,
    )


def _evaluated_together(case: tuple[list[_PairVotes], int]) -> tuple[float, float]:
    votes, number = case
    wins: Array | None = None
    for of_pair in votes:
        winners, first = of_pair.winners(number)
        codes, training = of_pair.codes[first], of_pair.halves[number][first]
        wins = np.zeros((len(codes), int(codes.max()) + 1)) if wins is None else wins
        rows = np.flatnonzero(winners != UNDECIDED)
        wins[rows, winners[rows]] += 1.0
    assert wins is not None
    return shares_right(decisions(wins), codes, training)


# --------------------
# Recipes that a search has found, written as files that `texture train` reads.


@dataclass(frozen=True)
class Written:
    """The files that a search has written, and what it found in lines for people.

    Examples
    --------
    >>> Written((checkpoint_of('best.yaml'),), ('nothing yet',)).files[0].name
    'best.search.json'
    """

    files: tuple[Path, ...]
    lines: tuple[str, ...]


def checkpoint_of(out: str | Path) -> Path:
    """Return where the scores of a search are kept: 'best.yaml' → 'best.search.json'."""
    path = Path(out)
    return path.with_name(f'{path.stem}.search.json')


def written_checkpoints(out: str | Path) -> list[Path]:
    """Return the checkpoint of a search that is there, or those of its pairs."""
    path = checkpoint_of(out)
    return [path] if path.is_file() else sorted(path.parent.glob(f'{path.stem}-*-vs-*{path.suffix}'))


def write_recipes(
    found: SearchResult[Any] | PairSearchResult, base: Any, tuned: str, params: SearchParams, target: Path
) -> Written:
    """Write the best recipe, with the others of a front beside it; of pairs, theirs and the one that joins them.

    Where a recipe comes from and its scores stand at the top of its file.

    Parameters
    ----------
    found
        What was found.
    base
        Recipe from which the search began.
    tuned
        How it was named.
    params
        Parameters of the search.
    target
        Path of the recipe.

    Returns
    -------
    Written
        The files, with the checkpoint of a search that has one, and what was found.

    Raises
    ------
    InvalidParameter
        If a file cannot be written.
    """
    origin = (
        f'Found by `texture optimise {tuned}`: {params.population} individuals, {params.generations} '
        f'generations, {params.halves} halves, seed {params.seed}.'
    )
    files = _files(found, target, front=params.objective == 'front')
    for path, finalist in files.items():
        _write(finalist.recipe, path, origin, _scores(finalist))
    written = Written(tuple(files), tuple(f'{path}: {_scores(finalist)}' for path, finalist in files.items()))
    if isinstance(found, PairSearchResult):
        return _with_joined(written, found, base, origin, target)
    return Written((*written.files, checkpoint_of(target)), written.lines)


def _with_joined(written: Written, pairs: PairSearchResult, base: Recipe, origin: str, target: Path) -> Written:
    """Write the recipe that joins those of the pairs, or say why there is none."""
    together = f'all pairs together, most pairs won: {_shares(pairs.record)}'
    try:
        joined = joined_recipe({pair: found.best.recipe for pair, found in pairs.by_pair.items()}, base)
    except InvalidParameter as error:
        return Written(written.files, (*written.lines, together, f'no recipe of all pairs was written: {error}'))
    _write(joined, target, origin, together)
    return Written((target, *written.files), (*written.lines, f'{target}: {together}'))


def _files(found: SearchResult[Any] | PairSearchResult, target: Path, *, front: bool) -> Mapping[Path, Finalist[Any]]:
    if isinstance(found, PairSearchResult):
        return {beside(target, pair): one.best for pair, one in found.by_pair.items()}
    others = [one for one in found.finalists if front and one is not found.best]
    numbered = {target.with_name(f'{target.stem}-{n}{target.suffix}'): one for n, one in enumerate(others, 2)}
    return {target: found.best} | numbered


def _write(recipe: Any, path: Path, origin: str, scores: str) -> None:
    content = yaml.safe_dump(recipe.as_mapping(), sort_keys=False, allow_unicode=True, width=120)
    with writing(path):
        path.write_text(f'# {origin}\n# {scores}.\n{content}', encoding='utf-8')


def _scores(finalist: Finalist[Any]) -> str:
    return f'fitness {100 * finalist.fitness:.1f} %: {_shares(finalist.record)} over {finalist.record.halves} halves'


def _shares(record: HalfScores) -> str:
    return f'training {100 * record.learning.mean():.1f} %, tested {100 * record.test.mean():.1f} %'

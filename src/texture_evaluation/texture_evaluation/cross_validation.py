# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Cross-validate recipes on a data set: splits by slide and condition, figures, comparison."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any
from warnings import catch_warnings, filterwarnings

import numpy as np
from joblib import Parallel, delayed, parallel_config
from numpy.typing import NDArray
from scipy.stats import binomtest
from sklearn.model_selection import GroupShuffleSplit, LeaveOneGroupOut, PredefinedSplit, StratifiedGroupKFold
from threadpoolctl import threadpool_limits

from texture_core.cli import progress
from texture_core.config import library, unknown_name
from texture_core.errors import InvalidData, InvalidParameter, counted
from texture_core.types import AnyArray, Array
from texture_estimation.evidence import EvidenceAccumulator, single_decisions
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe, load_recipe
from texture_estimation.training import train
from texture_evaluation import metrics
from texture_evaluation.charts import COLOURS, chart, line_styles
from texture_evaluation.metrics import SlideResult, curve
from texture_evaluation.train import slide_digests, training_examples, unusable
from texture_features.feature_set import LabelledFeatures
from texture_recordings.dataset import CONDITIONS, SlideDataset

# --------------------
# Spread work over the cores of this machine, or over a Dask cluster.

ANSWER_S, WORKERS_S = 4, 4  # for a scheduler to answer, and for its first worker to come
# What scheduler and workers must have as this process has it: both unpack what is computed, and a scheduler that cannot
# reports it in its log only, while all others wait.
ON_CLUSTER = ('texture_core', 'texture_features', 'texture_estimation', 'texture_recordings', 'texture_evaluation')
CLUSTER_ADVICE = (
    'start both with `ros-run dask scheduler` and `ros-run dask worker ADDRESS`, or in shells that have sourced the '
    'suite'
)


def single_blas_thread() -> AbstractContextManager[Any]:
    """Keep linear algebra from starting threads within a `with` block: the cores are busy already."""
    return threadpool_limits(limits=1, user_api='blas')


@contextmanager
def dask_backend(address: str) -> Iterator[None]:
    """Have joblib use the workers of a Dask cluster, which have this suite installed, within a `with` block."""
    cluster_of = library('distributed', "Dask clusters ('--dask')", 'dask')

    try:
        # A scheduler that takes connections and is silent would hold up the client for minutes.
        asyncio.run(asyncio.wait_for(_reach(cluster_of.comm.connect, address), ANSWER_S))
        client: Any = cluster_of.Client(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, ValueError, asyncio.TimeoutError, RuntimeError, ImportError) as error:
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise InvalidParameter(
            f"no Dask scheduler answers at '{address}' ({reason}); {CLUSTER_ADVICE}, "
            "or leave '--dask' out to use this machine's cores"
        ) from error
    with client:
        _check_cluster(client, address)
        with client.as_current(), parallel_config(backend='dask'):
            yield


async def _reach(connect: Any, address: str) -> None:
    await (await connect(address, timeout=ANSWER_S)).close()


def _check_cluster(client: Any, address: str) -> None:
    """Raise InvalidParameter if a cluster has no worker, or not everywhere what this process has."""
    try:
        client.wait_for_workers(1, timeout=WORKERS_S)
    except TimeoutError as error:
        raise InvalidParameter(f"the Dask scheduler at '{address}' has no worker; {CLUSTER_ADVICE}") from error
    versions = client.get_versions(packages=ON_CLUSTER)
    own = versions['client']['packages']
    places = {f"the Dask scheduler at '{address}'": versions['scheduler']}
    places |= {f"the Dask worker '{worker}'": found for worker, found in versions['workers'].items()}
    for place, found in places.items():
        for name in ON_CLUSTER:
            has = found['packages'].get(name)
            if own[name] and has != own[name]:
                raise InvalidParameter(f'{place} has {has or "no"} {name}, {own[name]} is needed; {CLUSTER_ADVICE}')


# --------------------
# Accuracy of windows and slides, with 95 % intervals by bootstrap over clusters, widened by what none of them shows.

RESAMPLES, CONFIDENCE = 2000, 0.95  # of the bootstrap


def figures(results: Sequence[SlideResult], clusters: Sequence[str] | None = None) -> dict[str, Any]:
    """Return accuracy and acceptance of windows and slides with 95 % intervals, and rejections by their reason."""
    of_clusters = np.arange(len(results)).astype(str) if clusters is None else np.array(clusters, dtype=str)
    counts = {
        'window_accuracy': window_counts(results),
        'slide_accuracy': slide_counts(results),
        'accepted_correct': _counted([one.end.accepted and one.end.label == one.surface for one in results]),
        'accepted_wrong': _counted([one.end.accepted and one.end.label != one.surface for one in results]),
    }
    at_s, intervals_at_s, n_at_s = {}, {}, {}
    for seconds in metrics.TIMES_S:
        ends = [result.after(seconds) for result in results]
        reached = [row for row, end in enumerate(ends) if end is not None]
        right = _counted([end.label == one.surface for one, end in zip(results, ends, strict=True) if end is not None])
        key = f'{seconds:.1f}'
        at_s[key], intervals_at_s[key] = _accuracy_of(right, of_clusters[reached])
        n_at_s[key] = len(reached)
    accuracies = {name: _accuracy_of(pair, of_clusters) for name, pair in counts.items()}
    return {
        'rejections': metrics.rejections(results),
        'n_slides': len(results),
        'n_windows': sum(len(result.window_labels) for result in results),
        'n_clusters': len(set(of_clusters.tolist())),
        **{name: value for name, (value, _) in accuracies.items()},
        **{f'{name}_interval': pair for name, (_, pair) in accuracies.items()},
        'accuracy_at_s': at_s,
        'accuracy_at_s_interval': intervals_at_s,
        'n_slides_at_s': n_at_s,
    }


def _counted(which: Sequence[bool]) -> Array:
    """Return 0 or 1, and 1, for each slide, (n_slides, 2)."""
    return np.array([(one, 1) for one in which], dtype=np.float64).reshape(-1, 2)


def _accuracy_of(counts: Array, clusters: AnyArray) -> tuple[float | None, list[float] | None]:
    """Return an accuracy and its interval; None for both without an answer."""
    right, answers = counts.sum(axis=0)
    return (float(right / answers), interval(counts, clusters)) if answers else (None, None)


def interval(counts: Array, clusters: Sequence[str] | AnyArray | None = None) -> list[float]:
    """Return the 95 % interval of an accuracy by bootstrap over clusters: answers within one are not independent.

    A kind of cluster that none of n has shown may still be up to 1 - 0.05^(1/n) of all, and be all right or all wrong:
    that widens the interval. Source of this bound, which is exact where all answers or none are right: Clopper &
    Pearson 1934.
    """
    counts = counts if clusters is None else clustered(counts, clusters)
    counts = counts[counts[:, 1] > 0]
    right, answers = counts.sum(axis=0)
    accuracy = float(right / answers)
    # Lower bound of the fraction of clusters like those tested
    bound = float((1.0 - CONFIDENCE) ** (1.0 / len(counts)))
    low, high = _edges(_resampled(counts))
    return [min(low, accuracy * bound), max(high, 1.0 - (1.0 - accuracy) * bound)]


def clustered(counts: Array, clusters: Sequence[str] | AnyArray) -> Array:
    """Return right and all answers of each cluster, (n_clusters, 2), by the sorted names of the clusters."""
    row = np.unique(clusters, return_inverse=True)[1]
    return np.stack([np.bincount(row, column) for column in counts.T], axis=1)


def _resampled(counts: Array) -> Array:
    """Return the accuracy in each resample of the rows, (..., RESAMPLES), of (..., n_clusters, 2)."""
    # Always the same resamples: the figures of a page do not change from run to run.
    n_rows = counts.shape[-2]
    drawn = np.random.default_rng(0).integers(n_rows, size=(RESAMPLES, n_rows))
    sums = counts[..., drawn, :].sum(axis=-2)
    return sums[..., 0] / sums[..., 1]


def _edges(drawn: Array) -> list[float]:
    """Return the ends of the 95 % interval of resampled values, (RESAMPLES,)."""
    return list(map(float, np.quantile(drawn, [(1.0 - CONFIDENCE) / 2, (1.0 + CONFIDENCE) / 2])))


def window_counts(results: Sequence[SlideResult]) -> Array:
    """Return right and all windows of each slide, (n_slides, 2)."""
    counts = [(sum(label == one.surface for label in one.window_labels), len(one.window_labels)) for one in results]
    return np.array(counts, dtype=np.float64).reshape(-1, 2)


def slide_counts(results: Sequence[SlideResult]) -> Array:
    """Return whether each slide is right, and 1, (n_slides, 2)."""
    return _counted([one.estimates[-1].label == one.surface for one in results])


# --------------------
# Split in the order of time: the first slides of each label train, the later ones test.


class ChronologicalSplit:
    """One split per label in the order of time, with the interface of scikit-learn's splitters.

    Sensors wear and drift: slides that were recorded later are harder than slides drawn at random from the same hours.
    """

    def __init__(self, train_size: float = 0.75) -> None:
        if not 0.0 < train_size < 1.0:
            raise InvalidParameter(f'train_size is {train_size}; a fraction above 0 and below 1 is needed')
        self.train_size = train_size

    def split(  # X is there because scikit-learn's splitters have it
        self,
        X: object,
        y: AnyArray,
        groups: AnyArray | None = None,
    ) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Yield the rows that train and those that test, in the order of time; those of a group stay together."""
        labels = np.asarray(y)
        slides = np.arange(len(labels)) if groups is None else np.asarray(groups)
        tests = np.zeros(len(labels), dtype=bool)
        for label in np.unique(labels):
            rows = np.flatnonzero(labels == label)
            order = list(dict.fromkeys(slides[rows].tolist()))
            if len(order) < 2:
                raise InvalidData(
                    f"'{label}' has a single slide; a chronological split needs two or more slides of each surface"
                )
            # A surface that is on one side only would be an impossible test, or none.
            count = min(max(round(self.train_size * len(order)), 1), len(order) - 1)
            tests[rows] = np.isin(slides[rows], order[count:])
        yield np.flatnonzero(~tests), np.flatnonzero(tests)


# --------------------
# The outcome of a cross-validation.

# The shift between training and test where this condition is on one side only.
SHIFTS: Mapping[str, str] = {
    'sensor': 'other finger',
    **{name: f'other {name}' for name in ('place', 'speed', 'force', 'direction', 'motion')},
}
NO_PLACE = 'place not compared'  # positions may be missing, and a specimen may have been moved


def bags_compared(pairs: Iterable[tuple[Collection[str], Collection[str]]]) -> str:
    """Return whether the tested bags, the second of each pair, are among the trained ones, by their names."""
    same = {bag in trained if bag and trained else None for trained, tested in pairs for bag in tested}
    if None in same:
        return 'bag not given'  # arrays without a session, or a model without a list of its bags
    return ' and '.join(word for word, there in (('same', True), ('other', False)) if there in same) + ' bag'


@dataclass(frozen=True, eq=False)
class FoldResult:
    """What came out of one split."""

    name: str
    trained_on: tuple[str, ...]
    results: Mapping[str, SlideResult] = field(repr=False)  # arrays that would flood a terminal
    model: TextureModel = field(repr=False)


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Results of all folds, and pooled over them."""

    recipe: str
    labels: tuple[str, ...]
    folds: tuple[FoldResult, ...]
    unusable: tuple[str, ...] = ()
    shift: str = NO_PLACE
    clusters: Mapping[str, str] = field(default_factory=dict)
    intervals_over: str = 'slides'
    untested: Mapping[str, int] = field(default_factory=dict)

    @property
    def pooled(self) -> list[SlideResult]:
        """Results of all test slides of all folds."""
        return [result for fold in self.folds for result in fold.results.values()]

    @property
    def too_little_training(self) -> str:
        """How many folds reject every label, and why the first does, in one sentence; '' if none does."""
        reasons = [fold.model.acceptance.reason for fold in self.folds if fold.model.acceptance.reason]
        return f'{len(reasons)} of {len(self.folds)} folds reject every label: {reasons[0]}' if reasons else ''

    def figures(self, folds: Sequence[FoldResult]) -> dict[str, Any]:
        """Return the figures of folds together, with intervals over clusters; see the function `figures`.

        Those of acceptance are None where all folds reject every label.
        """
        named = [item for fold in folds for item in fold.results.items()]
        found = figures([result for _, result in named], [self.clusters.get(name, name) for name, _ in named])
        if all(fold.model.acceptance.reason for fold in folds):
            found |= dict.fromkeys(key for key in found if key.startswith('accepted_'))
        return found

    def as_json(self) -> dict[str, Any]:
        """Return the pooled figures, those of each fold, all with 95 % intervals, and the estimate of each test slide.

        `feature_set` is the fingerprint of the features, as in the card of a model, and `version` that of the suite.
        """
        return {
            'recipe': self.recipe,
            'feature_set': self.folds[0].model.feature_set,
            'version': version('texture_evaluation'),
            'shift': self.shift,
            'too_little_training': self.too_little_training,
            'intervals_over': self.intervals_over,
            **self.figures(self.folds),
            'labels': list(self.labels),
            'confusion': metrics.confusion(self.pooled, self.labels).tolist(),
            'folds': [
                {
                    'name': fold.name,
                    'trained_on': list(fold.trained_on),
                    **self.figures([fold]),
                    'slides': {
                        name: {'label': result.end.label, 'rejection': result.end.rejection.name.lower()}
                        for name, result in fold.results.items()
                    },
                }
                for fold in self.folds
            ],
            'unusable': list(self.unusable),
            'untested': dict(self.untested),
        }


# --------------------
# Compare two recipes on the same test slides: an exact test, and the difference with an interval.


@dataclass(frozen=True)
class PairedComparison:
    """Two recipes on the same test slides."""

    first: str
    second: str
    n_slides: int
    n_clusters: int
    only_first: int
    only_second: int
    p_value: float
    slide_difference: float
    slide_interval: tuple[float, float]
    window_difference: float
    window_interval: tuple[float, float]


def compare(first: CrossValidation, second: CrossValidation) -> PairedComparison:
    """Compare two recipes that were cross-validated on the same splits.

    Parameters
    ----------
    first, second
        Results of `cross_validate` with the same data set and splitter.

    Returns
    -------
    PairedComparison
        Positive differences mean that the second is better.

    Raises
    ------
    InvalidData
        If no slide was tested by both.

    Notes
    -----
    Sources: McNemar 1947, the exact form by the binomial distribution; Efron & Tibshirani 1993, chapter 13.
    """
    one, other = ({name for fold in result.folds for name in fold.results} for result in (first, second))
    slides = sorted(one & other)
    if not slides:
        raise InvalidData(f"no slide was tested by '{first.recipe}' and by '{second.recipe}'; use the same split")
    right, windows = (
        np.stack([_counts(result, slides, of_windows=of_windows) for result in (first, second)])
        for of_windows in (False, True)
    )
    # A slide may be tested in several folds, and half right is not recognised.
    recognised = right[..., 0] > 0.5 * right[..., 1]
    only_first, only_second = (int((recognised[a] & ~recognised[b]).sum()) for a, b in ((0, 1), (1, 0)))
    clusters = [first.clusters.get(name, name) for name in slides]
    right, windows = (np.stack([clustered(results, clusters) for results in both]) for both in (right, windows))
    alike = np.stack([clustered(_counted(results), clusters)[:, 0] for results in recognised])  # slides of each cluster
    # The exact two-sided McNemar (sign) test; 1 if the two never differ.
    ahead, differing = int((alike[0] > alike[1]).sum()), int((alike[0] != alike[1]).sum())
    p_value = float(binomtest(ahead, differing).pvalue) if differing else 1.0
    slide_difference, slide_interval = _difference(right)
    window_difference, window_interval = _difference(windows)
    return PairedComparison(
        first.recipe, second.recipe, len(slides), right.shape[1], only_first, only_second, p_value,
        slide_difference, slide_interval, window_difference, window_interval,
    )  # fmt: skip


def _counts(result: CrossValidation, slides: Sequence[str], *, of_windows: bool) -> Array:
    """Return right and all answers of each slide over all folds, (n_slides, 2)."""
    place = {name: row for row, name in enumerate(slides)}
    counts = np.zeros((len(slides), 2))
    for fold in result.folds:
        kept = {name: one for name, one in fold.results.items() if name in place}
        if kept:
            counted = (window_counts if of_windows else slide_counts)(list(kept.values()))
            counts[[place[name] for name in kept]] += counted
    return counts


def _difference(counts: Array) -> tuple[float, tuple[float, float]]:
    """Return second minus first accuracy, and its interval; `counts` is (2, n_clusters, 2)."""
    first, second = (right / answers for right, answers in counts.sum(axis=1))
    # Both recipes on the same resampled clusters: what is hard for both widens no interval.
    drawn = _resampled(counts)
    low, high = _edges(drawn[1] - drawn[0])
    return float(second - first), (low, high)


# --------------------
# Draw cross-validated recipes next to each other: accuracies with intervals, and slides over sliding time.

KINDS = (('window', 'single windows', 'o'), ('slide', 'whole slides', 's'))


def comparison_chart(results: Sequence[CrossValidation], title: str, path: str | Path) -> Path:
    """Draw the accuracy of windows and slides with 95 % intervals, and that of slides over their time.

    Parameters
    ----------
    results
        One for each recipe.
    title
        What was split, and how.
    path
        File of the picture.

    Returns
    -------
    Path
    """
    with chart(path, (6.0, 5.0 + 0.5 * len(results)), title) as figure:
        accuracies, times = figure.subplots(2, 1, height_ratios=(1.4 + 0.5 * len(results), 3.6))
        _draw_accuracies(accuracies, results)
        widths = np.linspace(4.0, 1.5, len(results))  # of lines that coincide each is seen
        for result, style, width in zip(results, line_styles(), widths, strict=False):
            seconds, accuracy = curve(result.pooled)
            times.plot(seconds, 100 * accuracy, label=result.recipe, linewidth=width, clip_on=False, **style)
        times.set(xlabel='sliding time used (s), as far as all slides reach', ylabel='accuracy of slides (%)')
        times.set(xlim=(0, None), ylim=(None, 100))
        figure.legend(*times.get_legend_handles_labels(), loc='outside lower left')
    return Path(path)


def _draw_accuracies(axes: Any, results: Sequence[CrossValidation]) -> None:
    figures = [result.as_json() for result in results]
    rows = np.arange(len(results))
    for (kind, name, marker), colour, offset in zip(KINDS, COLOURS, (-0.12, 0.12), strict=False):
        accuracies = 100 * np.array([one[f'{kind}_accuracy'] for one in figures])
        edges = 100 * np.array([one[f'{kind}_accuracy_interval'] for one in figures]).T
        errors = np.maximum([accuracies - edges[0], edges[1] - accuracies], 0.0)
        axes.errorbar(
            accuracies, rows + offset, xerr=errors, fmt=marker, color=colour, capsize=3, label=name, clip_on=False
        )
    axes.set_yticks(rows, [result.recipe for result in results])
    axes.set(xlabel='accuracy (%) and 95 % interval', xlim=(None, 100), ylim=(len(results) - 0.5, -0.5))
    axes.legend(loc='lower left', bbox_to_anchor=(0, 1), ncols=2)


# --------------------
# What `texture cross-validate` names: a splitter, and what must not be in training and test.

TEST_SIZE = 0.25  # of a random split


@dataclass(frozen=True)
class Split:
    """A splitter by name."""

    name: str
    splitter: Any  # of scikit-learn, or with its interface
    groups: str | AnyArray = 'slide'
    parts: int = 1

    def cut(self, dataset: SlideDataset) -> SlideDataset:
        """Return the slides that are split: those of the data set, or their parts."""
        return dataset if self.parts == 1 else dataset.in_parts(self.parts)


def parse_split(text: str, seed: int = 0) -> Split:
    """Return what a text such as 'stratified:5', 'leave-one-out:speed', 'chronological:0.75' or 'random:20' names."""
    name, _, argument = text.partition(':')
    if name not in SPLITS:
        raise InvalidParameter(f"the split is '{text}': {unknown_name(name, SPLITS, 'split')}; {ALLOWED}")
    try:
        split = SPLITS[name](text, argument, seed)
        if getattr(split.splitter, 'n_splits', 1) < 1:
            raise ValueError
        return split
    except ValueError as error:
        raise InvalidParameter(f"the split is '{text}'; {ALLOWED}") from error


def _leave_one_out(name: str, argument: str) -> Split:
    condition, _, parts = argument.partition(':')
    of_place = condition == 'place'
    count = int(parts or 2) if of_place else 1
    if condition not in (*CONDITIONS, 'slide') or (parts and count < 2):
        allowed = f'leave one of {", ".join(CONDITIONS)} or slide out; of place name 2 or more parts, as place:4'
        raise InvalidParameter(f"the split is '{name}'; {allowed}")
    return Split(name, LeaveOneGroupOut(), condition, count)


SPLITS: Mapping[str, Callable[[str, str, int], Split]] = {
    'stratified': lambda name, folds, seed: Split(
        name, StratifiedGroupKFold(int(folds or 5), shuffle=True, random_state=seed)
    ),
    'leave-one-out': lambda name, condition, _seed: _leave_one_out(name, condition),
    'chronological': lambda name, value, _seed: Split(name, ChronologicalSplit(float(value or 0.75))),
    'random': lambda name, splits, seed: Split(
        name, GroupShuffleSplit(int(splits or 20), test_size=TEST_SIZE, random_state=seed)
    ),
}
ALLOWED = (
    f'write stratified:FOLDS (2 or more), leave-one-out:CONDITION ({", ".join(CONDITIONS)}; place:PARTS), '
    'chronological:TRAINING_FRACTION (between 0 and 1) or random:SPLITS (1 or more)'
)


# --------------------
# Split labelled slides into folds of training and test slides.


def split_slides(
    dataset: SlideDataset, splitter: Any, groups: str | AnyArray = 'slide'
) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Return the training and test slides of each split, by their index in the data set.

    Where parts of one slide would be in training and test, a split becomes two, each trained on every other slide of
    a surface and tests on those between.
    """
    if not hasattr(splitter, 'split') or isinstance(splitter, (str, type)):
        raise InvalidData(f'the splitter is {splitter!r}; give one of scikit-learn, such as StratifiedKFold(5)')
    columns, labels = slide_groups(dataset, groups), dataset.labels
    if type(splitter).__name__.startswith('Stratified'):
        _check_folds(labels, getattr(splitter, 'n_splits', 1))
    if isinstance(splitter, LeaveOneGroupOut) and len(np.unique(columns)) < 2:
        what = groups if isinstance(groups, str) else 'group'
        raise InvalidData(
            f"the slides cannot be split: all are of one {what}, '{columns[0]}'; import or record slides of a second "
            f'{what}, or use the split stratified:5'
        )
    try:
        with catch_warnings():
            if isinstance(groups, str) and groups == 'slide':  # the caller gave none
                filterwarnings('ignore', 'The groups parameter is ignored')
            splits = list(splitter.split(np.zeros((len(labels), 1)), labels, columns))
    except ValueError as error:
        raise InvalidData(f'the slides cannot be split: {error}; use another split or record more slides') from error
    return [part for train, test in splits for part in _of_other_slides(dataset, train, test)]


def _of_other_slides(
    dataset: SlideDataset, train: NDArray[np.intp], test: NDArray[np.intp]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Yield a split as it is, or as two if parts of a slide are in training and test."""
    wholes = np.array([slide.whole_name for slide in dataset])
    if not np.isin(wholes[test], wholes[train]).any():
        yield train, test
        return
    # Every other slide by its number: sensors drift, and both halves span the whole time.
    order: dict[str, dict[int, int]] = {}  # of the numbers of each surface
    for slide in sorted(dataset, key=lambda slide: slide.number):
        order.setdefault(slide.surface, {}).setdefault(slide.number, len(order[slide.surface]))
    odd = np.array([order[slide.surface][slide.number] % 2 == 1 for slide in dataset])
    for tested in (odd, ~odd):
        yield train[~tested[train]], test[tested[test]]


Rows = NDArray[np.intp]


def of_trained_surfaces(
    labels: AnyArray, splits: Sequence[tuple[Rows, Rows]], *, sessions: bool = False
) -> list[tuple[Rows, Rows]]:
    """Return splits that test no slide of a surface that they do not train: it could not be right."""
    possible = [(train, test[np.isin(labels[test], labels[train])]) for train, test in splits]
    left = [(train, test) for train, test in possible if len(test)]
    if not left:
        trained, tested = (', '.join(np.unique(labels[rows]).tolist()) for rows in splits[0])
        advice = 'if each session holds one surface, set `session` in the mapping or ' * sessions
        raise InvalidData(
            f'no surface is tested where it is trained; in the first fold, trained are {trained}; tested are {tested}; '
            f'{advice}use the split stratified'
        )
    return left


def _check_folds(labels: AnyArray, folds: int) -> None:
    names, counts = np.unique(labels, return_counts=True)
    if counts.min() < folds:
        raise InvalidData(
            f"'{names[counts.argmin()]}' has {counted(int(counts.min()), 'slide')}, too few for {folds} folds; "
            'use fewer folds or record more slides'
        )


def slide_groups(dataset: SlideDataset, groups: str | AnyArray) -> AnyArray:
    """Return the group of each slide."""
    if not isinstance(dataset, SlideDataset):
        raise InvalidData(f'the data set is {dataset!r:.80}; give a SlideDataset, such as SlideDataset.from_bags(bags)')
    if isinstance(groups, str):
        wholes = np.array([slide.whole_name for slide in dataset])
        return wholes if groups == 'slide' else dataset.condition(groups)
    columns = np.asarray(groups)
    if columns.shape != (len(dataset),):
        raise InvalidData(
            f'groups have the shape {columns.shape}; one value for each of {len(dataset)} slides is needed'
        )
    return columns


# --------------------
# Cross-validate a recipe on labelled slides: the one loop of training and testing.


def cross_validate(
    recipe: Recipe | str,
    dataset: SlideDataset,
    splitter: Any,
    n_jobs: int | None = None,
    *,
    groups: str | AnyArray = 'slide',
) -> CrossValidation:
    """Train a recipe on some slides and test it on others, for each split of the slides.

    Features are computed once for all folds. The splitter divides slides, so no slide is in training and test. A slide
    is tested as on the robot: window by window, from the accumulated evidence.

    Parameters
    ----------
    recipe
        Trained again for each fold; or its name or path.
    dataset
        The slides.
    splitter
        One of scikit-learn's, such as `StratifiedGroupKFold(5)`, or a `ChronologicalSplit`; it is called with one row
        for each slide.
    n_jobs
        Number of folds computed at once, as joblib counts (-1: one per core). None: 1, or what a surrounding
        `joblib.parallel_config` selects, such as the workers of a Dask cluster.
    groups
        What must not be in training and test: 'slide', a condition such as 'speed', or an array (n_slides,).

    Returns
    -------
    CrossValidation
        Results of every slide of every fold.

    Raises
    ------
    InvalidData
        If two slides have the same samples, a split is impossible, no slide has a window, a fold has fewer than two
        surfaces to train on, or no surface is tested where it is trained.

    Examples
    --------
    Cross-validate the default recipe by leaving one speed out::

        dataset = SlideDataset.from_bags(['recordings'])
        result = cross_validate('default', dataset, LeaveOneGroupOut(), groups='speed')
        print(result.as_json()['window_accuracy'])
    """
    recipe = load_recipe(recipe) if isinstance(recipe, str) else recipe
    columns = slide_groups(dataset, groups)
    slide_digests(dataset)
    splits = split_slides(dataset, splitter, groups)
    requested = {row for _, test in splits for row in test.tolist()}
    splits = of_trained_surfaces(dataset.labels, splits, sessions=isinstance(groups, str) and groups == 'session')
    untested = requested - {row for _, test in splits for row in test.tolist()}
    names = dataset.names
    named = [
        (names[train_rows], names[test_rows], _fold_name(number, columns, test_rows))
        for number, (train_rows, test_rows) in enumerate(splits, 1)
    ]
    # Computed once for all folds: windows as the recipe classifies them, and as it is trained on.
    tested = trained = dataset.features(recipe.feature_set)
    further = recipe.augmentation.copies or recipe.training.slowest_m_s
    if recipe.training_windows != recipe.feature_set.windows or further:
        trained = training_examples(recipe, dataset)
    done = Parallel(n_jobs=n_jobs, return_as='generator')(
        delayed(_fold)(recipe, trained.of_slides(train), tested.of_slides(test), train, name)
        for train, test, name in named
    )
    folds = list(progress(done, f"cross-validating '{recipe.name}', folds", len(named)))
    # What is certain of the shift: the condition that was left out, and the bags.
    left_out = SHIFTS.get(groups, '') if isinstance(groups, str) else 'other group'
    sessions = np.array([slide.session for slide in dataset])
    bags = bags_compared((set(sessions[train_rows]), set(sessions[test_rows])) for train_rows, test_rows in splits)
    place = '' if left_out == SHIFTS['place'] else NO_PLACE
    shift = '; '.join(filter(None, (left_out, bags, place)))
    # Slides that were left out together are no independent draws; a splitter of a user's own may group by anything.
    grouped: list[Any] = columns.tolist()
    by_slide = isinstance(groups, str) and groups == 'slide'
    known = type(splitter).__module__.startswith('sklearn.') and not isinstance(splitter, PredefinedSplit)
    if by_slide and not (known or isinstance(splitter, ChronologicalSplit)):
        by_slide = False
        grouped = [[fold for fold, (_, rows) in enumerate(splits, 1) if row in rows] for row in range(len(dataset))]
    clusters = [
        slide.whole_name if by_slide else f'{slide.surface} {group}'
        for slide, group in zip(dataset, grouped, strict=True)
    ]
    return CrossValidation(
        recipe.name,
        tuple(np.unique(dataset.labels).tolist()),
        tuple(folds),
        tuple(unusable(dataset, tested)),
        shift,
        dict(zip(names.tolist(), clusters, strict=True)),
        'slides' if by_slide else 'clusters (surface × what was left out)',
        dict(Counter(dataset.labels[sorted(untested)].tolist())),
    )


def predict_slides(model: TextureModel, features: LabelledFeatures) -> dict[str, SlideResult]:
    """Return the estimates of a model for each slide, by its name, window by window as on the robot."""
    results = {}
    for slide in dict.fromkeys(features.groups.tolist()):
        # The empty last vector closes the evidence as on the robot.
        *windows, end = features.vectors(slide)
        evidence = EvidenceAccumulator(model)
        estimates = [evidence.update(vector) for vector in windows]
        alone = single_decisions(model, np.stack([vector.values for vector in windows]))
        surface = str(features.labels[features.groups == slide][0])
        results[slide] = SlideResult(surface, alone, estimates, evidence.update(end), model.recipe.evidence.group)
    return results


def _fold_name(number: int, groups: AnyArray, test_rows: NDArray[np.intp]) -> str:
    left_out = np.unique(groups[test_rows])
    if len(left_out) != 1 or len(test_rows) < 2:
        return str(number)  # the name of a single slide does not describe the fold
    return f'{left_out[0]:g}' if np.issubdtype(left_out.dtype, np.number) else str(left_out[0])


def _fold(
    recipe: Recipe, trained: LabelledFeatures, tested: LabelledFeatures, trained_on: AnyArray, name: str
) -> FoldResult:
    """Return what a fold gave."""
    try:
        model = train(recipe, trained)
    except InvalidData as error:
        raise InvalidData(f"fold '{name}' cannot be trained: {error}") from error
    return FoldResult(name, tuple(trained_on.tolist()), predict_slides(model, tested), model)

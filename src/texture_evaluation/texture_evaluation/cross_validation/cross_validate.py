"""Cross-validate a recipe on labelled slides: the one loop of training and testing."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed  # type: ignore[import-untyped]
from numpy.typing import NDArray

from texture_core.arrays import AnyArray, Array
from texture_core.errors import InvalidData
from texture_core.plain_data import write_json
from texture_estimation.classification.training import train
from texture_estimation.evidence import EvidenceAccumulator, single_decisions
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe
from texture_evaluation import metrics
from texture_evaluation.cross_validation.splits import Splitter
from texture_evaluation.metrics import SlideResult
from texture_evaluation.train import training_examples
from texture_features.labelled_features import LabelledFeatures
from texture_recordings.slide_dataset import SlideDataset

RESAMPLES, CONFIDENCE = 2000, 0.95  # of the bootstrap


@dataclass(frozen=True, eq=False)
class FoldResult:
    """What came out of one split.

    Parameters
    ----------
    name
        Number of the fold from 1, or the condition left out.
    trained_on
        Names of the training slides.
    results
        By the name of the test slide.
    model
        Trained on the training slides.
    train_s
        Processor time of the training, from features to the model, s.
    """

    name: str
    trained_on: tuple[str, ...]
    results: Mapping[str, SlideResult]
    model: TextureModel
    train_s: float


@dataclass(frozen=True, eq=False)
class FoldFeatures:
    """Features of all slides, computed once for all folds, and for all recipes of the same windows and features.

    Parameters
    ----------
    trained
        Windows as the recipe is trained on, with its augmentation.
    tested
        Windows as the recipe classifies them.
    """

    trained: LabelledFeatures
    tested: LabelledFeatures

    @classmethod
    def of(cls, recipe: Recipe, dataset: SlideDataset) -> FoldFeatures:
        """Return the features of a recipe; raise InvalidData if no slide has a window."""
        tested = dataset.features(recipe.feature_set)
        further = recipe.augmentation.copies or recipe.training.touch_s or recipe.training.slowest_m_s
        if recipe.training_windows == recipe.feature_set.windows and not further:
            return cls(tested, tested)
        return cls(training_examples(recipe, dataset), tested)


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Results of all folds, and pooled over them.

    Parameters
    ----------
    recipe
        Name of the recipe.
    labels
        All surfaces of the data set.
    folds
        In their order.
    unusable
        Names of test slides without a whole window, which count nowhere.
    """

    recipe: str
    labels: tuple[str, ...]
    folds: tuple[FoldResult, ...]
    unusable: tuple[str, ...] = ()

    @property
    def pooled(self) -> list[SlideResult]:
        """Results of all test slides of all folds."""
        return [result for fold in self.folds for result in fold.results.values()]

    def as_json(self) -> dict[str, Any]:
        """Return the pooled figures with 95 % intervals, those of each fold, and the label of each test slide."""
        return {
            'recipe': self.recipe,
            **figures(self.pooled),
            'window_accuracy_interval': interval(self.pooled, window_counts),
            'slide_accuracy_interval': interval(self.pooled, slide_counts),
            'labels': list(self.labels),
            'confusion': metrics.confusion(self.pooled, self.labels).tolist(),
            'folds': [
                {
                    'name': fold.name,
                    'trained_on': list(fold.trained_on),
                    **figures(list(fold.results.values())),
                    'slides': {name: result.estimates[-1].label for name, result in fold.results.items()},
                }
                for fold in self.folds
            ],
            'unusable': list(self.unusable),
        }

    def write(self, path: str | Path) -> None:
        """Write the figures as JSON; InvalidParameter if the file cannot be written."""
        write_json(self.as_json(), path)


def figures(results: Sequence[SlideResult]) -> dict[str, Any]:
    """Return the shares of windows and slides that are right, and how many slides there are; None without slides."""
    return {
        'n_slides': len(results),
        'n_windows': sum(len(result.window_labels) for result in results),
        'window_accuracy': metrics.window_accuracy(results) if results else None,
        'slide_accuracy': metrics.accuracy_at_end(results) if results else None,
        'accuracy_at_s': dict(metrics.accuracy_at_times(results)),
    }


def cross_validate(
    recipe: Recipe,
    dataset: SlideDataset,
    splitter: Splitter,
    n_jobs: int | None = None,
    *,
    groups: str | AnyArray = 'slide',
    features: FoldFeatures | None = None,
) -> CrossValidation:
    """Train a recipe on some slides and test it on others, for each split of the slides.

    Features are computed once for all folds. The splitter divides slides, so no slide is ever on both sides. A slide
    is tested as on the robot: window by window, from the accumulated evidence.

    Parameters
    ----------
    recipe
        Trained again for each fold.
    dataset
        The slides.
    splitter
        One of scikit-learn's, such as `StratifiedGroupKFold(5)`, or a `ChronologicalSplit`; it is called with one row
        for each slide.
    n_jobs
        Number of folds computed at once, as joblib counts (-1: one per core). None: 1, or what a surrounding
        `joblib.parallel_config` says, such as the workers of a Dask cluster.
    groups
        What must not be on both sides: 'slide', a condition of the data set, such as 'speed', or an array (n_slides,).
    features
        Those of the recipe, if they were computed already.

    Returns
    -------
    CrossValidation
        Results of every slide of every fold.

    Raises
    ------
    InvalidData
        If a split is impossible, no slide has a window, or a fold has fewer than two surfaces to train on.

    Examples
    --------
    Cross-validate the default recipe by leaving one speed out::

        dataset = SlideDataset.from_bags(['recordings'])
        result = cross_validate(load_recipe('default'), dataset, LeaveOneGroupOut(), groups='speed')
        print(result.as_json()['window_accuracy'])
    """
    columns = _groups(dataset, groups)
    splits = split_slides(dataset, splitter, columns)
    features = features or FoldFeatures.of(recipe, dataset)
    names = dataset.names
    folds = Parallel(n_jobs=n_jobs)(
        delayed(_fold)(
            recipe,
            features.trained.of_slides(names[train_rows]),
            features.tested.of_slides(names[test_rows]),
            tuple(names[train_rows].tolist()),
            _fold_name(number, columns, test_rows),
        )
        for number, (train_rows, test_rows) in enumerate(splits, 1)
    )
    usable = set(features.tested.groups.tolist())
    return CrossValidation(
        recipe.name,
        tuple(np.unique(dataset.labels).tolist()),
        tuple(folds),
        tuple(name for name in names.tolist() if name not in usable),
    )


def predict_slides(model: TextureModel, features: LabelledFeatures) -> dict[str, SlideResult]:
    """Return what a model says of each slide, by its name, window by window as on the robot."""
    results = {}
    for slide in dict.fromkeys(features.groups.tolist()):
        *windows, end = features.vectors(slide)
        evidence = EvidenceAccumulator(model)
        estimates = [evidence.update(vector) for vector in windows]
        alone = single_decisions(model, np.stack([vector.values for vector in windows]))
        surface = str(features.labels[features.groups == slide][0])
        results[slide] = SlideResult(surface, alone, estimates, evidence.update(end), model.recipe.evidence.group)
    return results


def interval(results: Sequence[SlideResult], counts: Callable[[Sequence[SlideResult]], Array]) -> list[float]:
    """Return the 95 % interval of a share by bootstrap over slides: windows of a slide are not independent.

    Parameters
    ----------
    results
        Of the test slides.
    counts
        Gives right and all answers of each slide, (n_slides, 2).

    Source: Efron & Tibshirani 1993, chapter 13 (percentile interval).
    """
    pairs = counts(results)
    drawn = np.random.default_rng(0).integers(len(pairs), size=(RESAMPLES, len(pairs)))
    sums = pairs[drawn].sum(axis=1)
    edges = np.quantile(sums[:, 0] / sums[:, 1], [(1.0 - CONFIDENCE) / 2, (1.0 + CONFIDENCE) / 2])
    return [float(edge) for edge in edges]


def window_counts(results: Sequence[SlideResult]) -> Array:
    """Return right and all windows of each slide, (n_slides, 2).

    Returns
    -------
    (n_slides, 2)
        Whole numbers.
    """
    counts = [(sum(label == one.surface for label in one.window_labels), len(one.window_labels)) for one in results]
    return np.array(counts, dtype=np.float64)


def slide_counts(results: Sequence[SlideResult]) -> Array:
    """Return whether each slide is right, and 1, (n_slides, 2).

    Returns
    -------
    (n_slides, 2)
        0 or 1, and 1.
    """
    return np.array([(one.estimates[-1].label == one.surface, 1) for one in results], dtype=np.float64)


def split_slides(
    dataset: SlideDataset, splitter: Splitter, groups: str | AnyArray = 'slide'
) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Return the training and test slides of each split, by their place in the data set.

    Parameters
    ----------
    dataset
        The slides.
    splitter
        One of scikit-learn's, or a `ChronologicalSplit`.
    groups
        As in `cross_validate`.

    Returns
    -------
    list of ((n_train,), (n_test,))
        Indices of slides.

    Raises
    ------
    InvalidData
        If the slides cannot be split so.
    """
    labels, columns = dataset.labels, _groups(dataset, groups)
    folds = getattr(splitter, 'n_splits', 1)
    names, counts = np.unique(labels, return_counts=True)
    if type(splitter).__name__.startswith('Stratified') and counts.min() < folds:
        raise InvalidData(
            f"'{names[counts.argmin()]}' has {counts.min()} slides, too few for {folds} folds; "
            'use fewer folds or record more slides'
        )
    try:
        return list(splitter.split(np.zeros((len(labels), 1)), labels, columns))
    except ValueError as error:
        raise InvalidData(f'the slides cannot be split: {error}; use another split or record more slides') from error


def _groups(dataset: SlideDataset, groups: str | AnyArray) -> AnyArray:
    if isinstance(groups, str):
        return dataset.names if groups == 'slide' else dataset.condition(groups)
    columns = np.asarray(groups)
    if columns.shape != (len(dataset),):
        raise InvalidData(
            f'groups have the shape {columns.shape}; one value for each of {len(dataset)} slides is needed'
        )
    return columns


def _fold_name(number: int, groups: AnyArray, test_rows: NDArray[np.intp]) -> str:
    left_out = np.unique(groups[test_rows])
    if len(left_out) != 1 or len(test_rows) < 2:
        return str(number)
    return f'{left_out[0]:g}' if np.issubdtype(left_out.dtype, np.number) else str(left_out[0])


def _fold(
    recipe: Recipe, trained: LabelledFeatures, tested: LabelledFeatures, trained_on: tuple[str, ...], name: str
) -> FoldResult:
    start = time.process_time()
    try:
        model = train(recipe, trained)
    except InvalidData as error:
        raise InvalidData(f"fold '{name}' cannot be trained: {error}") from error
    taken_s = time.process_time() - start
    return FoldResult(name, trained_on, predict_slides(model, tested), model, taken_s)

"""Cross-validate a recipe on labelled slides: the one loop of training and testing."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed  # type: ignore[import-untyped]
from numpy.typing import NDArray

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData
from texture_estimation.classification.training import train
from texture_estimation.evidence import EvidenceAccumulator, single_decisions
from texture_estimation.model import TextureModel
from texture_estimation.recipe import Recipe
from texture_evaluation.cross_validation.cross_validation import CrossValidation, FoldResult
from texture_evaluation.cross_validation.slide_splits import SPLIT_ADVICE, refuse_untrained, slide_groups, split_slides
from texture_evaluation.cross_validation.splits import Splitter
from texture_evaluation.metrics import SlideResult
from texture_evaluation.train import training_examples
from texture_features.labelled_features import LabelledFeatures
from texture_recordings.slide_dataset import SlideDataset


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
        If a split is impossible, no slide has a window, a fold has fewer than two surfaces to train on, or a surface is
        tested but never trained.

    Examples
    --------
    Cross-validate the default recipe by leaving one speed out::

        dataset = SlideDataset.from_bags(['recordings'])
        result = cross_validate(load_recipe('default'), dataset, LeaveOneGroupOut(), groups='speed')
        print(result.as_json()['window_accuracy'])
    """
    columns = slide_groups(dataset, groups)
    splits = split_slides(dataset, splitter, columns)
    refuse_untrained(dataset.labels, splits)
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
        raise InvalidData(f"fold '{name}' cannot be trained: {error}; {SPLIT_ADVICE}") from error
    taken_s = time.process_time() - start
    return FoldResult(name, trained_on, predict_slides(model, tested), model, taken_s)

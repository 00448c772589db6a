"""Recipes, estimators and recordings of the user's own on the chart beside the shipped recipes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from sklearn.model_selection import StratifiedGroupKFold

from texture_core.errors import InvalidData
from texture_estimation.recipe import AUGMENTATION, Recipe, load_recipe
from texture_evaluation.cross_validation.splits import Split
from texture_features.recipe_file import read_recipe
from texture_recordings.slide_dataset import SlideDataset

OWN_DATA = 'own recordings'
FOLDS = 5
# Beside these a recipe is drawn: what is shipped for use, and one method of each paper.
BESIDE = (
    'default', 'fast', 'vibration-and-taxels', 'any-speed', 'ets-linear-svm', 'hu-pca-svm', 'kaboli-svm-rbf',
    'jamali-naive-bayes-5',
)  # fmt: skip
SKLEARN = 'sklearn.'


def own_recipe(name: str) -> Recipe:
    """Return the recipe that a name means: shipped, a file, or `default` with a classifier of scikit-learn.

    Raises
    ------
    UnknownName, InvalidParameter
        If there is none, or it contains something unknown or impossible.
    """
    if not name.startswith(SKLEARN):
        return load_recipe(name)
    _, content = read_recipe('default')
    trained = {key: value for key, value in content['training'].items() if key != AUGMENTATION}  # only networks take it
    return Recipe.from_mapping({**content, 'training': trained, 'learner': {'sklearn': {'estimator': name}}}, name)


def takes_windows(name: str) -> bool:
    """Return whether a name is of a class that takes windows of samples, as those of aeon do."""
    return ':' in name and not name.startswith(SKLEARN)


def shown_name(name: str) -> str:
    """Return what a method is called in tables and charts: the class of an estimator, or the name of a recipe."""
    if ':' in name:
        return name.partition(':')[2]
    return f'{Path(name).stem} (own)' if Path(name).suffix else name


def folds_of(dataset: SlideDataset, seed: int) -> Split:
    """Return five folds by slide, or as many as the surface with the fewest slides allows.

    Raises
    ------
    InvalidData
        If a surface has a single slide, or there is but one surface.
    """
    labels, counts = np.unique(dataset.labels, return_counts=True)
    fewest = int(counts.min())
    if fewest < 2 or len(labels) < 2:
        raise InvalidData(
            f"'{labels[counts.argmin()]}' has {fewest} slides of {len(labels)} surfaces; two slides of two "
            'surfaces are needed to train and to test'
        )
    count = min(FOLDS, fewest)
    return Split(f'{count} folds by slide', StratifiedGroupKFold(count, shuffle=True, random_state=seed))


def tells_motion(dataset: SlideDataset) -> bool:
    """Return whether all slides tell their speed, so that recipes may use it."""
    return bool(np.isfinite([slide.speed_m_s for slide in dataset]).all())

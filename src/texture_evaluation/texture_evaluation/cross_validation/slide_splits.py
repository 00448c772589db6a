"""Split labelled slides into folds of training and test slides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData
from texture_evaluation.cross_validation.splits import Splitter
from texture_recordings.slide_dataset import SlideDataset

SPLIT_ADVICE = 'if each session holds one surface, set `session` in the mapping or use the split stratified'


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
    labels, columns = dataset.labels, slide_groups(dataset, groups)
    if type(splitter).__name__.startswith('Stratified'):
        _check_folds(labels, getattr(splitter, 'n_splits', 1))
    try:
        return list(splitter.split(np.zeros((len(labels), 1)), labels, columns))
    except ValueError as error:
        raise InvalidData(f'the slides cannot be split: {error}; use another split or record more slides') from error


def refuse_untrained(labels: AnyArray, splits: Sequence[tuple[NDArray[np.intp], NDArray[np.intp]]]) -> None:
    """Refuse splits in which a surface is never trained where it is tested: its slides could not be right.

    Parameters
    ----------
    labels : (n_slides,)
        Surface of each slide.
    splits
        As `split_slides` returns them. One that trains on a single surface is left to the training, which refuses it.

    Raises
    ------
    InvalidData
        With the surfaces.
    """
    sides = [(set(labels[train].tolist()), set(labels[test].tolist())) for train, test in splits]
    if any(len(trained) < 2 for trained, _ in sides):
        return
    possible = {label for trained, tested in sides for label in trained & tested}
    untrained = sorted({label for _, tested in sides for label in tested} - possible)
    if untrained:
        names = ', '.join(f"'{label}'" for label in untrained)
        raise InvalidData(f'tested but never trained in the same fold: {names}; {SPLIT_ADVICE}')


def _check_folds(labels: AnyArray, folds: int) -> None:
    names, counts = np.unique(labels, return_counts=True)
    if counts.min() < folds:
        raise InvalidData(
            f"'{names[counts.argmin()]}' has {counts.min()} slides, too few for {folds} folds; "
            'use fewer folds or record more slides'
        )


def slide_groups(dataset: SlideDataset, groups: str | AnyArray) -> AnyArray:
    """Return the group of each slide.

    Parameters
    ----------
    groups
        'slide', the name of a condition, or one value for each slide.

    Returns
    -------
    (n_slides,)

    Raises
    ------
    InvalidData
        If there are not as many values as slides.
    """
    if isinstance(groups, str):
        return dataset.names if groups == 'slide' else dataset.condition(groups)
    columns = np.asarray(groups)
    if columns.shape != (len(dataset),):
        raise InvalidData(
            f'groups have the shape {columns.shape}; one value for each of {len(dataset)} slides is needed'
        )
    return columns

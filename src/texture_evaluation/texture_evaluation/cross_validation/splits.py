"""What `--cross-validate` names: a splitter, and what must not be on both sides of a split."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import GroupShuffleSplit, LeaveOneGroupOut, StratifiedGroupKFold

from texture_core.arrays import AnyArray
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidParameter
from texture_evaluation.cross_validation.chronological_split import ChronologicalSplit
from texture_recordings.slide_dataset import CONDITIONS

TEST_SIZE = 0.25  # of a random split


class Splitter(Protocol):
    """Interface of scikit-learn's splitters."""

    def split(self, X: Any, y: Any, groups: Any) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Yield train and test rows.

        Parameters
        ----------
        X : (n, ...)
            One row for each slide; only their number matters.
        y, groups : (n,)
            Label and group of each row.

        Yields
        ------
        ((n_train,), (n_test,))
            Indices.
        """


@dataclass(frozen=True)
class Split:
    """A splitter by name.

    Parameters
    ----------
    name
        As the user writes it, such as 'leave-one-out:speed'.
    splitter
        Divides slides.
    groups
        What must not be on both sides: 'slide', a condition of `SlideDataset`, such as 'speed', or an array,
        (n_slides,).
    """

    name: str
    splitter: Splitter
    groups: str | AnyArray = 'slide'


def parse_split(text: str, seed: int = 0) -> Split:
    """Return what a text such as 'stratified:5', 'leave-one-out:speed', 'chronological:0.75' or 'random:20' names.

    Parameters
    ----------
    text
        Name of a split, and after a colon its number or condition.
    seed
        Seed of the splits that draw slides.

    Raises
    ------
    InvalidParameter
        With what is allowed.
    """
    name, _, argument = text.partition(':')
    if name not in SPLITS:
        raise InvalidParameter(f"the split is '{text}': {unknown_name(name, SPLITS, 'split')}; {ALLOWED}")
    try:
        return SPLITS[name](text, argument, seed)
    except ValueError as error:
        raise InvalidParameter(f"the split is '{text}': {error}; {ALLOWED}") from error


def _stratified(name: str, argument: str, seed: int) -> Split:
    return Split(name, StratifiedGroupKFold(int(argument or 5), shuffle=True, random_state=seed))


def _leave_one_out(name: str, argument: str, seed: int) -> Split:
    if argument not in (*CONDITIONS, 'slide'):
        raise InvalidParameter(f"the split is '{name}'; leave one of {', '.join(CONDITIONS)} or slide out")
    return Split(name, LeaveOneGroupOut(), argument)


def _chronological(name: str, argument: str, seed: int) -> Split:
    return Split(name, ChronologicalSplit(float(argument or 0.75)))


def _random(name: str, argument: str, seed: int) -> Split:
    return Split(name, GroupShuffleSplit(int(argument or 20), test_size=TEST_SIZE, random_state=seed))


SPLITS: Mapping[str, Callable[[str, str, int], Split]] = {
    'stratified': _stratified,
    'leave-one-out': _leave_one_out,
    'chronological': _chronological,
    'random': _random,
}
ALLOWED = (
    f'write stratified:FOLDS, leave-one-out:CONDITION ({", ".join(CONDITIONS)}), '
    'chronological:TRAINING_FRACTION or random:SPLITS'
)

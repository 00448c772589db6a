"""Split in the order of time: the first slides of each label train, the later ones test."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData, InvalidParameter


class ChronologicalSplit:
    """One split per label in the order of time, with the interface of scikit-learn's splitters.

    Sensors wear and drift: slides that were recorded later are harder than slides drawn at random from the same hours.

    Parameters
    ----------
    train_size
        Fraction of the groups of each label that train, above 0 and below 1. At least one group of each label trains
        and at least one tests.

    Raises
    ------
    InvalidParameter
        If `train_size` is not between 0 and 1.

    Examples
    --------
    >>> labels = ['cork'] * 4 + ['felt'] * 4
    >>> [(train, test)] = ChronologicalSplit(0.75).split(labels, labels)
    >>> train.tolist(), test.tolist()
    ([0, 1, 2, 4, 5, 6], [3, 7])
    """

    def __init__(self, train_size: float = 0.75) -> None:
        if not 0.0 < train_size < 1.0:
            raise InvalidParameter(f'train_size is {train_size}; a fraction above 0 and below 1 is needed')
        self.train_size = train_size

    def get_n_splits(self, *_args: object, **_named: object) -> int:
        """Return 1, whatever else scikit-learn's splitters take."""
        return 1

    def split(  # X is there because scikit-learn's splitters have it
        self,
        X: object,
        y: AnyArray,
        groups: AnyArray | None = None,
    ) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Yield the rows that train and those that test; rows are in the order of time, those of a group stay together.

        Raises
        ------
        InvalidData
            If a label has a single group.
        """
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
            count = min(max(round(self.train_size * len(order)), 1), len(order) - 1)
            tests[rows] = np.isin(slides[rows], order[count:])
        yield np.flatnonzero(~tests), np.flatnonzero(tests)

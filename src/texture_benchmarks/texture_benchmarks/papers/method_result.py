"""What came out of a method on trial: what each slide was taken for in each split of the slides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_benchmarks.papers.interval import Interval, share
from texture_core.arrays import AnyArray, Array
from texture_estimation.learners.learner import Codes
from texture_estimation.search.fitness import UNDECIDED


@dataclass(frozen=True, eq=False)
class MethodResult:
    """Decisions on all slides.

    Parameters
    ----------
    surfaces
        Names.
    codes : (n_slides,)
        Number of the surface of each slide.
    conditions : (n_slides,) of text
        How it was touched.
    decided : (n_divisions, n_slides)
        Number of the surface that it is taken for, or UNDECIDED.
    trained_on : (n_divisions, n_slides)
        Whether it was trained on.
    train_s
        Mean time of a training and of classifying all slides.
    note
        What else is to be reported of the training.
    """

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
        shares: AnyArray = table / np.maximum(table.sum(axis=1, keepdims=True), 1.0)
        return shares

    def right(self, of: NDArray[np.bool_] | None = None) -> Array:
        """Return how often each slide was recognised when held out, (n_tested,); `of` (n_slides,) chooses.

        Parameters
        ----------
        of : (n_slides,) bool
            Which slides count; None for all.

        Returns
        -------
        (n_tested,)
            0 to 1.
        """
        return self._tested(self.decided == self.codes, of)

    def taken_for(self, first: str, second: str, of: NDArray[np.bool_] | None = None) -> Array:
        """Return how often each slide was taken for the other one of two surfaces, (n_tested,).

        Parameters
        ----------
        first, second
            Labels of the two surfaces.
        of : (n_slides,) bool
            Which slides count; None for all.

        Returns
        -------
        (n_tested,)
            0 to 1.
        """
        pair = [self.surfaces.index(first), self.surfaces.index(second)]
        other = np.select([self.codes == pair[0], self.codes == pair[1]], [pair[1], pair[0]], default=UNDECIDED - 1)
        return self._tested(self.decided == other, of)

    def wrong(self) -> Array:
        """Return how often each slide was taken for another surface, (n_tested,); what is unclassified is not.

        Returns
        -------
        (n_tested,)
            0 to 1.
        """
        return self._tested((self.decided != self.codes) & (self.decided != UNDECIDED))

    def nothing(self) -> Array:
        """Return how often each slide was taken for nothing, (n_tested,).

        Returns
        -------
        (n_tested,)
            0 to 1.
        """
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
        shares: Array = (events & ~self.trained_on).sum(axis=0)[chosen] / times
        return shares

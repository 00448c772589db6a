"""From decisions between two labels each to votes: the label that wins most pairs."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array

TIES = ('unclassified', 'nearest')


@dataclass(frozen=True)
class PairVotes:
    """Counts what each label wins, in the pairs (0, 1), (0, 2), …, (1, 2), ….

    Parameters
    ----------
    n_labels
        At least 2.

    Examples
    --------
    >>> votes = PairVotes(3)  # pairs (0, 1), (0, 2), (1, 2)
    >>> votes.won(np.array([True, True, False])).tolist()
    [2.0, 0.0, 1.0]
    """

    n_labels: int

    @classmethod
    def of_pairs(cls, n_pairs: int) -> PairVotes:
        """Return what counts the votes of so many pairs, which are those of all labels.

        Examples
        --------
        >>> PairVotes.of_pairs(6).n_labels
        4
        """
        return cls(round((1.0 + (1.0 + 8.0 * n_pairs) ** 0.5) / 2.0))

    def __post_init__(self) -> None:
        pairs = np.array(list(combinations(range(self.n_labels), 2)))
        first = np.eye(self.n_labels)[pairs[:, 0]]
        second = np.eye(self.n_labels)[pairs[:, 1]]
        object.__setattr__(self, '_second_wins_all', second.sum(axis=0))
        object.__setattr__(self, '_swing', first - second)

    def won(self, first_wins: NDArray[np.bool_]) -> Array:
        """Return how many pairs each label wins, (..., n_labels), of who wins each pair, (..., n_pairs).

        Whole numbers without rounding: labels that tie are equal to the last bit, which means unclassified.

        Parameters
        ----------
        first_wins : (..., n_pairs) bool
            Whether the first label of each pair wins.

        Returns
        -------
        (..., n_labels)
            Whole numbers, 0 to n_labels - 1.
        """
        wins: Array = first_wins @ self._swing + self._second_wins_all  # type: ignore[attr-defined]
        return wins

    def counted(self, decisions: Array | NDArray[np.float32], ties: str) -> Array:
        """Return the pairs won, (..., n_labels), of decisions, (..., n_pairs); `ties` is one of TIES.

        Parameters
        ----------
        decisions : (..., n_pairs)
            Positive for the first label of a pair.
        ties
            'unclassified' leaves ties, 'nearest' breaks them by the clearer decisions.

        Returns
        -------
        (..., n_labels)
            Number of pairs won.
        """
        return self.won_clearly(decisions) if ties == 'nearest' else self.won(decisions > 0)

    def won_clearly(self, decisions: Array | NDArray[np.float32]) -> Array:
        """Return the pairs won, and less than half a pair more for the clearer decisions, which breaks ties.

        Parameters
        ----------
        decisions : (..., n_pairs)
            Positive for the first label of the pair.

        Returns
        -------
        (..., n_labels)
            Number of pairs won, and less than 0.5 more.

        Source: scikit-learn's SVC with break_ties and decision_function_shape 'ovr'.
        """
        clearness = decisions @ self._swing  # type: ignore[attr-defined]
        wins: Array = self.won(decisions > 0) + clearness / (3.0 * (np.abs(clearness) + 1.0))
        return wins

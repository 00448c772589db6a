"""What a judge of halves is: a learner's decisions on every window, for many halves of the same examples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.search.halves import Mask

# Which examples are learnt from, (n,) → a score of each label for every example, (n, n_labels); equal highest: a tie.
ScoresOfHalf = Callable[[Mask], Array]


class Judge(Protocol):
    """Prepares what all halves share, and then judges each."""

    def __call__(self, learner: Any, values: Array, codes: Codes, groups: Codes) -> ScoresOfHalf:
        """Return what judges a half.

        Parameters
        ----------
        learner
            Parameters of the learner that is stood for.
        values : (n, n_features)
        codes, groups : (n,)
            Number of each example's label and slide.
        """

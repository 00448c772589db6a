"""Protocol of surrogates: the predictions of a learner for many half splits of the same examples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.search.halves import Mask

# Which examples are used for training, (n,) → a score of each label for every example, (n, n_labels); equal highest: a
# tie.
ScoresOfHalf = Callable[[Mask], Array]


class Surrogate(Protocol):
    """Prepare what all half splits share, and then score each."""

    def __call__(self, learner: Any, X: Array, y: Codes, groups: Codes) -> ScoresOfHalf:
        """Return a scorer of one half split.

        Parameters
        ----------
        learner
            Parameters of the learner that is stood for.
        X : (n, n_features)
        y, groups : (n,)
            Number of each example's label and slide.

        Returns
        -------
        callable
            Takes which examples are used for training, (n,).
        """

"""Protocol of regressor surrogates: the grades of a regressor for many half splits of the same examples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.search.halves import Mask

# Which examples are used for training, (n,) → the grade of every example, (n,); NaN: none.
GradesOfHalf = Callable[[Mask], Array]


class RegressorSurrogate(Protocol):
    """Prepare what all half splits share, and then score each."""

    def __call__(self, regressor: Any, X: Array, y: Array, groups: Codes) -> GradesOfHalf:
        """Return a scorer of one half split.

        Parameters
        ----------
        regressor
            Parameters of the regressor that is stood for.
        X : (n, n_features)
        y, groups : (n,)
            Grade that people gave, and number of the texture.

        Returns
        -------
        callable
            Takes which examples are used for training, (n,).
        """

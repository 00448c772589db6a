"""What a judge of grades is: a head's grades of every window, for many halves of the same examples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from texture_core.arrays import Array
from texture_estimation.learners.learner import Codes
from texture_estimation.search.halves import Mask

# Which examples are learnt from, (n,) → the grade of every example, (n,); NaN: none.
GradesOfHalf = Callable[[Mask], Array]


class GradeJudge(Protocol):
    """Prepares what all halves share, and then judges each."""

    def __call__(self, head: Any, values: Array, grades: Array, textures: Codes) -> GradesOfHalf:
        """Return what judges a half.

        Parameters
        ----------
        head
            Parameters of the head that is stood for.
        values : (n, n_features)
        grades, textures : (n,)
            Grade that people gave, and number of the texture.
        """

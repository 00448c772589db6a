"""Training examples that a model keeps for incremental training."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import AnyArray, Array
from texture_estimation.learners.learner import Codes

# Windows of a texture that are kept; more cost time and memory, and hardly help.
MAX_EXAMPLES = 400


@dataclass(frozen=True, eq=False)
class TrainingExamples:
    """Some of the windows that a model was trained on.

    Parameters
    ----------
    values : (n, n_features) float32
    codes, slides : (n,)
        Number of the label, 0…, and of the slide of each.

    Examples
    --------
    >>> examples = TrainingExamples.of(np.arange(4.0)[:, None], np.array([0, 0, 1, 1]), np.arange(4))
    >>> examples.of_label(1).tolist()
    [[2.0], [3.0]]
    """

    values: NDArray[np.float32]
    codes: Codes
    slides: Codes

    @classmethod
    def of(cls, values: Array, codes: Codes, slides: Codes) -> TrainingExamples:
        """Return what contributes keeping: of each label at most so many that more would hardly help.

        Parameters
        ----------
        values : (n, n_features)
            Features of windows.
        codes, slides : (n,)
            Number of the label and of the slide of each.

        Returns
        -------
        TrainingExamples
            At most MAX_EXAMPLES of each label.
        """
        own = [np.flatnonzero(codes == code) for code in range(int(codes.max()) + 1)]
        kept = np.concatenate([rows[spread(len(rows))] for rows in own])
        return cls(values[kept].astype(np.float32), codes[kept], slides[kept])

    def check(self, n_features: int, n_labels: int) -> None:
        """Raise ValueError unless they are examples of so many features and labels.

        Raises
        ------
        ValueError
            If shapes or labels do not fit, or a value is not finite.
        """
        n = len(self.codes)
        if self.values.shape != (n, n_features) or self.slides.shape != (n,) or self.codes.shape != (n,):
            raise ValueError(f'examples of shape {self.values.shape} have {n} labels and {len(self.slides)} slides')
        if not n or self.codes.min() < 0 or self.codes.max() >= n_labels or not np.isfinite(self.values).all():
            raise ValueError('examples have labels that the model has not, or values that are not finite')

    def of_label(self, code: int) -> Array:
        """Return those of a label, (n, n_features); none of one that came later.

        Returns
        -------
        (n, n_features)
            float64.
        """
        rows: Array = self.values[self.codes == code].astype(np.float64)
        return rows

    def as_arrays(self) -> dict[str, AnyArray]:
        """Return the arrays for the model file.

        Returns
        -------
        dict
            'values' (n, n_features) float32, 'codes' and 'slides' (n,) int32.
        """
        return {
            'values': self.values,
            'codes': self.codes.astype(np.int32),
            'slides': self.slides.astype(np.int32),
        }

    @classmethod
    def from_arrays(cls, parameters: Mapping[str, Any]) -> TrainingExamples:
        """Return what `as_arrays` gave."""
        codes, slides = (np.asarray(parameters[name], dtype=np.intp) for name in ('codes', 'slides'))
        return cls(np.asarray(parameters['values'], dtype=np.float32), codes, slides)


def spread(count: int, most: int = MAX_EXAMPLES) -> Codes:
    """Return at most so many of the numbers 0 to count - 1, evenly spread."""
    return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).round().astype(np.intp))

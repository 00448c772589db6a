"""Linear filters that go on from block to block, for one signal or many at once."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import signal

from texture_core.arrays import Array


@lru_cache(maxsize=64)
def _steady(sections: bytes) -> Array:
    """Return the state of sections, (n_sections, 2), that 1 has passed for ever."""
    return np.asarray(signal.sosfilt_zi(np.frombuffer(sections).reshape(-1, 6)))


class Filter:
    """Second-order sections along the last axis.

    Parameters
    ----------
    sections : (n_sections, 6)
        As scipy.signal designs them.
    settled
        Whether it has forgotten a beginning: it starts as if the first value had come for ever, else at rest.
    """

    def __init__(self, sections: Array, *, settled: bool = False) -> None:
        self._sections = sections
        self._settled = settled
        self._state: Array | None = None

    def __call__(self, values: Array) -> Array:
        """Return the next values, (..., n), filtered."""
        if not values.shape[-1]:
            return values
        if self._state is None:
            self._state = self._beginning(values)
        filtered, self._state = signal.sosfilt(self._sections, values, axis=-1, zi=self._state)
        return np.asarray(filtered, dtype=np.float64)

    def _beginning(self, values: Array) -> Array:
        if not self._settled:
            return np.zeros((len(self._sections), *values.shape[:-1], 2))
        steady = _steady(self._sections.tobytes())
        shape = (len(self._sections), *[1] * (values.ndim - 1), 2)
        beginning: Array = steady.reshape(shape) * values[..., :1]
        return beginning

"""How often each order of neighbouring samples comes: the signal as a series of symbols."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, permutations
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.parameters import param
from texture_features.feature import WindowBatch

_PATTERNS = {length: tuple(permutations(range(length))) for length in range(2, 6)}


@dataclass(frozen=True)
class OrdinalPatterns:
    """Share of each order of `length` samples, `delay` apart, such as rising, falling or peaked.

    Neither an offset nor a gain of the sensor changes it. Of equal samples the earlier counts as the lower; a window
    too short for one pattern has 0 everywhere.

    Source: Bandt & Pompe 2002.

    Examples
    --------
    >>> patterns = OrdinalPatterns(length=2, delay=1)
    >>> window = WindowBatch(np.array([[0.0], [1.0], [2.0], [0.5]]), rate_hz=100.0)  # rises twice, falls once
    >>> patterns.names, patterns(window)[0].round(2).tolist()
    (('01', '10'), [0.67, 0.33])
    """

    per_channel: ClassVar[bool] = True

    length: int = param(4, 'Number of samples in a pattern; there are factorial(length) patterns.', low=2, high=5)
    delay: int = param(
        2,
        'Sets the distance between the samples of a pattern, in samples; a larger one describes lower frequencies.',
        low=1,
        high=10_000,
    )

    @property
    def names(self) -> tuple[str, ...]:
        """Rank of each sample of the pattern from the lowest, 0: '012' rises."""
        return tuple(''.join(map(str, ranks)) for ranks in permutations(range(self.length)))

    def __call__(self, windows: WindowBatch) -> Array:
        """Return the shares."""
        rows = windows.rows
        count = len(_PATTERNS[self.length])
        symbols = _symbols(rows, self.length, self.delay)
        if not symbols.shape[-1]:
            return np.zeros((*rows.shape[:-1], count))
        of_row = np.arange(symbols.size // symbols.shape[-1]).reshape(*symbols.shape[:-1], 1)
        found = np.bincount((symbols + count * of_row).ravel(), minlength=count * of_row.size)
        return found.reshape(*rows.shape[:-1], count) / symbols.shape[-1]


def _symbols(rows: Array, length: int, delay: int) -> NDArray[np.intp]:
    """Return the number of the pattern that begins at each sample, (..., n_samples - (length - 1) · delay)."""
    count = max(0, rows.shape[-1] - (length - 1) * delay)
    samples = [rows[..., item * delay : item * delay + count] for item in range(length)]
    code = np.zeros((*rows.shape[:-1], count), dtype=np.intp)
    for bit, (earlier, later) in enumerate(combinations(range(length), 2)):
        code |= (samples[earlier] > samples[later]).astype(np.intp) << bit
    return _pattern_of_code(length)[code]


@lru_cache
def _pattern_of_code(length: int) -> NDArray[np.intp]:
    """Return the number of the pattern whose falling pairs are the bits of each code; codes of no pattern give 0."""
    table = np.zeros(1 << (length * (length - 1) // 2), dtype=np.intp)
    for number, ranks in enumerate(_PATTERNS[length]):
        pairs = enumerate(combinations(ranks, 2))
        table[sum((earlier > later) << bit for bit, (earlier, later) in pairs)] = number
    return table

"""What a model says of windows of known grade, and how near it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from texture_core.arrays import Array
from texture_estimation.roughness.model import NORMAL_90


@dataclass(frozen=True, eq=False)
class Answers:
    """What a model says of windows, (n,) each; NaN where it gives no grade."""

    grades: Array
    stds: Array
    true: Array
    textures: Sequence[str]

    @classmethod
    def joined(cls, parts: Sequence[Answers]) -> Answers:
        """Return all answers as one."""
        return cls(
            np.concatenate([part.grades for part in parts]),
            np.concatenate([part.stds for part in parts]),
            np.concatenate([part.true for part in parts]),
            [name for part in parts for name in part.textures],
        )

    def figures(self) -> dict[str, Any]:
        """Return error, spread within a texture, share without a grade, and how often the 90 % interval holds."""
        given = np.isfinite(self.grades)
        errors = np.abs(self.grades - self.true)
        within = errors <= NORMAL_90 * self.stds
        return {
            'error': float(errors[given].mean()) if given.any() else None,
            'error_of_the_mean': self._error_of_the_mean(),
            'std': self._spread(),
            'without_grade': float(1.0 - given.mean()),
            # the paper writes 0 for no grade, and does not say whether it counts
            'error_none_as_0': float(np.where(given, errors, self.true).mean()),
            'coverage_90': float(within[given].mean()) if given.any() else None,
        }

    def by_texture(self) -> dict[str, dict[str, float]]:
        """Return human grade, mean and standard deviation of each texture."""
        names, table = np.asarray(self.textures), {}
        for name in dict.fromkeys(self.textures):
            rows = names == name
            given = self.grades[rows & np.isfinite(self.grades)]
            table[name] = {
                'human': float(self.true[rows][0]),
                'mean': float(given.mean()) if len(given) else float('nan'),
                'std': float(given.std()) if len(given) else float('nan'),
                'interval_std': float(self.stds[rows].mean()),
            }
        return table

    def _error_of_the_mean(self) -> float | None:
        """Return the standard error of the mean error, a texture being one opinion however many windows it has."""
        means = list(self.error_by_texture().values())
        return float(np.std(means, ddof=1) / np.sqrt(len(means))) if len(means) > 1 else None

    def _spread(self) -> float | None:
        """Return the standard deviation of the grades within a texture, the mean over the textures with a grade."""
        given, names = np.isfinite(self.grades), np.asarray(self.textures)
        rows = [given & (names == name) for name in dict.fromkeys(self.textures)]
        spreads = [float(self.grades[own].std()) for own in rows if own.any()]
        return float(np.mean(spreads)) if spreads else None

    def error_by_texture(self) -> dict[str, float]:
        """Return the mean absolute error of each texture that got a grade."""
        names, errors = np.asarray(self.textures), np.abs(self.grades - self.true)
        known = {name: errors[(names == name) & np.isfinite(errors)] for name in dict.fromkeys(self.textures)}
        return {name: float(values.mean()) for name, values in known.items() if len(values)}

"""Whether a window can be graded at all, and if not, why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_core.features import FeatureVector
from texture_core.parameters import param

# Features that tell whether a window can be used; a regressor does not see them.
STICK_SLIP, LEVEL = 'peak_to_median_power', 'log_variance'


@dataclass(frozen=True)
class CheckParams:
    """What makes a window unusable; both margins are beyond what was met in the training.

    Examples
    --------
    >>> checks = Checks(CheckParams(min_force_n=0.1), ('mean',), {})
    >>> 'force' in checks.refusal(FeatureVector(0, 'a', 0.5, 0.1, ('mean',), np.zeros(1), force_n=0.01))
    True
    """

    min_force_n: float = param(0.05, 'Smallest force that counts as contact.', unit='N', low=0.0, high=100.0)
    stick_slip_margin: float = param(
        1.0,
        f'Sets the rise of `{STICK_SLIP}` over the training set that counts as stick-slip, as ln of power.',
        low=0.0,
        high=100.0,
    )
    quiet_margin: float = param(
        0.7,
        f'Sets the fall of `{LEVEL}` below the training set that counts as too quiet, as ln of power.',
        low=0.0,
        high=100.0,
    )


def checked_columns(names: Sequence[str], feature: str) -> NDArray[np.intp]:
    """Return the columns that a feature fills, of values named 'input/feature/value/channel'.

    Parameters
    ----------
    names
        Name of each value.
    feature
        Name of the feature in the recipe.

    Returns
    -------
    (n_columns,)
        Indices, ascending.
    """
    return np.flatnonzero([name.split('/')[1:2] == [feature] for name in names])


def graded_columns(names: Sequence[str]) -> NDArray[np.intp]:
    """Return the columns that a regressor sees.

    Returns
    -------
    (n_columns,)
        Indices, ascending.
    """
    return np.flatnonzero([name.split('/')[1:2] not in ([STICK_SLIP], [LEVEL]) for name in names])


def limits_of(params: CheckParams, names: Sequence[str], values: Array) -> dict[str, float]:
    """Return the largest `bursts` and the least `log_variance` to accept, from training windows (n, n_features).

    Parameters
    ----------
    params
        Which share of the training windows is accepted.
    names
        Name of each value.
    values : (n, n_features)
        Features of the training windows.

    Returns
    -------
    dict
        Limits by their names.
    """
    limits = {}
    if (columns := checked_columns(names, STICK_SLIP)).size:
        limits[STICK_SLIP] = float(values[:, columns].max()) + params.stick_slip_margin
    if (columns := checked_columns(names, LEVEL)).size:
        limits[LEVEL] = float(values[:, columns].max(axis=1).min()) - params.quiet_margin
    return limits


@dataclass(frozen=True, eq=False)
class Checks:
    """The checks of a model, on windows one by one.

    Parameters
    ----------
    params
        Of the recipe.
    names
        Of the features.
    limits
        As `limits_of` returns them.
    """

    params: CheckParams
    names: tuple[str, ...]
    limits: Mapping[str, float]
    _columns: dict[str, NDArray[np.intp]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        self._columns.update({feature: checked_columns(self.names, feature) for feature in (STICK_SLIP, LEVEL)})

    def refusal(self, vector: FeatureVector) -> str:
        """Return why a window cannot be graded; '' if it can."""
        if vector.force_n < self.params.min_force_n:  # an unknown force is NaN and says nothing
            return f'no contact: the force is {vector.force_n:.2f} N'
        finite = np.isfinite(vector.values)
        if not finite.all():
            bad = vector.names[int(finite.argmin())]
            return f"its feature '{bad}' is not finite; is the speed known?"
        if LEVEL in self.limits and self._highest(vector, LEVEL) < self.limits[LEVEL]:
            return 'no contact: the signal is weaker than on the smoothest training surface'
        if STICK_SLIP in self.limits and self._highest(vector, STICK_SLIP) > self.limits[STICK_SLIP]:
            return 'the finger skids: stick-slip dominates the signal'
        return ''

    def _highest(self, vector: FeatureVector, name: str) -> float:
        return float(vector.values[self._columns[name]].max())

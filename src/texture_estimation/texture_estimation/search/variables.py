"""What a search varies: whole numbers, choices, and numbers whose logarithm counts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from texture_core.arrays import Array
from texture_core.errors import InvalidParameter

Value = int | float | str
Individual = tuple[Value, ...]  # one value for each variable, in the order of the space


class Variable(Protocol):
    """Finitely many values in an order; the search sees them as points between 0 and 1."""

    @property
    def count(self) -> int:
        """How many values there are."""

    def value(self, index: int) -> Value:
        """Return the value of that number, from 0."""

    def index(self, value: Value) -> int:
        """Return the number of a value, or of the nearest one; ValueError if there is none near."""


@dataclass(frozen=True)
class Integer:
    """Whole numbers from `low` to `high`, both included.

    Examples
    --------
    >>> Integer(1, 3).count, Integer(1, 3).value(2)
    (3, 3)
    """

    low: int
    high: int

    def __post_init__(self) -> None:
        _check_range(self.low, self.high)

    @property
    def count(self) -> int:
        """How many values there are."""
        return self.high - self.low + 1

    def value(self, index: int) -> int:
        """Return the value of that number."""
        return self.low + index

    def index(self, value: Value) -> int:
        """Return the number of the nearest value."""
        return round(min(max(_number(value), self.low), self.high)) - self.low


@dataclass(frozen=True)
class LogReal:
    """Numbers from `low` to `high` in equal steps of their logarithm.

    Steps, because nobody tells 1.00 from 1.01 of a box constraint by its accuracy, and what repeats is remembered.

    Examples
    --------
    >>> rate = LogReal(0.1, 10.0, per_decade=1)
    >>> [round(rate.value(index), 3) for index in range(rate.count)]
    [0.1, 1.0, 10.0]
    """

    low: float
    high: float
    per_decade: int = 20

    def __post_init__(self) -> None:
        _check_range(self.low, self.high)
        if not (self.low > 0 and self.high / self.low < math.inf):
            raise InvalidParameter(f'a logarithmic range is {self.low} to {self.high}; it must start above 0 and end')

    @property
    def count(self) -> int:
        """How many values there are."""
        return round(math.log10(self.high / self.low) * self.per_decade) + 1

    def value(self, index: int) -> float:
        """Return the value of that number, in four digits."""
        share = index / max(1, self.count - 1)
        return float(f'{self.low * (self.high / self.low) ** share:.4g}')

    def index(self, value: Value) -> int:
        """Return the number of the nearest value."""
        number = min(max(_number(value), self.low), self.high)
        return round(math.log(number / self.low) / math.log(self.high / self.low) * (self.count - 1))


@dataclass(frozen=True)
class Categorical:
    """One of some names.

    Examples
    --------
    >>> Categorical(('svm', 'mlp')).value(1)
    'mlp'
    """

    options: tuple[str, ...]

    def __post_init__(self) -> None:
        if not self.options or len(set(self.options)) != len(self.options):
            raise InvalidParameter(
                f'the options of a choice are {list(self.options)}; name each once, and one at least'
            )

    @property
    def count(self) -> int:
        """How many values there are."""
        return len(self.options)

    def value(self, index: int) -> str:
        """Return the option of that number."""
        return self.options[index]

    def index(self, value: Value) -> int:
        """Return the number of an option."""
        return self.options.index(str(value))


@dataclass(frozen=True)
class SearchSpace:
    """The variables of a search by name, and the way between individuals and points of the unit cube.

    Examples
    --------
    >>> space = SearchSpace({'bands': Integer(1, 4), 'learner': Categorical(('svm', 'mlp'))})
    >>> space.decode(np.array([0.9, 0.1])), space.encode((4, 'svm')).tolist()
    ((4, 'svm'), [0.875, 0.25])
    """

    variables: Mapping[str, Variable]
    _counts: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not self.variables:
            raise InvalidParameter('the search space has no variables; name one at least')
        counts = np.array([variable.count for variable in self.variables.values()], dtype=np.float64)
        object.__setattr__(self, '_counts', counts)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables, in order."""
        return tuple(self.variables)

    def decode(self, point: Array) -> Individual:
        """Return the individual in whose cell a point of the unit cube lies, (n_variables,).

        Parameters
        ----------
        point : (n_variables,)
            0 to 1 each.
        """
        cells = self._cells(point).astype(int).tolist()
        return tuple(variable.value(cell) for variable, cell in zip(self.variables.values(), cells, strict=True))

    def encode(self, individual: Sequence[Value]) -> Array:
        """Return the middle of an individual's cell, (n_variables,).

        Returns
        -------
        (n_variables,)
            0 to 1 each.

        Raises
        ------
        InvalidParameter
            If a value is none of its variable's.
        """
        try:
            cells = [variable.index(value) for variable, value in zip(self.variables.values(), individual, strict=True)]
        except ValueError as error:
            raise InvalidParameter(
                f'individual {tuple(individual)} is not of the space {self.names}: {error}'
            ) from error
        middle: Array = (np.array(cells) + 0.5) / self._counts
        return middle

    def snap(self, points: Array) -> Array:
        """Return the middles of the cells in which points lie, (..., n_variables): what is alike becomes equal.

        Parameters
        ----------
        points : (..., n_variables)
            0 to 1 each.

        Returns
        -------
        (..., n_variables)
            0 to 1 each.
        """
        middle: Array = (self._cells(points) + 0.5) / self._counts
        return middle

    def named(self, individual: Individual) -> dict[str, Value]:
        """Return the values by the names of the variables."""
        return dict(zip(self.names, individual, strict=True))

    def _cells(self, points: Array) -> Array:
        cells: Array = np.minimum(np.floor(points * self._counts), self._counts - 1)
        return cells


def _number(value: Value) -> float:
    if isinstance(value, str):
        raise ValueError(f'{value!r} is no number')
    return float(value)


def _check_range(low: float, high: float) -> None:
    if not low < high:
        raise InvalidParameter(f'a range goes from {low} to {high}; the first must be the smaller')

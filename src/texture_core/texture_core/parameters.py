"""A parameter exists once: as a field of a frozen dataclass with default, unit, range and description.

ROS declaration (`texture_core.ros.parameters`), reading from YAML, validation and the README tables all come from it.
"""

from __future__ import annotations

import dataclasses
import math
import sys
import typing
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidParameter, UnknownName
from texture_core.plain_data import safe_repr

T = TypeVar('T')
NOUNS = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a text'}


def param(
    default: Any,
    description: str,
    *,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    choices: Sequence[str] = (),
) -> Any:
    """Return a dataclass field that knows its unit, range, choices and description.

    Parameters
    ----------
    default
        Default value; a list is copied for each instance.
    description
        Whole sentence: what it sets and what changes when it grows.
    unit
        Unit such as 'm/s'; '' if it has none.
    low
        Lowest allowed value; None for no limit.
    high
        Highest allowed value; None for no limit.
    choices
        Allowed texts; () for any.

    Returns
    -------
    dataclasses.Field
        With these facts in its metadata.
    """
    metadata = {'description': description, 'unit': unit, 'low': low, 'high': high, 'choices': tuple(choices)}
    if isinstance(default, list):
        return dataclasses.field(default_factory=lambda: list(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One parameter of a dataclass, as `parameters_of` lists it."""

    name: str
    type: type
    default: Any
    description: str
    unit: str
    low: float | None
    high: float | None
    choices: tuple[str, ...]

    @property
    def range_text(self) -> str:
        """The allowed values in words, '' if all are."""
        if self.choices:
            return 'one of ' + ', '.join(self.choices)
        unit = f' {self.unit}' if self.unit else ''
        bounds = {
            (True, True): f'{self.low} to {self.high}{unit}',
            (True, False): f'at least {self.low}{unit}',
            (False, True): f'at most {self.high}{unit}',
            (False, False): '',
        }
        return bounds[self.low is not None, self.high is not None]

    def check(self, value: Any) -> Any:
        """Return the value in the parameter's type.

        Raises
        ------
        InvalidParameter
            If its type or range is wrong.
        """
        if typing.get_origin(self.type) is list:
            return self._check_list(value)
        if self.type is float and isinstance(value, int) and not isinstance(value, bool):
            value = float(value) if abs(value) <= sys.float_info.max else math.inf
        if not isinstance(value, self.type) or (self.type is not bool and isinstance(value, bool)):
            raise InvalidParameter(f"parameter '{self.name}' is {safe_repr(value)}; {NOUNS[self.type]} is needed")
        self._check_range(value)
        return value

    def _check_list(self, values: Any) -> list[Any]:
        [kind] = typing.get_args(self.type)
        if isinstance(values, (str, Mapping)) or not isinstance(values, Iterable):
            raise InvalidParameter(f"parameter '{self.name}' is {safe_repr(values)}; a list is needed")
        each = dataclasses.replace(self, type=kind)
        return [each.check(value) for value in values]

    def _check_range(self, value: Any) -> None:
        below = self.low is not None and not value >= self.low
        above = self.high is not None and not value <= self.high
        unlisted = bool(self.choices) and value not in self.choices
        if below or above or unlisted or (isinstance(value, float) and not math.isfinite(value)):
            allowed = self.range_text or 'a finite number'
            raise InvalidParameter(f"parameter '{self.name}' is {safe_repr(value)}; allowed is {allowed}")


def parameters_of(cls: type) -> list[Parameter]:
    """Return the parameters of a dataclass in their order."""
    types = typing.get_type_hints(cls)
    listed = []
    for item in dataclasses.fields(cls):
        default = item.default_factory() if item.default_factory is not dataclasses.MISSING else item.default
        meta = {'description': '', 'unit': '', 'low': None, 'high': None, 'choices': (), **item.metadata}
        listed.append(Parameter(item.name, types[item.name], default, **meta))
    return listed


def check_option(cls: type, name: str, value: Any) -> None:
    """Check the option `--NAME` of a command, which sets a parameter.

    Parameters
    ----------
    cls
        Parameter dataclass.
    name
        Name of the parameter and of the option.
    value
        What the user gave.

    Raises
    ------
    InvalidParameter
        If its type or range is wrong; the sentence names the option.
    """
    parameter = next(one for one in parameters_of(cls) if one.name == name)
    try:
        parameter.check(value)
    except InvalidParameter as error:
        raise InvalidParameter(str(error).replace(f"parameter '{name}'", f'--{name}', 1)) from None


def from_mapping(cls: type[T], values: Mapping[str, Any], where: str = '') -> T:
    """Build a parameter dataclass from a mapping (a YAML section); what is not named keeps its default.

    Parameters
    ----------
    cls
        Parameter dataclass.
    values
        Values by the names of the fields.
    where
        Where the values stand, for the sentence of an error.

    Returns
    -------
    instance of `cls`
        Checked.

    Raises
    ------
    InvalidParameter
        If a value has the wrong type or range, or a name is unknown (with the nearest known one).
    """
    if not (isinstance(cls, type) and dataclasses.is_dataclass(cls)):
        raise InvalidParameter(f'{where}: {cls!r} is no class with parameters; name a dataclass')
    known = {parameter.name: parameter for parameter in parameters_of(cls)}
    place = f'{where}: ' if where else ''
    if not isinstance(values, Mapping):
        raise InvalidParameter(f'{place}came {safe_repr(values)}; a mapping of parameter names to values is needed')
    return cls(**{name: _checked(known, name, value, place) for name, value in values.items()})


def _checked(known: Mapping[str, Parameter], name: str, value: Any, place: str) -> Any:
    """Return the value that a parameter takes; InvalidParameter, with the place, if there is no such parameter."""
    if name not in known:
        raise InvalidParameter(f'{place}{unknown_name(str(name), known, "parameter")}')
    try:
        return known[name].check(value)
    except (InvalidParameter, UnknownName) as error:
        raise InvalidParameter(f'{place}{error}') from error


def markdown_table(cls: type) -> str:
    """Return the parameters of a dataclass as a Markdown table for a README."""
    rows = ['| parameter | default | range | meaning |', '|---|---|---|---|']
    for item in parameters_of(cls):
        unit = f' {item.unit}' if item.unit else ''
        default = f'`{item.default!r}`{unit}'
        rows.append(f'| `{item.name}` | {default} | {item.range_text or "any"} | {item.description} |')
    return '\n'.join(rows) + '\n'

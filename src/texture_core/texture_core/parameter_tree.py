"""Read a tree of parameter dataclasses from a mapping (a YAML file): fields that are dataclasses are its sections."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidParameter
from texture_core.parameters import Parameter, parameters_of
from texture_core.plain_data import safe_repr

T = TypeVar('T')


def tree_from_mapping(cls: type[T], values: Any, where: str) -> T:
    """Build a dataclass whose fields are parameters, dataclasses of their own, or mappings of names to these.

    A number that stands where a text is needed is taken as text: YAML reads a column named 3 as a number.

    Parameters
    ----------
    cls
        Frozen dataclass; what is not named keeps its default.
    values
        Mapping of names to values; None is an empty one.
    where
        Place for the error sentence, such as "mapping 'my.yaml'".

    Returns
    -------
    cls
        With every value checked.

    Raises
    ------
    InvalidParameter
        If a name is unknown (with the nearest known one), or a value has the wrong type or range.
    """
    values = {} if values is None else values
    if not isinstance(values, Mapping):
        raise InvalidParameter(f'{where}: came {safe_repr(values)}; a mapping of parameter names to values is needed')
    known = {parameter.name: parameter for parameter in parameters_of(cls)}
    read = {}
    for name, value in values.items():
        if name not in known:
            raise InvalidParameter(f'{where}: {unknown_name(str(name), known, "parameter")}')
        read[name] = _value(known[name], value, where)
    try:
        return cls(**read)
    except InvalidParameter as error:
        raise InvalidParameter(f'{where}: {error}') from error


def _value(parameter: Parameter, value: Any, where: str) -> Any:
    kind: Any = parameter.type
    if dataclasses.is_dataclass(kind):
        return tree_from_mapping(kind, value, f'{where}, {parameter.name}')  # type: ignore[arg-type]
    if typing.get_origin(kind) in (Mapping, dict):
        return _values_by_name(parameter, value, where)
    try:
        return parameter.check(_as_text(kind, value))
    except InvalidParameter as error:
        raise InvalidParameter(f'{where}: {error}') from error


def _values_by_name(parameter: Parameter, value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InvalidParameter(f"{where}: '{parameter.name}' is {safe_repr(value)}; a mapping of names is needed")
    _, kind = typing.get_args(parameter.type)
    return {
        str(name): _value(dataclasses.replace(parameter, name=f'{parameter.name}, {name}', type=kind), part, where)
        for name, part in value.items()
    }


def _as_text(kind: Any, value: Any) -> Any:
    if kind is str and type(value) in (int, float):
        return str(value)
    if kind == list[str] and isinstance(value, list):
        return [_as_text(str, part) for part in value]
    return value

"""The type of a parameter given as text: YAML's rules, as in ROS 2 launch files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import yaml

from texture_core.catalogue import find
from texture_core.errors import InvalidLaunch
from texture_core.plain_data import PARSE_ERRORS, parse_yaml
from texture_launch import template

SCALARS = (bool, int, float, str)
# The `type` attribute of a param; (type, whether a list of it); None lets YAML decide.
TYPES: Mapping[str, tuple[type | None, bool]] = {
    'str': (str, False),
    'bool': (bool, False),
    'int': (int, False),
    'float': (float, False),
    'list_of_str': (str, True),
    'list_of_bool': (bool, True),
    'list_of_int': (int, True),
    'list_of_float': (float, True),
    'yaml': (None, False),
}
BOOLEANS = {'1': True, '0': False, 'true': True, 'false': False}


def parameter_value(text: str, type_name: str, expand: Callable[[str], str]) -> Any:
    """Return the value of a parameter: bool, int, float, str or a list of one of them.

    Upstream reads the text as YAML first and performs substitutions afterwards, in what is a string then; the result
    is read as YAML again. So quotes do not keep `'$(var x)'` a string: `type="str"` does.

    Parameters
    ----------
    text
        Value as it stands in the launch file.
    type_name
        Content of the attribute `type`; '' lets the text decide.
    expand
        Performs the substitutions in a text.

    Returns
    -------
    bool, int, float, str or a list of one of them

    Raises
    ------
    InvalidLaunch
        If the text is no value of the type.
    """
    kind, is_list = find(TYPES, type_name, 'parameter type')
    value = _list(text, kind) if is_list else _scalar(text, kind, has_calls(text))
    if isinstance(value, list):
        return _uniform([_performed(item, kind, expand) for item in value], text)
    return _performed(value, kind, expand)


def has_calls(text: str) -> bool:
    """Return whether a text holds a substitution."""
    return any(isinstance(part, template.Call) for part in template.parse(text))


def _performed(value: Any, kind: type | None, expand: Callable[[str], str]) -> Any:
    if not isinstance(value, str):
        return value
    return _scalar(expand(value), kind, pending=False) if has_calls(value) else expand(value)


def _scalar(text: str, kind: type | None, pending: bool) -> Any:
    """Return the value of a text; one with substitutions still to perform (`pending`) may stay a string."""
    if kind is str or not text:
        return text
    try:
        return CONVERT[kind](text)
    except PARSE_ERRORS as error:
        if pending or (kind is None and isinstance(error, yaml.YAMLError)):
            return text
        wanted = kind.__name__ if kind else 'bool, int, float, str or a list of one of them'
        raise InvalidLaunch(f"parameter value '{text}' is no {wanted}; change it, or the param's type") from error


def _boolean(text: str) -> bool:
    value = parse_yaml(text) if text not in BOOLEANS else BOOLEANS[text]
    if not isinstance(value, bool):
        raise ValueError(text)
    return value


def _by_yaml(text: str) -> Any:
    value = parse_yaml(text)
    if not isinstance(value, (*SCALARS, list)):
        raise ValueError(text)
    return value


CONVERT: Mapping[type | None, Callable[[str], Any]] = {int: int, float: float, bool: _boolean, None: _by_yaml}


def _list(text: str, kind: type | None) -> list[Any]:
    try:
        value = parse_yaml(text)
    except PARSE_ERRORS as error:
        raise InvalidLaunch(f"parameter value '{text}' is no list in YAML: {error}") from error
    if not isinstance(value, list) or not all(isinstance(item, (str, kind or str)) for item in value):
        raise InvalidLaunch(f"parameter value '{text}' is no list of {kind.__name__ if kind else 'values'}")
    return value


def _uniform(items: list[Any], text: str) -> list[Any]:
    if len({type(item) for item in items}) > 1 or not all(isinstance(item, SCALARS) for item in items):
        raise InvalidLaunch(
            f"parameter value '{text}' is a list of several types; give one bool, int, float or str throughout"
        )
    return items

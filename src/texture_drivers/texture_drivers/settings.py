"""Settings of one kind of sensor, beside those of every sensor: from a YAML file, or written in place."""

from __future__ import annotations

from typing import Any, TypeVar

from texture_core.errors import InvalidParameter
from texture_core.parameters import from_mapping
from texture_core.plain_data import PARSE_ERRORS, load_yaml, parse_yaml, safe_repr
from texture_core.resources import find_file

T = TypeVar('T')


def load_settings(cls: type[T], config: str) -> T:
    """Return the settings that `config` means; what they do not name keeps its default.

    Parameters
    ----------
    cls
        A dataclass of parameters.
    config
        Path of a YAML file, name of one in `config/sensors`, or a mapping in YAML such as '{loop: true}'; '' is none.

    Raises
    ------
    UnknownName, InvalidParameter
        If there is no such file, or it holds something unknown or impossible.
    """
    return from_mapping(cls, read_settings(config), f'settings {config}')


def read_settings(config: str) -> dict[str, Any]:
    """Return the mapping that `config` means; see `load_settings`.

    Raises
    ------
    InvalidParameter
        If it is no mapping in YAML.
    """
    if not config:
        return {}
    if config.lstrip().startswith('{'):
        content = _in_place(config)
    else:
        content = load_yaml(find_file(config, 'texture_drivers', 'config/sensors', 'settings'), 'settings')
    if not isinstance(content, dict):
        raise InvalidParameter(f'settings {config} hold {safe_repr(content)}; a mapping of names to values is needed')
    return content


def _in_place(text: str) -> Any:
    try:
        return parse_yaml(text)
    except PARSE_ERRORS as error:
        raise InvalidParameter(f'settings {text} are no YAML: {error}') from error

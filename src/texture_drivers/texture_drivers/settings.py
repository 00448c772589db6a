"""Settings of one kind of sensor, beyond what every sensor is told: from a YAML file, or written in place."""

from __future__ import annotations

from typing import Any, TypeVar

import yaml

from texture_core.errors import InvalidParameter
from texture_core.parameters import from_mapping
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
    """Return the mapping that `config` means; see `load_settings`."""
    if not config:
        return {}
    in_place = config.lstrip().startswith('{')
    try:
        text = config if in_place else find_file(config, 'texture_drivers', 'config/sensors', 'settings').read_text()
        content = yaml.safe_load(text)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InvalidParameter(f'settings {config} are no YAML: {error}') from error
    if not isinstance(content, dict):
        raise InvalidParameter(f'settings {config} hold {content!r}; a mapping of names to values is needed')
    return content

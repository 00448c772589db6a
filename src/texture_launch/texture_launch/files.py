"""Find the launch file that a user means."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from texture_core import resources
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidLaunch

SUFFIX = '.launch.xml'


def find_launch_file(name_or_path: str) -> Path:
    """Return a launch file: a path, or the name of one of this package, such as 'emulator' or 'emulator.launch.xml'.

    Raises
    ------
    UnknownName
        If there is neither, with the nearest name.
    """
    path = Path(name_or_path).expanduser()
    if path.is_file():
        return path
    shipped = {
        item.name.removesuffix(SUFFIX): item
        for item in resources.folder('texture_bringup', 'launch').glob(f'*{SUFFIX}')
    }
    name = name_or_path.removesuffix(SUFFIX)
    if name not in shipped:
        raise unknown_name(name, shipped, 'launch file')
    return shipped[name]


def given_arguments(texts: Iterable[str]) -> dict[str, str]:
    """Return the launch arguments in texts of the form NAME:=VALUE; the last one of a name counts.

    Raises
    ------
    InvalidLaunch
        If a text has no ':='.
    """
    given = {}
    for text in texts:
        name, mark, value = text.partition(':=')
        if not (name and mark):
            raise InvalidLaunch(f"argument '{text}' has no value; write NAME:=VALUE")
        given[name] = value
    return given

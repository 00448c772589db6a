"""Find ROS packages and their executables over AMENT_PREFIX_PATH."""

from __future__ import annotations

import os
from pathlib import Path

from texture_core.catalogue import unknown_name

INDEX = Path('share') / 'ament_index' / 'resource_index' / 'packages'


def prefix(package: str) -> Path:
    """Return the first prefix that holds a package.

    Raises
    ------
    UnknownName
        If none does, with the nearest package.
    """
    for candidate in _prefixes():
        if (candidate / INDEX / package).exists():
            return candidate
    installed = {item.name for place in _prefixes() for item in (place / INDEX).glob('*')}
    raise unknown_name(package, installed, 'package')


def share(package: str) -> Path:
    """Return the share folder of a package."""
    return prefix(package) / 'share' / package


def executable(package: str, name: str) -> Path:
    """Return the path of an executable of a package.

    Raises
    ------
    UnknownName
        If there is none, with the nearest of the package.
    """
    folder = prefix(package) / 'lib' / package
    path = folder / name
    if not (path.is_file() and os.access(path, os.X_OK)):
        raise unknown_name(name, {item.name for item in folder.glob('*')}, f"executable of package '{package}'")
    return path


def _prefixes() -> list[Path]:
    return [Path(item) for item in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if item]

"""Find a file that a package of the suite ships, in the source tree or in an installation, without ROS."""

from __future__ import annotations

import os
from pathlib import Path

from texture_core.catalogue import unknown_name
from texture_core.errors import UnknownName

SOURCE_TREE = Path(__file__).resolve().parents[2]


def folder(package: str, name: str) -> Path:
    """Return the folder `name` ('config/recipes') of a package; the first of the places that has it."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    places = [SOURCE_TREE / package, *(Path(prefix) / 'share' / package for prefix in prefixes if prefix)]
    for place in places:
        if (place / name).is_dir():
            return place / name
    return places[0] / name


def shipped(package: str, subfolder: str, suffix: str = '.yaml') -> dict[str, Path]:
    """Return what all packages of this machine ship in a folder of this name, by stem.

    Any installed package may add recipes, scenes or presets by having such a folder in its share; where two have a file
    of the same name, that of `package` counts.
    """
    prefixes = [
        Path(prefix) / 'share' for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if prefix
    ]
    others = [manifest.parent.name for place in (SOURCE_TREE, *prefixes) for manifest in place.glob('*/package.xml')]
    names = dict.fromkeys([*sorted(others, reverse=True), package])  # the last one counts
    names[package] = names.pop(package)
    return {
        item.stem: item
        for name in names
        for item in sorted(folder(name, subfolder).glob(f'*{suffix}'))
        if item.is_file()
    }


def find_file(name_or_path: str, package: str, subfolder: str, kind: str, suffix: str = '.yaml') -> Path:
    """Return the file a user means: a path, or the name of a file that a package ships in `subfolder`.

    Parameters
    ----------
    name_or_path
        Path of a file, or name of a shipped one without its suffix.
    package
        Package whose files come first; any other that is installed may ship more (see `shipped`).
    subfolder
        Folder in the package, such as 'config/recipes'.
    kind
        Noun for the error sentence, such as 'feature'.
    suffix
        Ending of the shipped files.

    Returns
    -------
    Path
        Of an existing file.

    Raises
    ------
    UnknownName
        If there is neither, with the nearest name; `kind` is the noun for the sentence, such as 'recipe'.
    """
    path = Path(name_or_path).expanduser()
    if path.is_file():
        return path
    known = shipped(package, subfolder, suffix)
    if name_or_path not in known and (path.suffix == suffix or len(path.parts) > 1):
        raise UnknownName(f"there is no file '{name_or_path}' in '{Path.cwd()}'; give the path of a {kind} that exists")
    if name_or_path not in known:
        raise unknown_name(name_or_path, known, kind)
    return known[name_or_path]

"""Read the one file that holds all slides of a data set."""

from __future__ import annotations

from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from texture_core.arrays import AnyArray
from texture_core.errors import InvalidData


def read_arrays(folder: str | Path, name: str) -> dict[str, AnyArray]:
    """Return the arrays in an .npz file by their keys.

    Raises
    ------
    InvalidData
        If the file is missing or broken.
    """
    file = Path(folder) / name
    if not file.is_file():
        raise InvalidData(f"no file {name} in '{folder}'; give the folder that holds it")
    try:
        with np.load(file, allow_pickle=False) as content:
            return {key: content[key] for key in content.files}
    except (OSError, ValueError, KeyError, BadZipFile, EOFError) as error:
        raise InvalidData(f"'{file}' is no file of this data set: {error}; fetch it anew") from error

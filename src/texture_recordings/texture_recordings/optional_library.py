"""Libraries that only some kinds of files need."""

from __future__ import annotations

import importlib
from typing import Any

from texture_core.errors import InvalidData


def library(name: str, files: str, extra: str) -> Any:
    """Return a library that is not installed with the suite.

    Parameters
    ----------
    name
        Its name, such as 'h5py'.
    files
        What it reads, for the sentence.
    extra
        Name of the extra of texture_recordings that brings it.

    Returns
    -------
    module
        The library.

    Raises
    ------
    InvalidData
        If it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise InvalidData(
            f"{files} need the library '{name}', which is not installed; run 'pip install "
            f"{name.partition('.')[0]}', which the extra '{extra}' of texture_recordings names"
        ) from error

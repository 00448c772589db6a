"""Check where a command is to write, before anything is computed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from texture_core.errors import InvalidParameter


def refuse_inputs(outputs: Sequence[str | Path | None], inputs: Sequence[str | Path]) -> None:
    """Refuse to write over a file that is read.

    Parameters
    ----------
    outputs
        Files to be written; None for one that is not wanted.
    inputs
        Files and folders that are read, such as recipes, bags and both files of a model.

    Raises
    ------
    InvalidParameter
        With the file that would be lost.
    """
    read = {_real(given) for given in inputs}
    for output in outputs:
        if output and _real(output) in read:
            raise InvalidParameter(f"'{output}' would overwrite a file that is read; name another file")


def _real(path: str | Path) -> Path:
    return Path(path).expanduser().resolve()

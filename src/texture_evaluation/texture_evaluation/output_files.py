"""Check where figures and charts are to be written, before anything is computed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from texture_core.errors import InvalidParameter
from texture_estimation.model_files import stem

CHART_FORMATS = ('.png', '.svg', '.pdf')
MODEL_FILES = ('.skops', '.json')


def refuse_inputs(outputs: Sequence[str | Path | None], inputs: Sequence[str | Path]) -> None:
    """Refuse to write figures over a file that is read.

    Parameters
    ----------
    outputs
        Files to be written; None for one that is not wanted.
    inputs
        Recipes, bags and the files of a model (`model_files`) that are read.

    Raises
    ------
    InvalidParameter
        With the file that would be lost.
    """
    read = {_real(given) for given in inputs}
    for output in outputs:
        if output and _real(output) in read:
            raise InvalidParameter(f"'{output}' would overwrite a file that is read; name another file")


def refuse_chart_format(path: str | Path) -> None:
    """Refuse a chart whose file has an ending other than those of `CHART_FORMATS`.

    Raises
    ------
    InvalidParameter
        With what is allowed.
    """
    if Path(path).suffix.lower() not in CHART_FORMATS:
        raise InvalidParameter(f"the chart is '{path}'; a file that ends in .png, .svg or .pdf is needed")


def model_files(model: str | Path) -> list[Path]:
    """Return both files of a model that is named by either, or by both without the ending."""
    target = stem(model)
    return [target.with_name(target.name + ending) for ending in MODEL_FILES]


def _real(path: str | Path) -> Path:
    return Path(path).expanduser().resolve()

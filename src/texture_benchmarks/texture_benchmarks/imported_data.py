"""Recorded data sets as bags: made for one benchmark, or once for all that run together."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from texture_benchmarks.result import BenchmarkOptions
from texture_core.errors import InvalidData
from texture_recordings.importers.catalogue import IMPORTS


@contextmanager
def imported(
    options: BenchmarkOptions, name: str, slides: str = '', materials: Sequence[str] = ()
) -> Iterator[list[Path]]:
    """Give the bags of a data set, or of a part of it, to a `with` block.

    Parameters
    ----------
    options
        Where the data sets lie.
    name
        Name of the data set.
    slides
        Slides of each surface, such as '1-30'; '' for all.
    materials
        Surfaces; none for all.

    Yields
    ------
    list of Path
        Bags that are removed afterwards.

    Raises
    ------
    InvalidData
        If the data set is missing.
    """
    kept = options.bags / name if options.bags else None
    if kept and kept.is_dir() and not (slides or materials):
        yield sorted(kept.iterdir())
        return
    [source] = options.recordings(name)
    with tempfile.TemporaryDirectory() as folder:
        yield IMPORTS[name](source, Path(folder), slides, materials)


@contextmanager
def importing_once(options: BenchmarkOptions, names: Sequence[str]) -> Iterator[BenchmarkOptions]:
    """Import what is there of some data sets, and give a bench that has their bags to a `with` block.

    One that cannot be imported is left to the benchmarks that need it: they say why, and the others go on.
    """
    with tempfile.TemporaryDirectory() as folder:
        for name in () if options.quick else names:  # a quick run reads parts
            half_done = Path(folder) / f'{name}.part'
            if options.data and (options.data / name).is_dir():
                with suppress(InvalidData, OSError):
                    IMPORTS[name](options.data / name, half_done)
                    half_done.rename(Path(folder) / name)
        yield replace(options, bags=Path(folder))

"""A data set whose slides lie in one .npz file, to one bag for each surface."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from texture_core.arrays import AnyArray
from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidData
from texture_core.files import Arrays, open_regular
from texture_recordings.importers.steady_slides import ImportedStream, SteadySlide, write_steady_slides
from texture_recordings.slides import parse_selection


@dataclass(frozen=True)
class SlideFile:
    """What the file is called, and how its keys and arrays are read; slides are numbered in order of conditions.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from texture_recordings.slides import find_slides
    >>> stream = ImportedStream('signal', 'finger', ('pac',), 'count', 100.0)
    >>> def place(key: str) -> tuple[str, int]:
    ...     return key.split('-')[0], int(key.split('-')[1])
    >>> def slide(key: str, surface: str, condition: int, samples: AnyArray) -> SteadySlide:
    ...     return SteadySlide(key, surface, samples, 0.05, 1.0, 0.0)
    >>> with TemporaryDirectory() as folder:
    ...     np.savez(f'{folder}/slides.npz', **{'cork-1': np.zeros((200, 1)), 'cork-2': np.zeros((200, 1))})
    ...     bags = SlideFile('slides.npz', stream, place, slide).write_bags(folder, f'{folder}/bags', '', ())
    ...     print([item.name for item in find_slides(bags)])
    ['cork/1', 'cork/2']
    """

    name: str
    stream: ImportedStream
    place: Callable[[str], tuple[str, Any] | None]  # surface and condition of a key, None if it is no such key
    slide: Callable[[str, str, Any, AnyArray], SteadySlide]  # of key, surface, condition and array

    def write_bags(self, source: str | Path, out: str | Path, slides: str, surfaces: Sequence[str]) -> list[Path]:
        """Write the slides of each surface that `slides` names ('' for all), of all surfaces if none is named.

        Parameters
        ----------
        source
            Folder of the file.
        out
            Folder for the bags; made if missing.
        slides
            Numbers of the slides of each surface, such as '1-30'; '' for all.
        surfaces
            Labels of the surfaces; none for all.

        Returns
        -------
        list of Path
            Of the bags.

        Raises
        ------
        InvalidData, UnknownName
            If the folder `source` lacks the file, slides or a surface, or a bag exists already.
        """
        content, wanted = self._read(Path(source)), parse_selection(slides)
        found: defaultdict[str, list[tuple[Any, str]]] = defaultdict(list)
        for key in content:
            place = self.place(key)
            if place is None:
                raise InvalidData(f"'{self.name}' holds '{key}', which is no slide of this data set; fetch it again")
            found[place[0]].append((place[1], key))
        for name in surfaces:
            if name not in found:
                raise unknown_name(name, found, 'surface')
        return [
            write_steady_slides(
                Path(out) / name,
                self.stream,
                (
                    self._slide(key, name, condition, content[key])
                    for condition, key in _chosen(name, found[name], wanted)
                ),
            )
            for name in (surfaces or sorted(found))
        ]

    def _slide(self, key: str, surface: str, condition: Any, values: AnyArray) -> SteadySlide:
        try:
            return self.slide(key, surface, condition, values)
        except (ValueError, LookupError, ArithmeticError) as error:
            raise InvalidData(
                f"'{key}' of '{self.name}' is no slide of this data set: {error}; fetch it again"
            ) from error

    def _read(self, folder: Path) -> dict[str, AnyArray]:
        file = folder / self.name
        if not file.is_file():
            raise InvalidData(f"no file {self.name} in '{folder}'; give the folder that holds it")
        try:
            with open_regular(file) as opened:
                content = Arrays(opened)
                return {key: _slide(key, content[key]) for key in content.names}
        except (OSError, ValueError, KeyError) as error:
            raise InvalidData(f"'{file}' is no file of this data set: {error}; fetch it again") from error


def _slide(key: str, values: AnyArray) -> AnyArray:
    if values.ndim != 2 or values.dtype.kind not in 'iuf' or len(values) < 2 or not np.isfinite(values).all():
        raise ValueError(
            f"'{key}' has shape {values.shape}, type {values.dtype}; finite (n_samples, n_channels) are needed"
        )
    return values


def _chosen(surface: str, slides: list[tuple[Any, str]], wanted: frozenset[int] | None) -> list[tuple[Any, str]]:
    chosen = [slide for number, slide in enumerate(sorted(slides), 1) if wanted is None or number in wanted]
    if not chosen:
        raise InvalidData(f"'{surface}' has none of the slides asked for; it has 1 to {len(slides)}")
    return chosen

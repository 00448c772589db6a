"""Data sets that `texture import` knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from texture_recordings.importers.biotac20 import import_biotac20
from texture_recordings.importers.fabricslide import import_fabricslide
from texture_recordings.importers.ntp21 import import_ntp21


class Importer(Protocol):
    """Turns a public data set into labelled bags, one for each material."""

    def __call__(
        self,
        source: str | Path,
        out: str | Path,
        slides: str = '',
        materials: Sequence[str] = (),
        channels: str = 'all',
    ) -> list[Path]:
        """Write the bags, and return their paths.

        Parameters
        ----------
        source
            Folder that holds the files of the data set.
        out
            Folder for the bags; made if missing.
        slides
            Which slides of each material, such as '1-30'; '' for all.
        materials
            Names of materials; none for all.
        channels
            'fast' for the vibration alone, 'all' for the slow channels too.

        Returns
        -------
        list of Path
            Of the bags.

        Raises
        ------
        InvalidData
            If the source lacks files or slides, the channels are not there, or a bag exists already.
        """


IMPORTS: Mapping[str, Importer] = {
    'biotac20': import_biotac20,  # 20 materials × 40 slides, BioTac on a robot arm
    'ntp21': import_ntp21,  # 21 textures × speeds × forces, 9-taxel MEMS array
    'fabricslide': import_fabricslide,  # 7 fabrics × forces × speeds × 2 directions and gratings, 16 capacitive taxels
}

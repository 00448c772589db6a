"""Data sets that `texture import` knows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from texture_recordings.importers.biotac20 import import_biotac20
from texture_recordings.importers.fabricslide import import_fabricslide
from texture_recordings.importers.ntp21 import import_ntp21

IMPORTS: Mapping[str, Callable[..., list[Path]]] = {
    'biotac20': import_biotac20,  # 20 materials × 40 slides, BioTac on a robot arm
    'ntp21': import_ntp21,  # 21 textures × speeds × forces, 9-taxel MEMS array
    'fabricslide': import_fabricslide,  # 7 fabrics × forces × speeds × 2 directions and gratings, 16 capacitive taxels
}

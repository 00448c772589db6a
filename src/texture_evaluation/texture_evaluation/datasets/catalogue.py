"""Data sets that `texture import` knows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from texture_evaluation.datasets.biotac20 import import_biotac20

IMPORTS: Mapping[str, Callable[..., list[Path]]] = {
    'biotac20': import_biotac20,  # 20 materials × 40 slides, BioTac on a robot arm
}

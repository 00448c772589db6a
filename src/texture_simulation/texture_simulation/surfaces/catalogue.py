"""Kinds of relief by name."""

from __future__ import annotations

from collections.abc import Mapping

from texture_simulation.surfaces.circles import Circles
from texture_simulation.surfaces.grating import Grating
from texture_simulation.surfaces.grid import Grid
from texture_simulation.surfaces.sandpaper import Sandpaper
from texture_simulation.surfaces.self_affine import SelfAffine
from texture_simulation.surfaces.weave import Weave

KINDS: Mapping[str, type] = {
    'grating': Grating,  # parallel ridges
    'grid': Grid,  # posts in rows and columns, or a net
    'circles': Circles,  # concentric rings
    'weave': Weave,  # cloth
    'self_affine': SelfAffine,  # random roughness on many scales
    'sandpaper': Sandpaper,  # grains of one size
}

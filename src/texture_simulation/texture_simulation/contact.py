"""What a soft round finger makes of a texture at 1 N; how that depends on the force is an effect."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class Contact:
    """A finger pressed on a plane with 1 N."""

    blur_m: float = param(1.2e-4, 'Length over which the skin averages.', unit='m', low=1e-5, high=1e-3)
    stiffness_n_m: float = param(2000.0, 'Force per height felt.', unit='N/m', low=1.0, high=1e6)

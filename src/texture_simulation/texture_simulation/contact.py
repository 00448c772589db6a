"""Contact of a soft round finger with a texture at 1 N; how it depends on the force is an effect."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class Contact:
    """A finger pressed on a plane with 1 N."""

    blur_m: float = param(
        1.2e-4,
        'Sets the standard deviation of the spatial low-pass of the skin; a larger value removes coarser texture.',
        unit='m',
        low=1e-5,
        high=1e-3,
    )
    stiffness_n_m: float = param(
        2000.0,
        'Sets the force per height of the texture; a larger value gives stronger signals.',
        unit='N/m',
        low=1.0,
        high=1e6,
    )

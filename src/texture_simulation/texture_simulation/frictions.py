"""The kinds of friction by name, each off unless a surface asks for it, and what follows a finger with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from texture_core.arrays import Array
from texture_simulation.stick_slip.friction import StickSlip
from texture_simulation.stick_slip.stribeck import steady_force_n
from texture_simulation.stick_slip.tip_drag import TipDrag
from texture_simulation.surfaces.sliding_friction import SlidingDrag, SlidingFriction
from texture_simulation.trajectory import Trajectory

FRICTIONS: Mapping[str, type] = {
    'sliding_friction': SlidingFriction,  # a Stribeck curve, without memory
    'stick_slip': StickSlip,  # bristles (LuGre): the skin hangs and lets go
}


class Drag(Protocol):
    """What a finger senses of the friction along its path, block by block."""

    def advance(self, path: Trajectory) -> Array:
        """Return the force that the sensor senses beside the shape of the surface, (..., n) N.

        Parameters
        ----------
        path
            The next points of the trajectory.

        Returns
        -------
        (..., n)
            N.
        """


def _stick_slip_drag(
    friction: StickSlip, rate_hz: float, rng: np.random.Generator, batch_shape: tuple[int, ...]
) -> Drag:
    # Slides that are cut out of longer ones begin with the skin at any point of its cycle, not all at the same.
    return TipDrag(friction, rate_hz, stretched=rng.uniform(0.0, 1.0, batch_shape))


def _sliding_drag(
    friction: SlidingFriction, rate_hz: float, rng: np.random.Generator, batch_shape: tuple[int, ...]
) -> Drag:
    return SlidingDrag(friction, rate_hz)


DRAGS: Mapping[type, Callable[[Any, float, np.random.Generator, tuple[int, ...]], Drag]] = {
    StickSlip: _stick_slip_drag,
    SlidingFriction: _sliding_drag,
}


def make_drag(friction: Any, rate_hz: float, rng: np.random.Generator, batch_shape: tuple[int, ...]) -> Drag:
    """Return what follows a finger over a surface.

    Parameters
    ----------
    friction
        One of `FRICTIONS`.
    rate_hz
        Points of the path a second.
    rng
        Decides how far the skin is stretched where a slide begins under load.
    batch_shape
        () for one slide, (count,) for many at once.

    Returns
    -------
    Drag
        Follows the path from its first point on.
    """
    return DRAGS[type(friction)](friction, rate_hz, rng, batch_shape)


def sliding_coefficient(friction: StickSlip | SlidingFriction, speed_m_s: Array) -> Array:
    """Return tangential over normal force of a finger that slides steadily.

    Parameters
    ----------
    friction
        One of `FRICTIONS`.
    speed_m_s : (...)
        Speed along the surface.

    Returns
    -------
    (...)
        The Stribeck curve at the speed, without dimension.

    Examples
    --------
    >>> sliding_coefficient(SlidingFriction(static=0.6, kinetic=0.5), np.array([10.0])).round(3).tolist()  # fast
    [0.5]
    """
    curve = friction.curve() if isinstance(friction, SlidingFriction) else friction
    return steady_force_n(curve, speed_m_s, 1.0)

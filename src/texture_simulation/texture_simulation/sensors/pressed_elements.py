"""Forces on the elements of a finger with a slow array: normal and tangential, along a path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array
from texture_simulation.sensors.model import individual_rng
from texture_simulation.skin_contact import SkinContact
from texture_simulation.trajectory import Trajectory, before_first

FRICTION = 0.5  # share of the normal force that drags the skin while it slides
CREEP_M_S = 1e-3  # speed at which half of that is reached
CROSSTALK = 0.1  # standard deviation of what an axis of an element senses of another one
REACH_M = 5e-3  # distance from the middle at which an element bears e^-0.5 of the middle's share


class PressedElements:
    """Return what each element senses of the force on the skin.

    The force spreads over the elements like a bell; each senses its share, blurred as it lies, and its axes are not
    quite at right angles. All these numbers are ours.

    Parameters
    ----------
    x_m, y_m : (n_elements,)
        Where the elements lie.
    blur_m
        Length over which each averages.
    rate_hz
        Points of the path a second.
    finger
        Which individual of the sensor.
    """

    def __init__(self, x_m: Array, y_m: Array, blur_m: float, rate_hz: float, finger: int) -> None:
        made = individual_rng(finger)
        self._offset_m = x_m[:, None], y_m[:, None]
        self._blur_m = np.full((len(x_m), 1), blur_m)
        self._rate_hz = rate_hz
        share = np.exp(-0.5 * (x_m**2 + y_m**2) / REACH_M**2)
        self._share = (share / share.sum())[:, None]
        self._coupling: Array = np.eye(3) + CROSSTALK * made.standard_normal((len(x_m), 3, 3))
        self._before: tuple[Array, Array] | None = None

    def forces_n(self, touch: SkinContact, path: Trajectory) -> Array:
        """Return the force that each element senses along the next points of a path.

        Returns
        -------
        (..., n_elements, 3, n) N
            Along x, y, and into the finger.
        """
        placed = touch.placed(path)
        pressed_n = placed.force_n[..., None, :] + touch.variation_n(placed, self._blur_m, self._offset_m)
        normal_n = self._share * pressed_n
        x, y = self._drag_directions(placed)
        forces_n = np.stack([x[..., None, :] * normal_n, y[..., None, :] * normal_n, normal_n], axis=-2)
        return np.asarray(self._coupling @ forces_n)

    def _drag_directions(self, placed: Trajectory) -> tuple[Array, Array]:
        """Return the share of the normal force that drags along x and y, (..., n) each."""
        x_m, y_m = self._before or before_first(placed)
        self._before = placed.x_m[..., -1:], placed.y_m[..., -1:]
        x_m_s = self._rate_hz * np.diff(placed.x_m, prepend=x_m)
        y_m_s = self._rate_hz * np.diff(placed.y_m, prepend=y_m)
        scale = FRICTION / (np.hypot(x_m_s, y_m_s) + CREEP_M_S)
        return scale * x_m_s, scale * y_m_s


def grid_m(places: tuple[tuple[float, float], ...]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return x and y of places, (n,) each.

    Returns
    -------
    (n,)
        x, m.
    (n,)
        y, m.
    """
    x_m, y_m = np.array(places).T
    return x_m, y_m

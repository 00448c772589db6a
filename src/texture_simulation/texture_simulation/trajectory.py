"""Where a finger goes over a surface, finely sampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from texture_core.arrays import Array


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Places and forces at consecutive times of a constant rate; of one slide, or of many at once.

    Parameters
    ----------
    x_m, y_m : (..., n)
        In the frame of the surface.
    force_n : (..., n)
        Normal force, 0 in the air.
    """

    x_m: Array
    y_m: Array
    force_n: Array

    def __len__(self) -> int:
        return int(self.x_m.shape[-1])

    def moved(self, x_m: float | Array, y_m: float | Array) -> Trajectory:
        """Return the same path starting elsewhere; (..., 1) for many.

        Parameters
        ----------
        x_m, y_m : a number, or (..., 1)
            Added to each place.
        """
        return Trajectory(self.x_m + x_m, self.y_m + y_m, self.force_n)

    def at(self, indices: NDArray[np.intp] | slice) -> Trajectory:
        """Return some of its points.

        Parameters
        ----------
        indices : (m,)
            Numbers of the points, or a slice.

        Returns
        -------
        Trajectory
            Arrays (..., m) for m indices.
        """
        return Trajectory(self.x_m[..., indices], self.y_m[..., indices], self.force_n[..., indices])


def straight(start: tuple[float, float, float], end: tuple[float, float, float], n_points: int) -> Trajectory:
    """Return `n_points` on the way from (x, y, force) to another, the start left out and the end included.

    Parameters
    ----------
    start
        x, y and force before the first point; m and N.
    end
        x, y and force at the last point; m and N.
    n_points
        Number of points.

    Returns
    -------
    Trajectory
        (n_points,) each.
    """
    shares = np.arange(1, n_points + 1) / n_points
    return Trajectory(*(first + (last - first) * shares for first, last in zip(start, end, strict=True)))


def before_first(path: Trajectory) -> tuple[Array, Array]:
    """Return x and y before the first of at least one point, (..., 1) each: as far from it as the second is.

    Parameters
    ----------
    path
        At least one point.

    Returns
    -------
    (..., 1)
        x, m.
    (..., 1)
        y, m.
    """
    x_m, y_m = (2 * place[..., :1] - place[..., :2][..., -1:] for place in (path.x_m, path.y_m))
    return x_m, y_m

"""Steady sliding: how fast, how hard, which way; and the way it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from texture_core.arrays import Array
from texture_simulation.trajectory import Trajectory

Number = float | Array


@dataclass(frozen=True, eq=False)
class SimulatedSlide:
    """What is wanted of a slide, or of each of many slides.

    Parameters
    ----------
    speed_m_s, force_n : number or (count,)
    duration_s
        Of the steady part.
    direction_rad : number or (count,)
        Direction of travel, from +x towards +y; at the start, for a circle.
    radius_m
        Of a circle, travelled anticlockwise; 0 for a straight line.
    """

    speed_m_s: Number
    force_n: Number
    duration_s: float
    direction_rad: Number = 0.0
    radius_m: float = 0.0

    def steady_path(self, speed_m_s: Array, force_n: Array, n_points: int, rate_hz: float) -> Trajectory:
        """Return the way at a constant speed, (..., n_points) points; speed and force are (..., 1).

        Parameters
        ----------
        speed_m_s : (..., 1)
            Constant speed.
        force_n : (..., 1)
            Constant normal force.
        n_points
            Number of points.
        rate_hz
            Points a second.

        Returns
        -------
        Trajectory
            Places in m, force in N.
        """
        time_s = np.arange(1, n_points + 1) / rate_hz
        return trajectory_along(speed_m_s * time_s, np.broadcast_to(force_n, (*force_n.shape[:-1], n_points)), self)


def trajectory_along(travelled_m: Array, force_n: Array, sliding: SimulatedSlide) -> Trajectory:
    """Return the path with given ways along a line or a circle, (..., n).

    Parameters
    ----------
    travelled_m : (..., n)
        Distance travelled at each point.
    force_n : (..., n)
        Normal force at each point.
    sliding
        Direction, and the radius of a circle.

    Returns
    -------
    Trajectory
        Places in m, force in N.
    """
    direction = np.asarray(sliding.direction_rad, dtype=np.float64)[..., None]
    radius_m = sliding.radius_m
    if not radius_m:
        return Trajectory(travelled_m * np.cos(direction), travelled_m * np.sin(direction), force_n)
    heading = direction + travelled_m / radius_m
    x_m = radius_m * (np.sin(heading) - np.sin(direction))
    y_m = radius_m * (np.cos(direction) - np.cos(heading))
    return Trajectory(x_m, y_m, force_n)

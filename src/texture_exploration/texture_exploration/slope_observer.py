"""How fast the surface rises under a finger that presses on it and moves along."""

from __future__ import annotations

from collections import deque

import numpy as np

MIN_POINTS = 3
OBSERVED = 8  # heights that tell the slope: fewer follow a bump better, but shake with a finger that sticks and slips
SHORTEST_M = 1e-6  # way over which a slope is told
LIKELY_SLOPE = 0.2
LIKELY_BEND_1_M = 0.5  # half of the second derivative; higher bends are followed the better k is known


class SlopeObserver:
    """How fast the surface will rise under the finger, freed from what the controller does itself.

    A parabola through the last heights over the way tells the slope where the finger will be when the answer comes
    into effect; times the speed that is commanded now, it is the rise then.

    Parameters
    ----------
    ahead_s
        From a height to the middle of the time in which the answer to it is in effect.
    """

    def __init__(self, ahead_s: float) -> None:
        self._ahead_s = ahead_s
        self._points: deque[tuple[float, float]] = deque(maxlen=OBSERVED)

    @property
    def running(self) -> bool:
        """Whether it has seen a height."""
        return bool(self._points)

    def restart(self) -> None:
        """The finger left the surface."""
        self._points.clear()

    def update(
        self, travelled_m: float, surface_m: float, speed_m_s: float, noise_m: float, doubt: float = 0.0
    ) -> float:
        """Return how fast the surface will rise, m/s.

        Parameters
        ----------
        travelled_m
            That the finger has gone along the surface.
        surface_m
            Height of the untouched surface, z + F/k.
        speed_m_s
            Along the surface, as commanded.
        noise_m
            Of the height.
        doubt
            Noise as a share of the error that may come of it until the answer is in effect: beyond, less is answered.

        Returns
        -------
        float
            Positive if the surface rises ahead, m/s.
        """
        self._points.append((travelled_m, surface_m))
        if len(self._points) < MIN_POINTS:
            return 0.0
        travelled, height = np.array(self._points).T
        unit = max(float(travelled[-1] - travelled[0]), SHORTEST_M)
        travelled = (travelled - travelled_m) / unit
        shapes = np.stack([travelled, travelled**2], axis=1)
        shapes = shapes - shapes.mean(axis=0)
        # Likely slopes and bends, as if they had been seen once beside the heights.
        likely = np.diag([noise_m / (LIKELY_SLOPE * unit), noise_m / (LIKELY_BEND_1_M * unit**2)]) ** 2
        slope, curvature = np.linalg.solve(shapes.T @ shapes + likely, shapes.T @ (height - height.mean()))
        ahead = min(1.0, speed_m_s * self._ahead_s / unit)
        # As it sets off, a late arm has gone much less than it goes until the answer: the noise counts so many times.
        sure = 1.0 / (1.0 + (doubt * max(1.0, speed_m_s * self._ahead_s / unit)) ** 2)
        return float(sure * (slope + 2 * curvature * ahead) / unit * speed_m_s)

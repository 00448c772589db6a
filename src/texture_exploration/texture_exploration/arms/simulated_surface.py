"""What lies under the simulated finger: an elastic surface with a tilt, a bump, a step, an edge or a soft layer."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.parameters import param

STICK_M = 0.002  # way from slip to slip


@dataclass(frozen=True)
class SimulatedSurfaceParams:
    """Parameters of the surface under a simulated finger: shape, layers, stickiness."""

    tilt_rad: float = param(
        0.0,
        'Sets the angle by which the surface rises along x; a larger angle is steeper.',
        unit='rad',
        low=-0.5,
        high=0.5,
    )
    bump_m: float = param(
        0.0, 'Sets the height of a round bump on the path along x; 0 removes the bump.', unit='m', low=-0.01, high=0.01
    )
    bump_from_m: float = param(0.02, 'Sets the x coordinate at which the bump begins.', unit='m', low=-2.0, high=2.0)
    bump_length_m: float = param(
        0.04, 'Sets the length of the bump along x; a longer bump is flatter.', unit='m', low=0.005, high=1.0
    )
    step_m: float = param(
        0.0, 'Sets the height of a step of the surface along x; 0 removes the step.', unit='m', low=-0.1, high=0.01
    )
    step_from_m: float = param(0.03, 'Sets the x coordinate of the step.', unit='m', low=-2.0, high=2.0)
    edge_m: float = param(2.0, 'Sets the x coordinate at which the surface ends.', unit='m', low=-2.0, high=2.0)
    ridge_m: float = param(
        0.0, 'Sets the height of regular ridges along x; 0 removes the ridges.', unit='m', low=0.0, high=0.005
    )
    ridge_length_m: float = param(
        0.002,
        'Sets the distance between the ridges; a larger distance lowers their frequency.',
        unit='m',
        low=0.0002,
        high=0.1,
    )
    layer_m: float = param(
        0.0, 'Sets the thickness of a soft layer on the surface; 0 removes the layer.', unit='m', low=0.0, high=0.02
    )
    base_stiffness_n_m: float = param(
        20000.0,
        'Sets the stiffness below the soft layer; a larger value gives harder impacts there.',
        unit='N/m',
        low=10.0,
        high=200000.0,
    )
    wall_m: float = param(
        2.0,
        'Sets the x coordinate of a wall of `base_stiffness_n_m` across the way of the finger.',
        unit='m',
        low=-2.0,
        high=2.0,
    )
    adhesion_n: float = param(
        0.0,
        'Sets the largest pulling force with which the surface adheres to the finger; 0 removes adhesion.',
        unit='N',
        low=0.0,
        high=10.0,
    )
    stick_slip_n: float = param(
        0.0,
        'Sets the amplitude of the force while the finger sticks and slips every 2 mm; 0 removes stick-slip.',
        unit='N',
        low=0.0,
        high=5.0,
    )


class SimulatedSurface:
    """Height and force; remembers whether the finger sticks."""

    def __init__(self, params: SimulatedSurfaceParams, stiffness_n_m: float) -> None:
        self._params = params
        self._stiffness_n_m = stiffness_n_m
        self._sticking = False

    def height_m(self, x_m: float) -> float:
        """Return the height of the untouched surface at x."""
        params = self._params
        share = (x_m - params.bump_from_m) / params.bump_length_m
        bump = 0.5 - 0.5 * math.cos(2 * math.pi * share) if 0 < share < 1 else 0.0
        step = params.step_m if x_m >= params.step_from_m else 0.0
        ridge = params.ridge_m * (0.5 + 0.5 * math.cos(2 * math.pi * x_m / params.ridge_length_m))
        return x_m * math.tan(params.tilt_rad) + params.bump_m * bump + step + ridge

    def force_n(self, x_m: float, z_m: float) -> float:
        """Return the force of a finger at (x, z), positive when pressing: a spring that may stick."""
        if x_m >= self._params.edge_m:
            self._sticking = False
            return 0.0
        depth = self.height_m(x_m) - z_m
        press = self._press_n(depth)
        # A sticky surface comes along with the finger until it tears off.
        self._sticking = depth > 0 or (self._sticking and press > -self._params.adhesion_n)
        if not self._sticking:
            return 0.0
        return press + self._params.stick_slip_n * (2 * ((x_m / STICK_M) % 1.0) - 1)

    def wall_n(self, x_m: float) -> float:
        """Return the force with which a wall pushes the finger back along x."""
        return -self._params.base_stiffness_n_m * max(0.0, x_m - self._params.wall_m)

    def _press_n(self, depth_m: float) -> float:
        """Return the force of the spring, or of the soft layer and what is below it."""
        layer_m = self._params.layer_m
        if not layer_m or depth_m <= layer_m:
            return self._stiffness_n_m * depth_m
        return self._stiffness_n_m * layer_m + self._params.base_stiffness_n_m * (depth_m - layer_m)

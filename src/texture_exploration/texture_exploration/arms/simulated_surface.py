"""What lies under the simulated finger: an elastic surface with a tilt, a bump, a step, an edge or a soft layer."""

from __future__ import annotations

import math
from dataclasses import dataclass

from texture_core.parameters import param

STICK_M = 0.002  # way from slip to slip


@dataclass(frozen=True)
class SimulatedSurfaceParams:
    """Shape, layers and stickiness of the surface under a simulated finger."""

    tilt_rad: float = param(0.0, 'The surface rises along x by this angle.', unit='rad', low=-0.5, high=0.5)
    bump_m: float = param(0.0, 'Height of a round bump on the way along x.', unit='m', low=-0.01, high=0.01)
    bump_from_m: float = param(0.02, 'x at which the bump begins.', unit='m', low=-2.0, high=2.0)
    bump_length_m: float = param(0.04, 'Length of the bump along x.', unit='m', low=0.005, high=1.0)
    step_m: float = param(0.0, 'The surface is higher by this from a step on.', unit='m', low=-0.1, high=0.01)
    step_from_m: float = param(0.03, 'x of the step.', unit='m', low=-2.0, high=2.0)
    edge_m: float = param(2.0, 'x at which the surface ends.', unit='m', low=-2.0, high=2.0)
    ridge_m: float = param(0.0, 'Height of regular ridges along x.', unit='m', low=0.0, high=0.005)
    ridge_length_m: float = param(0.002, 'Distance of the ridges.', unit='m', low=0.0002, high=0.1)
    layer_m: float = param(0.0, 'Thickness of a soft layer; 0: none.', unit='m', low=0.0, high=0.02)
    base_stiffness_n_m: float = param(
        20000.0, 'Stiffness once the soft layer is pressed through.', unit='N/m', low=10.0, high=200000.0
    )
    adhesion_n: float = param(0.0, 'The surface holds on to the finger with up to this.', unit='N', low=0.0, high=10.0)
    stick_slip_n: float = param(
        0.0, 'The force swings by this while the finger sticks and slips, once every 2 mm.', unit='N', low=0.0, high=5.0
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

    def _press_n(self, depth_m: float) -> float:
        """Return the force of the spring, or of the soft layer and what is below it."""
        layer_m = self._params.layer_m
        if not layer_m or depth_m <= layer_m:
            return self._stiffness_n_m * depth_m
        return self._stiffness_n_m * layer_m + self._params.base_stiffness_n_m * (depth_m - layer_m)

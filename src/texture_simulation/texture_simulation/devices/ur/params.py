"""What can be chosen about the emulated controller."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param
from texture_simulation.devices.ur.tables import VERSIONS


@dataclass(frozen=True)
class UrControllerParams:
    """The emulated controller, its robot and the surface under the finger."""

    ip: str = param('127.0.0.2', 'Loopback address to listen on; the ports of a UR controller are fixed.')
    version: str = param('5.12', 'Version of the control software.', choices=tuple(VERSIONS))
    finger_port: int = param(0, 'UDP port of the emulated bench on loopback; 0: none.', low=0, high=65535)
    start_height_m: float = param(0.01, 'Height of the finger above the surface at the start.', unit='m', low=0.0)
    surface_x_m: float = param(0.4, 'Place of the middle of the surface in the base frame, x.', unit='m')
    surface_y_m: float = param(0.0, 'The same, y.', unit='m')
    surface_z_m: float = param(0.1, 'The same, z.', unit='m')
    slope_x: float = param(0.0, 'Rise of the surface along x.', low=-1.0, high=1.0)
    slope_y: float = param(0.0, 'Rise of the surface along y.', low=-1.0, high=1.0)
    bump_height_m: float = param(0.0, 'Height of a bump in the middle of the surface.', unit='m', low=-0.05, high=0.05)
    bump_width_m: float = param(0.02, 'Standard deviation of its bell shape.', unit='m', low=0.001, high=1.0)
    stiffness_n_m: float = param(2000.0, 'Stiffness of finger and surface.', unit='N/m', low=0.0, high=20000.0)
    friction: float = param(0.5, 'Coefficient of friction.', low=0.0, high=3.0)
    force_offset_n: float = param(1.5, 'What the force sensor shows of nothing until it is zeroed.', unit='N')
    force_noise_n: float = param(0.02, 'Standard deviation of the noise of the force sensor.', unit='N', low=0.0)
    stop_force_n: float = param(100.0, 'A higher force is a protective stop.', unit='N', low=1.0)
    unlock_delay_s: float = param(5.0, 'A protective stop cannot be unlocked earlier.', unit='s', low=0.0, high=60.0)
    seed: int = param(1, 'Seed of the noise.', low=0)

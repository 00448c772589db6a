"""What can be chosen about the emulated controller."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param
from texture_simulation.devices.ur.tables import VERSIONS


@dataclass(frozen=True)
class UrControllerParams:
    """The emulated controller, its robot and the surface under the finger."""

    ip: str = param('127.0.0.2', 'Sets the loopback address to listen on; the ports of a UR controller are fixed.')
    version: str = param('5.12', 'Sets the version of the emulated control software.', choices=tuple(VERSIONS))
    finger_port: int = param(
        0,
        'Sets the UDP port on loopback at which the emulator receives the finger state; 0 sends none.',
        low=0,
        high=65535,
    )
    start_height_m: float = param(
        0.01, 'Sets the height of the finger above the surface at the start.', unit='m', low=0.0
    )
    surface_x_m: float = param(0.4, 'Sets the x coordinate of the centre of the surface in the base frame.', unit='m')
    surface_y_m: float = param(0.0, 'Sets the y coordinate of the centre of the surface in the base frame.', unit='m')
    surface_z_m: float = param(0.1, 'Sets the z coordinate of the centre of the surface in the base frame.', unit='m')
    slope_x: float = param(0.0, 'Sets the rise of the surface along x, in metres per metre.', low=-1.0, high=1.0)
    slope_y: float = param(0.0, 'Sets the rise of the surface along y, in metres per metre.', low=-1.0, high=1.0)
    bump_height_m: float = param(
        0.0,
        'Sets the height of a bump at the centre of the surface; 0 removes the bump.',
        unit='m',
        low=-0.05,
        high=0.05,
    )
    bump_width_m: float = param(
        0.02,
        'Sets the standard deviation of the Gaussian shape of the bump; a larger value is flatter.',
        unit='m',
        low=0.001,
        high=1.0,
    )
    stiffness_n_m: float = param(
        2000.0,
        'Sets the stiffness of finger and surface in contact; 0 removes the surface.',
        unit='N/m',
        low=0.0,
        high=20000.0,
    )
    friction: float = param(
        0.5, 'Sets the coefficient of Coulomb friction; a larger value drags the finger more.', low=0.0, high=3.0
    )
    wall_m: float = param(
        2.0,
        'Sets the x coordinate of a wall across the way of the finger, from the centre of the surface.',
        unit='m',
        low=-2.0,
        high=2.0,
    )
    wall_stiffness_n_m: float = param(
        20000.0, 'Sets the stiffness of finger and wall.', unit='N/m', low=0.0, high=200000.0
    )
    force_offset_n: float = param(1.5, 'Sets the offset of the force sensor until it is zeroed.', unit='N')
    force_noise_n: float = param(
        0.02, 'Sets the standard deviation of the noise of the force sensor.', unit='N', low=0.0
    )
    stop_force_n: float = param(
        100.0, 'Sets the force above which the controller goes into a protective stop.', unit='N', low=1.0
    )
    unlock_delay_s: float = param(
        5.0, 'Sets how long a protective stop cannot be unlocked after it occurred.', unit='s', low=0.0, high=60.0
    )
    seed: int = param(1, 'Sets the seed of the noise; equal seeds give equal noise.', low=0)

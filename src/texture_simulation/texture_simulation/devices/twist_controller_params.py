"""The parameters of an emulated arm with a Cartesian velocity controller."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param


@dataclass(frozen=True)
class TwistControllerParams:
    """The emulated controller, its arm, its force sensor and the surface under the finger."""

    lag_s: float = param(
        0.02,
        'Sets the time after which a commanded velocity comes into effect; a larger value makes the arm later.',
        unit='s',
        low=0.0,
        high=0.2,
    )
    jitter_s: float = param(
        0.002,
        'Sets the largest random delay that is added to the lag and to the period of the measurements.',
        unit='s',
        low=0.0,
        high=0.1,
    )
    max_speed_m_s: float = param(
        0.25, 'Sets the highest speed of the arm; faster commands are scaled down.', unit='m/s', low=0.001, high=3.0
    )
    max_acceleration_m_s2: float = param(
        10.0,
        'Sets the highest acceleration of the arm; a larger value follows commands faster.',
        unit='m/s²',
        low=0.1,
        high=150.0,
    )
    command_timeout_s: float = param(
        0.1,
        'Sets how long a command holds without a new one; 0 holds the last one for ever.',
        unit='s',
        low=0.0,
        high=5.0,
    )
    active: bool = param(True, 'Lets the controller follow commands; false makes it listen without moving the arm.')
    start_height_m: float = param(
        0.01, 'Sets the height of the finger above the surface at the start.', unit='m', low=0.0, high=0.2
    )
    surface_x_m: float = param(0.4, 'Sets the x coordinate of the centre of the surface in the base frame.', unit='m')
    surface_y_m: float = param(0.0, 'Sets the y coordinate of the centre of the surface in the base frame.', unit='m')
    surface_z_m: float = param(0.1, 'Sets the z coordinate of the centre of the surface in the base frame.', unit='m')
    surface_rx_rad: float = param(
        0.0, 'Sets the x component of the rotation vector of the surface in the base frame.', unit='rad'
    )
    surface_ry_rad: float = param(
        0.0, 'Sets the y component of the rotation vector of the surface in the base frame.', unit='rad'
    )
    stiffness_n_m: float = param(
        2000.0,
        'Sets the stiffness of finger and surface in contact; 0 removes the surface.',
        unit='N/m',
        low=0.0,
        high=200000.0,
    )
    friction: float = param(
        0.3, 'Sets the coefficient of Coulomb friction; a larger value drags the finger more.', low=0.0, high=3.0
    )
    tool_mass_kg: float = param(
        0.2, 'Sets the mass of the tool, whose weight the force sensor shows.', unit='kg', low=0.0, high=20.0
    )
    force_offset_n: float = param(1.5, 'Sets the offset of the force sensor on each axis.', unit='N')
    force_noise_n: float = param(
        0.002, 'Sets the standard deviation of the noise of the force sensor.', unit='N', low=0.0, high=5.0
    )
    wall_m: float = param(
        2.0,
        'Sets the x coordinate, in the surface frame, of a wall across the way of the finger.',
        unit='m',
        low=-2.0,
        high=2.0,
    )
    wall_stiffness_n_m: float = param(
        20000.0, 'Sets the stiffness of finger and wall.', unit='N/m', low=0.0, high=200000.0
    )
    invert_twist: bool = param(False, 'Moves against each commanded velocity, as behind a frame that is upside down.')
    invert_force: bool = param(
        False, 'Shows the force of the tool on its surroundings, as a sensor of the other convention.'
    )
    turn_force_rad: float = param(
        0.0,
        'Sets the angle about y by which the frame of the measured force is turned against its name.',
        unit='rad',
        low=-4.0,
        high=4.0,
    )
    compliance_m_s_n: float = param(
        0.002,
        'Sets the speed per force error with which the arm yields to a commanded force; a larger value settles faster.',
        unit='m/s/N',
        low=0.0,
        high=1.0,
    )
    seed: int = param(1, 'Sets the seed of noise and jitter; equal seeds give equal noise.', low=0)

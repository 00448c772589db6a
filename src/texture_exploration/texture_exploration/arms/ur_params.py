"""What can be chosen about an arm of Universal Robots."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param
from texture_exploration.arms.command_limits import CommandLimits


@dataclass(frozen=True)
class UrArmParams(CommandLimits):
    """Where the controller is, where the surface is, and how the arm is supervised."""

    ip: str = param('127.0.0.2', 'Address of the controller; the default is that of the emulated one.')
    surface_x_m: float = param(0.4, 'Origin of the surface in the base frame, x.', unit='m', low=-3.0, high=3.0)
    surface_y_m: float = param(0.0, 'The same, y.', unit='m', low=-3.0, high=3.0)
    surface_z_m: float = param(0.1, 'The same, z.', unit='m', low=-3.0, high=3.0)
    surface_rx_rad: float = param(
        0.0,
        'Rotation vector of the surface, x; turned by it, z points away from the surface.',
        unit='rad',
        low=-7.0,
        high=7.0,
    )
    surface_ry_rad: float = param(0.0, 'The same, y.', unit='rad', low=-7.0, high=7.0)
    surface_rz_rad: float = param(0.0, 'The same, z.', unit='rad', low=-7.0, high=7.0)
    rate_hz: float = param(250.0, 'Rate of commands and states.', unit='Hz', low=50.0, high=500.0)
    arm_acceleration_m_s2: float = param(2.0, 'Acceleration towards a new velocity.', unit='m/s²', low=0.1, high=10.0)
    force_speed_m_s: float = param(0.05, 'Highest normal speed under force control.', unit='m/s', low=0.001, high=0.25)
    command_timeout_s: float = param(0.2, 'A command holds so long.', unit='s', low=0.02, high=2.0)
    watchdog_hz: float = param(
        10.0, 'The controller stops the arm when it hears less often from here.', unit='Hz', low=1.0, high=50.0
    )
    silence_s: float = param(0.1, 'A controller that is silent for longer is a fault.', unit='s', low=0.02, high=2.0)
    acknowledge_s: float = param(
        1.0,
        'The controller may take so long to stop, to end its force control and to zero the force sensor; the watchdog '
        'waits as long.',
        unit='s',
        low=0.2,
        high=5.0,
    )
    zero_rise_m: float = param(
        0.003,
        'The force sensor is zeroed only after a rise by this in which the force did not change.',
        unit='m',
        low=0.001,
        high=0.05,
    )
    zero_steady_n: float = param(
        0.5,
        'The force changes when it changes by more than this, smoothed over 20 ms; above the noise of the sensor.',
        unit='N',
        low=0.05,
        high=5.0,
    )
    unlock_protective_stop: bool = param(
        False, 'Release a protective stop when connecting; if not, a person does it on the pendant.'
    )
    take_over: bool = param(
        False, 'Stop a program of somebody else that runs or pauses on the controller; if not, connecting is refused.'
    )
    probe_timeout_s: float = param(1.5, 'The controller must show that it is one within.', unit='s', low=0.1, high=10.0)
    connect_timeout_s: float = param(10.0, 'The arm must be ready to move within.', unit='s', low=0.5, high=60.0)

    @property
    def surface_pose(self) -> tuple[float, ...]:
        """Pose of the surface in the base frame as a UR controller writes it: m and rad, (6,)."""
        origin = (self.surface_x_m, self.surface_y_m, self.surface_z_m)
        return (*origin, self.surface_rx_rad, self.surface_ry_rad, self.surface_rz_rad)

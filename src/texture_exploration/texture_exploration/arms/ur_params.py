"""What can be chosen about an arm of Universal Robots."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.parameters import param
from texture_exploration.arms.command_limits import CommandLimits
from texture_exploration.arms.surface_frame import SurfacePoseParams


@dataclass(frozen=True)
class UrArmParams(SurfacePoseParams, CommandLimits):
    """Where the controller is, where the surface is, and how the arm is supervised."""

    ip: str = param('127.0.0.2', 'Sets the IP address of the controller; the default is that of the emulated one.')
    rate_hz: float = param(
        250.0,
        'Sets the rate of commands and states; a higher rate reacts faster and costs more computing time.',
        unit='Hz',
        low=50.0,
        high=500.0,
    )
    arm_acceleration_m_s2: float = param(
        2.0,
        'Sets the acceleration towards a new velocity; a larger value follows commands faster.',
        unit='m/s²',
        low=0.1,
        high=10.0,
    )
    force_speed_m_s: float = param(
        0.05,
        'Sets the highest normal speed under force control; a higher speed corrects force errors faster.',
        unit='m/s',
        low=0.001,
        high=0.25,
    )
    command_timeout_s: float = param(
        0.2,
        'Sets how long a command holds without a new one; afterwards the arm stands still.',
        unit='s',
        low=0.02,
        high=2.0,
    )
    watchdog_hz: float = param(
        10.0,
        'Sets the lowest rate of commands at which the controller keeps the arm moving; a higher rate stops it sooner.',
        unit='Hz',
        low=1.0,
        high=50.0,
    )
    silence_s: float = param(
        0.1,
        'Sets how long the controller may send no state before that is a fault; a longer time notices faults later.',
        unit='s',
        low=0.02,
        high=2.0,
    )
    acknowledge_s: float = param(
        1.0,
        'Sets how long the controller may take to stop, to end its force control and to zero the force '
        'sensor; the watchdog waits as long.',
        unit='s',
        low=0.2,
        high=5.0,
    )
    zero_rise_m: float = param(
        0.003,
        'Sets the rise, at constant force, after which the force sensor is zeroed; a larger rise zeroes it less often.',
        unit='m',
        low=0.001,
        high=0.05,
    )
    zero_steady_n: float = param(
        0.5,
        'Sets the largest change of the smoothed force that counts as constant; it must exceed the noise of'
        ' the sensor.',
        unit='N',
        low=0.05,
        high=5.0,
    )
    unlock_protective_stop: bool = param(
        False, 'Releases a protective stop when connecting; false leaves that to a person at the pendant.'
    )
    take_over: bool = param(
        False, 'Stops a program of another user that runs or pauses on the controller; false refuses to connect.'
    )
    upper_range_registers: bool = param(
        False,
        'Lets the control program use the registers 24 to 47, so that a fieldbus (EtherNet/IP, PROFINET) may keep 0 to '
        '23; false uses 0 to 23.',
    )
    probe_timeout_s: float = param(
        1.5,
        'Sets how long the controller may take to answer the first requests before connecting fails.',
        unit='s',
        low=0.1,
        high=10.0,
    )
    connect_timeout_s: float = param(
        10.0,
        'Sets how long the arm may take to be ready to move before connecting fails.',
        unit='s',
        low=0.5,
        high=60.0,
    )

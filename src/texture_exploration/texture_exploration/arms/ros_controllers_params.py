"""What can be chosen about an arm that is driven by ROS controllers."""

from __future__ import annotations

from dataclasses import dataclass

from texture_core.errors import InvalidParameter
from texture_core.parameters import param
from texture_exploration.arms.command_limits import CommandLimits
from texture_exploration.arms.surface_frame import SurfacePoseParams
from texture_exploration.force_control import ForceLoopParams


@dataclass(frozen=True)
class RosControllersParams(ForceLoopParams, SurfacePoseParams, CommandLimits):
    """Topics, frames and rates of the controllers, the tool, the surface, and the supervision."""

    twist_topic: str = param(
        'twist_controller/twist',
        'Sets the topic of the commanded velocities (geometry_msgs/TwistStamped).',
    )
    pose_topic: str = param(
        'tcp_pose_broadcaster/pose',
        'Sets the topic of the measured pose of the fingertip in the base frame (geometry_msgs/PoseStamped).',
    )
    wrench_topic: str = param(
        'force_torque_sensor_broadcaster/wrench', 'Sets the topic of the measured force (geometry_msgs/WrenchStamped).'
    )
    target_wrench_topic: str = param(
        '',
        'Sets the topic of the commanded force (geometry_msgs/WrenchStamped) for a compliance controller that presses '
        "by itself; '' presses by velocities.",
    )
    base_frame_id: str = param(
        'base', 'Sets the name of the base frame, which the measured pose must carry in its header.'
    )
    tool_frame_id: str = param(
        'tool0_controller',
        'Sets the name of the frame of the fingertip; a force with another name than this and the base frame is '
        'refused.',
    )
    twist_frame_id: str = param(
        '', "Sets the frame in which velocities are commanded, the base frame or that of the fingertip; '' is the base."
    )
    controller_manager: str = param(
        '',
        'Sets the controller manager that is asked to switch controllers when the arm is connected and let go, such as '
        "'controller_manager'; '' switches nothing.",
    )
    activate_controllers: str = param(
        'twist_controller',
        'Sets the controllers, separated by spaces, that are active only while the arm is connected.',
    )
    deactivate_controllers: str = param(
        'scaled_joint_trajectory_controller',
        'Sets the controllers, separated by spaces, that are inactive only while the arm is connected.',
    )
    rate_hz: float = param(
        250.0,
        'Sets the rate of commands; a higher rate reacts faster and costs more computing time.',
        unit='Hz',
        low=20.0,
        high=500.0,
    )
    loop_delay_s: float = param(
        0.02,
        'Sets the largest delay from a measured force to the motion that answers it; a longer one is measured as the '
        'finger comes down. A larger value lowers the gain.',
        unit='s',
        low=0.0,
        high=0.1,
    )
    command_timeout_s: float = param(
        0.1,
        'Sets how long a command holds without a new one; afterwards the arm stands still.',
        unit='s',
        low=0.02,
        high=2.0,
    )
    controller_timeout_s: float = param(
        0.0,
        'Declares after which time without a command the controller itself stops the arm; 0 declares that it never '
        "does, which is refused unless 'accept_no_timeout' is set.",
        unit='s',
        low=0.0,
        high=0.5,
    )
    accept_no_timeout: bool = param(
        False,
        'Accepts a controller that holds the last velocity for ever: then nothing stops the arm when this machine or '
        'its network fails, but the limits of the robot.',
    )
    heartbeat_s: float = param(
        0.05,
        'Sets the longest silence of the commanding process after which its guard commands zero velocity; a larger '
        'value bears a busier machine.',
        unit='s',
        low=0.02,
        high=1.0,
    )
    deadman_s: float = param(
        0.08,
        'Sets the age of the newest pose or force above which zero velocity is commanded and a fault is reported; a '
        'larger value bears more jitter.',
        unit='s',
        low=0.01,
        high=2.0,
    )
    follow_m: float = param(
        0.002,
        'Sets the commanded distance over which the arm must have followed, or its controller counts as lost; a larger '
        'value notices it later.',
        unit='m',
        low=0.0005,
        high=0.1,
    )
    tool_mass_kg: float = param(
        0.0,
        'Sets the mass of the tool whose weight is removed from the measured force; 0 if the sensor does so itself.',
        unit='kg',
        low=0.0,
        high=20.0,
    )
    invert_force: bool = param(
        False, 'Inverts the measured force, for a sensor that reports what the tool does to its surroundings.'
    )
    force_is_quantised: bool = param(
        False,
        'Lets a measured force repeat itself, as of a sensor that rounds; false takes a force that repeats itself for '
        'a frozen sensor.',
    )
    force_smoothing_s: float = param(
        0.0,
        'Sets the time constant of the low-pass filter of the measured force; a longer one removes more noise and is '
        'added to the delay of the loop.',
        unit='s',
        low=0.0,
        high=0.1,
    )
    zero_rise_m: float = param(
        0.003,
        'Sets the rise, at constant force, after which the force is zeroed; a larger rise zeroes it less often.',
        unit='m',
        low=0.001,
        high=0.05,
    )
    zero_steady_n: float = param(
        0.5,
        'Sets the largest change of the smoothed force that counts as constant; it must exceed the noise of the '
        'sensor.',
        unit='N',
        low=0.05,
        high=5.0,
    )
    connect_timeout_s: float = param(
        5.0,
        'Sets how long the first pose, the first force and the controller may take before connecting fails.',
        unit='s',
        low=0.1,
        high=60.0,
    )

    @property
    def activated(self) -> tuple[str, ...]:
        """Controllers that command the arm while it is connected."""
        return tuple(self.activate_controllers.split())

    @property
    def deactivated(self) -> tuple[str, ...]:
        """Controllers that command the arm otherwise."""
        return tuple(self.deactivate_controllers.split())

    def __post_init__(self) -> None:
        if self.twist_frame_id not in ('', self.base_frame_id, self.tool_frame_id):
            raise InvalidParameter(
                f"parameter 'twist_frame_id' is '{self.twist_frame_id}'; it must be the base frame "
                f"'{self.base_frame_id}' or the frame of the fingertip '{self.tool_frame_id}'"
            )

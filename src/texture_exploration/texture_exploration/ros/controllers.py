# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The topics of ROS controllers, polled: no executor, no callbacks, one thread.

A separate context makes the arm independent of the node that owns it: zero velocity can still be sent when that node
is shut down. Names follow the namespace and the remappings of the process.

One commander per arm: on this machine a lock decides, which is taken before anything is published and is also held
by the guard. On other machines the ids of the publishers decide; rclpy has no exclusive ownership of topics.
"""

from __future__ import annotations

import os
import time
from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from texture_core.errors import DeviceError
from texture_core.ros import to_ns
from texture_exploration.arms.arm import Vector, claim, give_up_when_ending
from texture_exploration.arms.ros_controllers import NOT_FOUND
from texture_exploration.arms.tool_state import ForceSample, PoseSample, RosControllersParams
from texture_exploration.ros.guard import MEASURED_QOS, TwistGuard, ignore, newest, participant, scope, sender, stamped

CONTROLLER_TOPICS_NODE = 'arm_topics'
COMMAND_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)  # fits every subscriber
ARRIVAL_S = 0.2
LOOKING_S = 0.05
ANNOUNCED_S = 3.0  # period in which participants announce themselves (rmw_fastrtps)
# For this time after the controller was found, no other publisher may appear, also on this machine: a participant finds
# the publishers of another only when that one announces itself again, if the first messages between both were lost.
ALONE_S = 2 * ANNOUNCED_S
GUARD_START_S = 60.0  # next to 15 busy processes a core it took 33 s
NO_GUARD = (
    f'the guard process, which would stop the arm if this process dies, has not started within {GUARD_START_S:g} s; '
    'reduce the load of this machine, and request again'
)
NO_TIMEOUT = (
    "the controller on '{topic}' declares no timeout ('controller_timeout_s' is 0): it may keep executing the last "
    "velocity if this machine or its network fails. Set its timeout, or set 'accept_no_timeout: true' once the safety "
    'limits of the robot bound speed and force (docs/safety.md)'
)
NO_SCOPE = (
    "the controller on '{topic}' declares no timeout, and systemd-run --user --scope is not available: the guard of "
    'the arm shares the control group of this process, and what kills the whole group, as stopping a container does, '
    "leaves the arm moving. Set 'controller_timeout_s', start the explorer where systemd runs for this user, or set "
    "'accept_shared_group: true'"
)


class RosTopics:
    """See `texture_exploration.arms.ros_controllers.ControllerTopics`."""

    def __init__(self, params: RosControllersParams) -> None:
        _refuse_unguarded(params)
        self._params = params
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = node = Node(
            CONTROLLER_TOPICS_NODE,
            context=self._context,
            cli_args=['--ros-args', '-r', f'__node:={CONTROLLER_TOPICS_NODE}'],  # the process may rename its node
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._topic = node.resolve_topic_name(params.twist_topic)
        self._lock = -1
        self._guard: TwistGuard | None = None
        self._looked_s, self._other = 0.0, ''
        try:
            name = f'domain {self._context.get_domain_id()}, {self._topic}'
            self._lock = claim(name, params.connect_timeout_s)
            self._participant = participant(node)
            self._wait_until_alone()
            self._open()
        except BaseException:
            self._leave()
            raise

    def _open(self) -> None:
        """Make the publishers and subscriptions, and start the guard."""
        params, node = self._params, self._node
        self._twists = node.create_publisher(TwistStamped, params.twist_topic, COMMAND_QOS)
        self._poses = node.create_subscription(PoseStamped, params.pose_topic, ignore, MEASURED_QOS)
        self._forces = node.create_subscription(WrenchStamped, params.wrench_topic, ignore, MEASURED_QOS)
        self._frame_id = params.twist_frame_id or params.base_frame_id
        topics = (self._twists.topic_name, self._frame_id, self._poses.topic_name)
        self._guard = guard = TwistGuard(node.get_namespace(), topics, self._lock)
        end_s = time.monotonic() + GUARD_START_S
        while not guard.participant:  # the time of the controllers begins when it runs
            give_up_when_ending()
            if fault := guard.fault() or NO_GUARD * (time.monotonic() > end_s):
                raise DeviceError(fault)
            time.sleep(LOOKING_S)
        if not (params.controller_timeout_s or scope()):
            node.get_logger().warning(
                "'accept_shared_group' is true: what ends the whole control group of this process, as stopping a "
                f"container does, ends the guard of the arm, too, and '{params.twist_topic}' keeps it moving"
            )

    def newest_pose(self) -> PoseSample | None:
        """Return the newest pose that came since the last call, None if none did."""
        message = newest(self._poses)
        if message is None:
            return None
        at, turned = message.pose.position, message.pose.orientation
        return PoseSample(
            to_ns(message.header.stamp),
            message.header.frame_id,
            (at.x, at.y, at.z),
            (turned.x, turned.y, turned.z, turned.w),
            self._age_ns(message),
        )

    def newest_force(self) -> ForceSample | None:
        """Return the newest force that came since the last call, None if none did."""
        message = newest(self._forces)
        if message is None:
            return None
        force = message.wrench.force
        stamp_ns, age_ns = to_ns(message.header.stamp), self._age_ns(message)
        return ForceSample(stamp_ns, message.header.frame_id, (force.x, force.y, force.z), age_ns)

    def _age_ns(self, message: Any) -> int:
        stamp_ns = to_ns(message.header.stamp)
        return int(self._node.get_clock().now().nanoseconds) - stamp_ns if stamp_ns else 0

    def listeners(self) -> int:
        """Return the number of subscribers to the commanded velocities that the guard also reaches."""
        assert self._guard is not None
        return min(self._twists.get_subscription_count(), self._guard.reached)

    def unsafe(self) -> str:
        """Return why a motion must end although the arm obeys: another commands it, or no guard would stop it."""
        assert self._guard is not None
        fault, now_s = self._guard.fault(), time.monotonic()
        if self._guard.participant and now_s - self._looked_s > LOOKING_S:
            self._looked_s, self._other = now_s, self._conflict(self._participant, self._guard.participant)
        return fault or self._other

    def beat(self, *, moving: bool) -> None:
        """Send the guard a heartbeat and whether the arm may still move."""
        assert self._guard is not None
        self._guard.beat(moving=moving)

    def send_velocity(self, velocity_m_s: Vector) -> None:
        """Command a velocity."""
        message = stamped(TwistStamped, self._node, self._frame_id)
        linear = message.twist.linear
        linear.x, linear.y, linear.z = velocity_m_s
        self._twists.publish(message)

    def _wait_until_alone(self) -> None:
        """Return once the controller is found and has no other commander, which this check must not disturb."""
        begin_s, alone_s = time.monotonic(), 0.0
        topic = self._topic
        while True:
            give_up_when_ending()
            other, now_s = self._conflict(self._participant), time.monotonic()
            if other or not self._node.count_subscribers(topic):
                alone_s = 0.0
                if now_s - begin_s > self._params.connect_timeout_s:
                    if other:
                        raise DeviceError(f'{other}; end it first. ROS forgets one that was killed after 20 s')
                    raise DeviceError(f"no node subscribes to '{topic}'{NOT_FOUND}")
            else:
                alone_s = alone_s or now_s
                if now_s - alone_s >= ALONE_S:
                    return
            time.sleep(LOOKING_S)

    def _conflict(self, *ours: str) -> str:
        """Return in a sentence another commander or controller, '' if there is none; `ours` are our participants."""
        for info in self._node.get_publishers_info_by_topic(self._topic):
            if sender(info) not in ours:
                return f"{node_of(info)} also commands the arm: it publishes on '{self._topic}'"
        for measured in (self._params.pose_topic, self._params.wrench_topic):
            found = self._node.get_publishers_info_by_topic(measured)
            if len(found) > 1:
                names = ' and '.join(sorted(map(node_of, found)))
                return f"several controllers publish on '{measured}': {names}, such as an emulated and a real one"
        return ''

    def close(self) -> None:
        """Wait until what was sent has arrived, and leave; the guard stays until an arm that may still move rests."""
        self._twists.wait_for_all_acked(Duration(seconds=ARRIVAL_S))
        self._leave()

    def _leave(self) -> None:
        if self._guard is not None:
            self._guard.leave()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)
        if self._lock >= 0:
            os.close(self._lock)


def node_of(info: Any) -> str:
    """Return the node of a publisher, as a sentence names it."""
    if info.node_name == '_NODE_NAME_UNKNOWN_':  # as DDS calls it
        return 'a node that is not discovered yet (wait some seconds and try again; `ros2 topic info -v` shows it)'
    return f"'{info.node_namespace.rstrip('/')}/{info.node_name}'"


def _refuse_unguarded(params: RosControllersParams) -> None:
    """Refuse a controller that may keep moving without limit, unless the parameters accept it."""
    if params.controller_timeout_s:
        return
    for missing, accepted in (
        (NO_TIMEOUT, params.accept_no_timeout),
        (NO_SCOPE, params.accept_shared_group or scope()),
    ):
        if not accepted:
            raise DeviceError(missing.format(topic=params.twist_topic))

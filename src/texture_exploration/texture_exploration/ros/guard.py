# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The process that stops an arm when the commanding process is silent or gone.

A controller may keep executing the last velocity: the twist controller of `ur_robot_driver` has no timeout. The guard
receives a heartbeat on a socket whose other end only the commanding process holds. If an arm that may still move is no
longer commanded, as when that process hangs, is stopped (SIGSTOP) or frozen, it commands zero velocity; the kernel
closes the socket at any end of the process, also by SIGKILL. It continues until the pose shows rest, and holds the lock
of the arm until then.
"""

from __future__ import annotations

import contextlib
import functools
import re
import select
import subprocess
import sys
import time
import uuid
from collections.abc import Callable
from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from texture_core.errors import DeviceError
from texture_exploration.arms.arm import DONE, LEAVE_S, GuardProcess, RestWatch, guard_socket
from texture_exploration.arms.tool_state import HEARTBEAT_S

# --------------------
# Messages to the controllers, and who sends them.

MEASURED_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)  # fits every publisher
MOST = 10  # messages that are taken at once: only the newest counts
PARTICIPANT = slice(0, 12)  # of the id of an endpoint: the prefix of its GUID, one a process and context


def stamped(kind: Any, node: Node, frame_id: str) -> Any:
    """Return an empty message of now."""
    message = kind()
    message.header.stamp, message.header.frame_id = node.get_clock().now().to_msg(), frame_id
    return message


def newest(subscription: Any) -> Any:
    """Return the newest waiting message, None if there is none; no executor spins."""
    found = None
    with subscription.handle:
        for _ in range(MOST):
            taken = subscription.handle.take_message(subscription.msg_type, False)
            if taken is None:
                break
            found = taken[0]
    return found


def ignore(_message: Any) -> None:
    """The node is not spun."""


def participant(node: Node) -> str:
    """Return what the ids of all publishers of a node's process and context begin with."""
    publisher = node.create_publisher(TwistStamped, f'identity_{uuid.uuid4().hex}', 1)
    end_s = time.monotonic() + LEAVE_S
    while not (infos := node.get_publishers_info_by_topic(publisher.topic_name)):
        if time.monotonic() > end_s:
            raise DeviceError(
                'the middleware of ROS does not show the publishers of this process; use rmw_fastrtps_cpp'
            )
        time.sleep(PERIOD_S)
    node.destroy_publisher(publisher)
    return sender(infos[0])


def sender(info: Any) -> str:
    """Return the participant that a publisher belongs to."""
    return bytes(info.endpoint_gid[PARTICIPANT]).hex()


# --------------------
# The guard, for the commanding process.

TWIST_GUARD_NODE = 'arm_guard'
MOVING, RESTING = b'm', b'r'
PERIOD_S = 0.01
ANSWER_S = 0.05
ANSWER = re.compile(rb'(\d{1,6}) ([0-9a-f]{24})')  # of a guard: the subscribers that it has found, and its participant
# Longest silence of a guard before it counts as hung. Next to two busy processes it was silent for more than 0.5 s
# in two of eight runs; if the explorer also dies in that time, the timeout of the controller, where there is
# one, and the limits of the robot remain. A guard that has ended is detected at once.
SILENT_S = 1.5
GIVE_UP_S = 60.0  # without a pose that shows rest
SCOPE = ('systemd-run', '--user', '--scope', '--quiet', '--collect')


@functools.cache
def scope() -> tuple[str, ...]:
    """Return the command prefix for a separate control group, nothing where systemd does not offer that."""
    with contextlib.suppress(OSError, subprocess.TimeoutExpired):
        if subprocess.run([*SCOPE, 'true'], capture_output=True, timeout=LEAVE_S, check=False).returncode == 0:
            return SCOPE
    return ()


class TwistGuard(GuardProcess):
    """The guard of one arm; no controller may be commanded that it does not reach, or once it has ended."""

    def __init__(self, namespace: str, topics: tuple[str, str, str], lock: int) -> None:
        # In a separate control group, if possible: what ends all processes of a service must not end the guard first.
        super().__init__(__name__, namespace, *topics, start=scope(), holds=(lock,))
        self.reached = 0  # subscribers that it has found; discovery takes a while and must precede a failure
        self.participant = ''
        self.garbled = 0  # answers that could not be read
        self._heard_s = 0.0
        self._moving = False

    def fault(self) -> str:
        """Return in a sentence why the guard would not stop the arm, '' if it would or is still starting."""
        with contextlib.suppress(OSError):
            while answer := self.line.recv(4096):
                if found := ANSWER.fullmatch(answer):
                    self.reached, self.participant = int(found[1]), found[2].decode()
                    self._heard_s = time.monotonic()
                else:
                    self.garbled += 1
        if self._process.poll() is not None:
            return 'the guard process, which would stop the arm if this process dies, has ended'
        silent_s = time.monotonic() - self._heard_s
        if self._heard_s and silent_s > SILENT_S:
            return (
                f'the guard process, which would stop the arm if this process dies, is silent for {silent_s:.1f} s; '
                f'{self.garbled} of its answers could not be read'
            )
        return ''

    def beat(self, *, moving: bool) -> None:
        """Send a heartbeat and whether the arm may still move."""
        self._moving = moving
        with contextlib.suppress(OSError):  # a full socket or a dead guard, which `fault` reports
            self.line.send(MOVING if moving else RESTING)

    def leave(self) -> None:
        """End the guard of an arm that rests; leave it to that of one that may still move."""
        if self._moving:
            self.line.close()
        else:
            self.dismiss()


# --------------------
# The process of the guard.


def main() -> None:
    """Run as `python -m texture_exploration.ros.guard SOCKET …`, with what `TwistGuard` takes; it starts it."""
    _, _, namespace, topic, frame_id, pose_topic = sys.argv
    line = guard_socket()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(TWIST_GUARD_NODE, namespace=namespace, enable_rosout=False, start_parameter_services=False)
    identity = participant(node)
    publisher = node.create_publisher(TwistStamped, topic, 1)
    poses = node.create_subscription(PoseStamped, pose_topic, ignore, MEASURED_QOS)

    def command_standstill() -> None:
        publisher.publish(stamped(TwistStamped, node, frame_id))

    def take_pose(rest: RestWatch) -> None:
        pose = newest(poses)
        if pose is not None:
            at = pose.pose.position
            rest.update(time.monotonic_ns(), (at.x, at.y, at.z))

    def answer() -> None:
        with contextlib.suppress(OSError):
            line.send(f'{publisher.get_subscription_count()} {identity}'.encode())

    line.setblocking(False)
    guarded(line, command_standstill, take_pose, answer)
    node.destroy_node()  # otherwise ROS shows it for 20 s as another commander
    rclpy.shutdown()


def guarded(
    line: Any,
    command_standstill: Callable[[], None],
    take_pose: Callable[[RestWatch], None],
    answer: Callable[[], None],
) -> None:
    """Guard until the other end is done, or has closed and the arm rests; report the number of subscribers."""
    rest = RestWatch()
    moving, heard_s, answered_s = False, time.monotonic(), 0.0
    while True:
        waiting = select.select([line], [], [], PERIOD_S)[0]
        now_s = time.monotonic()
        if waiting:
            try:
                received = line.recv(1)
            except ConnectionError:  # it ended before it read an answer
                received = b''
            if received == DONE:
                return
            if not received:
                break
            moving, heard_s = received != RESTING, now_s
            rest.forget()
        elif moving and now_s - heard_s > HEARTBEAT_S and not rest.at_rest:
            take_pose(rest)
            command_standstill()
        if now_s - answered_s > ANSWER_S:
            answered_s = now_s
            answer()

    # The other end has closed.
    rest.forget()
    end_s = time.monotonic() + GIVE_UP_S
    while not rest.at_rest and time.monotonic() < end_s:
        take_pose(rest)
        command_standstill()
        time.sleep(PERIOD_S)


if __name__ == '__main__':
    main()

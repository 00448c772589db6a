# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The node of an emulated arm behind a velocity controller: what is known of it are its topics."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rclpy.node import Node

from texture_core.config import param
from texture_core.ros import DiagnosticReport, Diagnostics, declare, on_change, run, to_stamp
from texture_core.types import FingerSender
from texture_simulation.devices.rails import FingerPipeParams
from texture_simulation.devices.twist_controller import TOOL_DOWN, EmulatedTwistArm, TwistControllerParams

COMMANDED_S = 0.3  # commands to a moving arm come more often
LONGEST_LIFT_S = 6.0  # shorter than a launcher waits before it kills
READINGS, APART_NS = 5, 1_000_000  # how often the clocks are read until they are of one moment


@dataclass(frozen=True)
class ControllerTopicParams(FingerPipeParams):
    """Names of the topics and frames, which are those of `ur_robot_driver` by default."""

    twist_topic: str = param('twist_controller/twist', 'Topic of the commanded velocities.')
    pose_topic: str = param('tcp_pose_broadcaster/pose', 'Topic of the measured pose.')
    wrench_topic: str = param('force_torque_sensor_broadcaster/wrench', 'Topic of the measured force.')
    base_frame_id: str = param('base', 'Name of the base frame; commands in other frames are ignored.')
    tool_frame_id: str = param('tool0_controller', 'Name of the frame of the measured force.')
    rate_hz: float = param(
        250.0, 'Rate of pose and force; a higher rate costs more computing time.', unit='Hz', low=10.0, high=1e3
    )
    blink_s: float = param(
        0.0,
        'Leaves the topic of the velocities for so long when it is set, as a controller that is switched; 0 does not.',
        unit='s',
        low=0.0,
        high=1.0,
    )
    force_delay_s: float = param(
        0.0, 'Publishes the measured force so much later than it was measured; 0 at once.', unit='s', low=0.0, high=2.0
    )
    stamp_when_sent: bool = param(
        False, 'Stamps a delayed force when it is published; false stamps it when it was measured.'
    )


class TwistControllerNode(Node):
    """Follow TwistStamped, publish PoseStamped and WrenchStamped; all parameters but the topics may be changed.

    The force on the finger as it is, in the base frame and without delay, is on `true_wrench`.
    """

    shares_file = True  # of the explorer, which defines where the surface is

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('twist_controller', **kwargs)
        self._topics = declare(self, ControllerTopicParams, changeable=True)
        self._arm = EmulatedTwistArm(declare(self, TwistControllerParams, changeable=True), time.monotonic_ns())
        on_change(self, TwistControllerParams, partial(setattr, self._arm, 'params'))
        on_change(self, ControllerTopicParams, self._on_topics)
        self._lock = threading.Lock()  # of the arm
        self._ignored = 0
        self._commanded_s = -math.inf
        topics = self._topics
        self._poses = self.create_publisher(PoseStamped, topics.pose_topic, 1)
        self._wrenches = self.create_publisher(WrenchStamped, topics.wrench_topic, 1)
        self._true_wrenches = self.create_publisher(WrenchStamped, 'true_wrench', 100)
        self._delayed: deque[tuple[float, Any, list[float]]] = deque()  # when due, stamp and reading
        self._twists = self.create_subscription(TwistStamped, topics.twist_topic, self._on_twist, 1)
        self._emulator = FingerSender(topics.finger_pipe)
        self._closing = threading.Event()
        Diagnostics(self, self._report)
        self._thread = threading.Thread(target=self._run, name='arm', daemon=True)
        self._thread.start()

    def shutdown(self) -> None:
        """Stop the time once the arm is no longer commanded.

        Ctrl-C in the terminal of a launch also reaches this node, while the explorer lifts the finger. A real
        controller is no part of that launch.
        """
        end_s = time.monotonic() + LONGEST_LIFT_S
        while time.monotonic() < min(end_s, self._commanded_s + COMMANDED_S) and self.executor is not None:
            self.executor.spin_once(timeout_sec=0.05)
        self._closing.set()
        self._thread.join()
        self._emulator.close()

    def _on_topics(self, topics: ControllerTopicParams) -> None:
        self._topics = topics
        if topics.blink_s:
            # In a thread: the executor keeps a subscription until the callback that destroys it is over.
            threading.Thread(target=self._blink, args=(topics,), name='blink', daemon=True).start()

    def _blink(self, topics: ControllerTopicParams) -> None:
        self.destroy_subscription(self._twists)
        time.sleep(topics.blink_s)
        self._twists = self.create_subscription(TwistStamped, topics.twist_topic, self._on_twist, 1)

    def _on_twist(self, message: TwistStamped) -> None:
        # As the twist controller of ur_robot_driver: a velocity in another frame is ignored.
        if message.header.frame_id != self._topics.base_frame_id:
            self._ignored += 1
            return
        self._commanded_s = time.monotonic()
        linear = message.twist.linear
        with self._lock:
            self._arm.command(time.monotonic_ns(), np.array([linear.x, linear.y, linear.z]))

    def _run(self) -> None:
        period_s = 1.0 / self._topics.rate_hz
        due_s = time.monotonic()
        while not self._closing.is_set():
            due_s = max(due_s + period_s, time.monotonic() - period_s)
            self._closing.wait(max(0.0, due_s + self._arm.jitter_s() - time.monotonic()))
            self._publish()

    def _publish(self) -> None:
        with self._lock:
            stamp_ns, now_ns = _both_clocks()
            self._arm.advance(now_ns)
            position, reading, finger = self._arm.position, self._arm.reading_n(), self._arm.finger()
            true_n = self._arm.force_n
        topics, now_s, stamp = self._topics, time.monotonic(), to_stamp(stamp_ns)
        self._poses.publish(_pose(stamp, topics.base_frame_id, position.tolist()))
        self._delayed.append((now_s + topics.force_delay_s, stamp, reading.tolist()))
        newest = None
        while self._delayed and self._delayed[0][0] <= now_s:
            newest = self._delayed.popleft()
        if newest is not None:
            measured = stamp if topics.stamp_when_sent else newest[1]
            self._wrenches.publish(_wrench(measured, topics.tool_frame_id, newest[2]))
        self._true_wrenches.publish(_wrench(stamp, topics.base_frame_id, true_n.tolist()))
        self._emulator.send(finger)

    def _report(self) -> DiagnosticReport:
        numbers = {'force_n': self._arm.finger().force_n, 'ignored commands': self._ignored}
        if not self._thread.is_alive():
            return 'ERROR', 'the emulated arm ended; see the log and start the node again', numbers
        return 'OK', 'the emulated arm runs', numbers


def _both_clocks() -> tuple[int, int]:
    """Return the time of day and the monotonic time of one moment, ns: a pause between them would be a wrong speed."""
    for _ in range(READINGS):
        before_ns, stamp_ns, now_ns = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
        if now_ns - before_ns <= APART_NS:
            break
    return stamp_ns, now_ns


def _pose(stamp: Any, frame_id: str, position: list[float]) -> PoseStamped:
    message = PoseStamped()
    message.header.stamp, message.header.frame_id = stamp, frame_id
    place, turned = message.pose.position, message.pose.orientation
    place.x, place.y, place.z = position
    turned.x, turned.y, turned.z, turned.w = TOOL_DOWN
    return message


def _wrench(stamp: Any, frame_id: str, reading: list[float]) -> WrenchStamped:
    message = WrenchStamped()
    message.header.stamp, message.header.frame_id = stamp, frame_id
    force = message.wrench.force
    force.x, force.y, force.z = reading
    return message


def main() -> None:
    """Run the node."""
    run(TwistControllerNode)

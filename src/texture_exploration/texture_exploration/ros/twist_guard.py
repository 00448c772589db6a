"""A process that commands zero velocity when the process that commanded the arm is gone.

A controller may hold the last velocity for ever: the twist controller of `ur_robot_driver` has no timeout. The guard
waits at a pipe whose other end only the commanding process holds; the kernel closes that end however the process ends,
also by SIGKILL. Whoever ends in order says so first.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import sys
import time
from typing import Any

import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.signals import SignalHandlerOptions

DONE = b'.'
REPEATED_S = 0.5
PERIOD_S = 0.01
LOOKING_S = 0.05
LEAVE_S = 2.0


class TwistGuard:
    """The guard of one topic; nothing may be commanded to those whom it does not reach.

    Parameters
    ----------
    topic
        Full name of the topic of the velocities.
    frame_id
        What their header carries.
    """

    def __init__(self, topic: str, frame_id: str) -> None:
        # A session of its own: what ends all processes of a terminal or a launch file must not end the guard first.
        self._process = subprocess.Popen(
            [sys.executable, '-m', __name__, topic, frame_id],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        assert self._process.stdout is not None
        self._pipe = self._process.stdout.fileno()
        os.set_blocking(self._pipe, False)
        self._reached = 0

    @property
    def reached(self) -> int:
        """How many who listen the guard has found; to find them takes a while, which must not come after a death."""
        with contextlib.suppress(BlockingIOError):
            if told := os.read(self._pipe, 1024).split():
                self._reached = int(told[-1])
        return self._reached

    def dismiss(self) -> None:
        """End the guard: zero velocity has been commanded."""
        with contextlib.suppress(OSError, subprocess.TimeoutExpired):  # of a guard that has ended
            self._process.communicate(DONE, timeout=LEAVE_S)
        self._process.kill()
        self._process.wait()


def main() -> None:
    """Run as `python -m texture_exploration.ros.twist_guard TOPIC FRAME`; the arm starts it."""
    topic, frame_id = sys.argv[1:]
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('arm_guard', enable_rosout=False, start_parameter_services=False)
    publisher = node.create_publisher(TwistStamped, topic, 1)
    if wait(publisher) != DONE:
        _command_standstill(node, publisher, frame_id)


def _command_standstill(node: Any, publisher: Any, frame_id: str) -> None:
    end_s = time.monotonic() + REPEATED_S
    while time.monotonic() < end_s:
        message = TwistStamped()
        message.header.stamp, message.header.frame_id = node.get_clock().now().to_msg(), frame_id
        publisher.publish(message)
        time.sleep(PERIOD_S)


def wait(publisher: Any) -> bytes:
    """Tell how many listen, whenever that changes, until the other end speaks or closes; return what it said."""
    told = 0
    while not select.select([sys.stdin], [], [], LOOKING_S)[0]:
        count = publisher.get_subscription_count()
        if count != told:
            told = count
            with contextlib.suppress(OSError):
                os.write(sys.stdout.fileno(), f'{count}\n'.encode())
    return sys.stdin.buffer.read()


if __name__ == '__main__':
    main()

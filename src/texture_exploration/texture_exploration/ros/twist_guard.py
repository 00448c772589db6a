"""A process that commands zero velocity when the process that commanded the arm is silent or gone.

A controller may hold the last velocity for ever: the twist controller of `ur_robot_driver` has no timeout. The guard
hears a heartbeat on a pipe whose other end only the commanding process holds. It commands zero velocity when an arm
that moves is no longer spoken for, as when that process hangs, is stopped (SIGSTOP) or frozen; the kernel closes the
pipe however the process ends, also by SIGKILL. Whoever ends in order says so first.
"""

from __future__ import annotations

import contextlib
import functools
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

NODE = 'arm_guard'
DONE, MOVING, RESTING = b'.', b'm', b'r'
REPEATED_S = 0.5
PERIOD_S = 0.01
ANSWER_S = 0.05
SILENT_S = 0.5  # a guard that has not answered for so long would not stop the arm either
LEAVE_S = 2.0
SCOPE = ('systemd-run', '--user', '--scope', '--quiet', '--collect')
NO_SCOPE = (
    'systemd-run --user --scope is not available: the guard of the arm shares the control group of this process, and '
    'whatever kills the whole group, as stopping a container does, kills both; only a timeout of the controller or the '
    'limits of the robot stop the arm then'
)


@functools.cache
def scope() -> tuple[str, ...]:
    """Return what starts a process in a control group of its own, nothing where systemd does not offer that."""
    with contextlib.suppress(OSError, subprocess.TimeoutExpired):
        if subprocess.run([*SCOPE, 'true'], capture_output=True, timeout=LEAVE_S, check=False).returncode == 0:
            return SCOPE
    return ()


class TwistGuard:
    """The guard of one topic; nothing may be commanded to those whom it does not reach, or once it has ended.

    Parameters
    ----------
    topic
        Full name of the topic of the velocities.
    frame_id
        What their header carries.
    heartbeat_s
        Longest silence while the arm moves.
    """

    def __init__(self, topic: str, frame_id: str, heartbeat_s: float) -> None:
        # A session and, if possible, a control group of its own: what ends all processes of a terminal, a launch file
        # or a service must not end the guard first.
        self._process = subprocess.Popen(
            [*scope(), sys.executable, '-m', __name__, topic, frame_id, str(heartbeat_s)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._out, self._in = self._process.stdin.fileno(), self._process.stdout.fileno()
        for pipe in (self._out, self._in):
            os.set_blocking(pipe, False)
        self._reached = 0
        self._heard_s = 0.0

    @property
    def pid(self) -> int:
        """Of the process."""
        return self._process.pid

    @property
    def reached(self) -> int:
        """How many who listen the guard has found; to find them takes a while, which must not come after a death."""
        self._hear()
        return self._reached

    def fault(self) -> str:
        """Return in a sentence why the guard would not stop the arm, '' if it would or is still starting."""
        self._hear()
        if self._process.poll() is not None:
            return 'the guard process, which would stop the arm if this process dies, has ended'
        silent_s = time.monotonic() - self._heard_s
        if self._heard_s and silent_s > SILENT_S:
            return f'the guard process, which would stop the arm if this process dies, is silent for {silent_s:.1f} s'
        return ''

    def beat(self, *, moving: bool) -> None:
        """Tell that the commanding process lives."""
        with contextlib.suppress(OSError):  # a full pipe or a dead guard, which `fault` tells
            os.write(self._out, MOVING if moving else RESTING)

    def dismiss(self) -> None:
        """End the guard: zero velocity has been commanded."""
        with contextlib.suppress(OSError, subprocess.TimeoutExpired):  # of a guard that has ended
            self._process.communicate(DONE, timeout=LEAVE_S)
        self._process.kill()
        self._process.wait()

    def _hear(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while told := os.read(self._in, 4096).split():
                self._reached, self._heard_s = int(told[-1]), time.monotonic()


def main() -> None:
    """Run as `python -m texture_exploration.ros.twist_guard TOPIC FRAME HEARTBEAT_S`; the arm starts it."""
    topic, frame_id, heartbeat_s = sys.argv[1:]
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(NODE, enable_rosout=False, start_parameter_services=False)
    publisher = node.create_publisher(TwistStamped, topic, 1)

    def command_standstill() -> None:
        message = TwistStamped()
        message.header.stamp, message.header.frame_id = node.get_clock().now().to_msg(), frame_id
        publisher.publish(message)

    os.set_blocking(sys.stdout.fileno(), False)
    if not guarded(publisher, float(heartbeat_s), command_standstill):
        end_s = time.monotonic() + REPEATED_S
        while time.monotonic() < end_s:
            command_standstill()
            time.sleep(PERIOD_S)


def guarded(publisher: Any, heartbeat_s: float, command_standstill: Any) -> bool:
    """Guard until the other end says that it is done, True, or closes, False; tell it how many listen."""
    moving, heard_s, answered_s = False, time.monotonic(), 0.0
    while True:
        if select.select([sys.stdin], [], [], PERIOD_S)[0]:
            said = os.read(sys.stdin.fileno(), 4096)
            if not said or DONE in said:
                return bool(said)
            moving, heard_s = said.endswith(MOVING), time.monotonic()
        now_s = time.monotonic()
        if moving and heartbeat_s < now_s - heard_s < heartbeat_s + REPEATED_S:
            command_standstill()
        if now_s - answered_s > ANSWER_S:
            answered_s = now_s
            with contextlib.suppress(OSError):
                os.write(sys.stdout.fileno(), f'{publisher.get_subscription_count()}\n'.encode())


if __name__ == '__main__':
    main()

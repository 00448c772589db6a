# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Topics of an arm that ROS drives, and the guard that stops it when the explorer has died."""

from __future__ import annotations

import contextlib
import fcntl
import functools
import importlib
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from texture_core.errors import DeviceError
from texture_core.ros import to_ns
from texture_exploration.arms.arm import DONE, ENDING, LEAVE_S, GuardProcess, Vector, give_up_when_ending
from texture_exploration.arms.ros_controllers import ForceSample, PoseSample, RosControllersParams

# --------------------
# Which publishers are of a killed process: ROS shows them until their lease ends, about 20 s, and an explorer that is
# started again must not take its own past for another commander. Each process locks a file named after its participant
# in the graph, and the kernel unlocks it however the process ends. A name without a file says nothing.

PARTICIPANT = slice(0, 12)  # of the id of an endpoint: the prefix of its GUID in RTPS
FORGOTTEN_S = 600.0  # long after ROS has forgotten a participant, its file goes


def claims() -> Path:
    """Return the folder of the locked files: on this machine, as a lock over a network may not be seen."""
    return Path(tempfile.gettempdir()) / f'texture_arm_{os.getuid()}'


def _is_free(path: Path) -> bool:
    """Return whether a file is there that nobody has locked."""
    with contextlib.suppress(OSError), path.open('r+') as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return True
    return False


def claim(node: Node) -> IO[str] | None:
    """Lock the file of a node's participant until the process ends or closes it; None where that cannot be done."""
    publisher = node.create_publisher(TwistStamped, f'claim_{uuid.uuid4().hex}', 1)
    infos = node.get_publishers_info_by_topic(publisher.topic_name)
    node.destroy_publisher(publisher)
    if not infos:  # a middleware that tells it later
        return None
    folder = claims()
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        if folder.stat().st_uid != os.getuid():
            return None
        for old in folder.iterdir():
            if time.time() - old.stat().st_mtime > FORGOTTEN_S and _is_free(old):
                old.unlink()
        file = (folder / bytes(infos[0].endpoint_gid[PARTICIPANT]).hex()).open('w')
        fcntl.flock(file, fcntl.LOCK_EX)
    except OSError:
        return None
    return file


def has_ended(info: Any) -> bool:
    """Return whether a publisher is of a process of this user that has ended: its file is there, and free."""
    return _is_free(claims() / bytes(info.endpoint_gid[PARTICIPANT]).hex())


# --------------------
# A process that commands zero velocity when the process that commanded the arm is silent or gone.
#
# A controller may hold the last velocity for ever: the twist controller of `ur_robot_driver` has no timeout. The guard
# hears a heartbeat on a pipe whose other end only the commanding process holds. It commands zero velocity, and zero
# force to a compliance controller, when an arm that moves or presses is no longer spoken for, as when that process
# hangs, is stopped (SIGSTOP) or frozen; the kernel closes the pipe however the process ends, also by SIGKILL. Whoever
# ends in order says so first.

TWIST_GUARD_NODE = 'arm_guard'
MOVING, RESTING = b'm', b'r'
REPEATED_S = 0.5
PERIOD_S = 0.01
ANSWER_S = 0.05
SILENT_S = 0.5  # a guard that has not answered for so long would not stop the arm either
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


class TwistGuard(GuardProcess):
    """The guard of one topic; nothing may be commanded to those whom it does not reach, or once it has ended."""

    def __init__(
        self, heartbeat_s: float, topic: str, frame_id: str, wrench_topic: str = '', wrench_frame_id: str = ''
    ) -> None:
        # In a control group of its own, if possible: what ends all processes of a service must not end the guard first.
        topics = (topic, frame_id, wrench_topic, wrench_frame_id)
        super().__init__(__name__, str(heartbeat_s), *topics, start=scope())
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._out, self._in = self._process.stdin.fileno(), self._process.stdout.fileno()
        for pipe in (self._out, self._in):
            os.set_blocking(pipe, False)
        self._reached = 0
        self._heard_s = 0.0

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

    def _hear(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while told := os.read(self._in, 4096).split():
                self._reached, self._heard_s = int(told[-1]), time.monotonic()


def main() -> None:
    """Run as `python -m texture_exploration.ros.controllers …`, with what `TwistGuard` takes; the arm starts it."""
    heartbeat_s, topic, frame_id, wrench_topic, wrench_frame_id = sys.argv[1:]
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):
        signal.signal(number, signal.SIG_IGN)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(TWIST_GUARD_NODE, enable_rosout=False, start_parameter_services=False)
    _file = claim(node)  # locked as long as this process lives
    publisher = node.create_publisher(TwistStamped, topic, 1)
    wrenches = node.create_publisher(WrenchStamped, wrench_topic, 1) if wrench_topic else None

    def command_standstill() -> None:
        publisher.publish(_stamped(TwistStamped, node, frame_id))
        if wrenches is not None:
            wrenches.publish(_stamped(WrenchStamped, node, wrench_frame_id))

    os.set_blocking(sys.stdout.fileno(), False)
    if not guarded(publisher, float(heartbeat_s), command_standstill):
        end_s = time.monotonic() + REPEATED_S
        while time.monotonic() < end_s:
            command_standstill()
            time.sleep(PERIOD_S)
    node.destroy_node()  # else ROS shows it for 20 s as another commander
    rclpy.shutdown()


def _stamped(kind: Any, node: Node, frame_id: str) -> Any:
    message = kind()
    message.header.stamp, message.header.frame_id = node.get_clock().now().to_msg(), frame_id
    return message


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


# --------------------
# The topics of ROS controllers, taken by whoever polls them: no executor, no callbacks, one thread.
#
# A context of its own makes the arm independent of the node that owns it: zero velocity can still be sent when that
# node is shut down. Names follow the namespace and the remappings of the process.

CONTROLLER_TOPICS_NODE = 'arm_topics'
COMMAND_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)  # fits every subscriber
MEASURED_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)  # fits every publisher
MOST = 10  # messages that are taken at once: only the newest counts
ARRIVAL_S = 0.2
DISCOVERY_S = 1.0  # once the controller is found, and before this node is seen to publish, it looks who else does
STALL_S = 4.0  # participants announce themselves every 3 s: a controller that is not found by then is not there
LOOKING_S = 0.05
UNNAMED = '_NODE_NAME_UNKNOWN_'  # of rmw, until the name of a publisher's node has come, too
UNNAMED_S = 1.0


class RosTopics:
    """See `texture_exploration.arms.ros_controllers.ControllerTopics`."""

    def __init__(self, params: RosControllersParams) -> None:
        if not (params.controller_timeout_s or params.accept_no_timeout):
            raise DeviceError(
                f"the controller on '{params.twist_topic}' declares no timeout ('controller_timeout_s' is 0): it may "
                'hold the last velocity for ever if this machine or its network fails. Set its timeout, or set '
                "'accept_no_timeout: true' once the safety limits of the robot bound speed and force (docs/safety.md)"
            )
        self._params = params
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(
            CONTROLLER_TOPICS_NODE,
            context=self._context,
            cli_args=['--ros-args', '-r', f'__node:={CONTROLLER_TOPICS_NODE}'],  # the process may rename its own node
            enable_rosout=False,
            start_parameter_services=False,
        )
        node = self._node
        wrench_topic = params.target_wrench_topic
        self._commanded_topics = [node.resolve_topic_name(name) for name in (params.twist_topic, wrench_topic) if name]
        self._claim = claim(node)
        self._unnamed_s = 0.0  # since when there has been such a publisher, 0 if there is none
        self._wait_for_the_command()
        self._twists = node.create_publisher(TwistStamped, params.twist_topic, COMMAND_QOS)
        self._wrenches = node.create_publisher(WrenchStamped, wrench_topic, COMMAND_QOS) if wrench_topic else None
        self._poses = node.create_subscription(PoseStamped, params.pose_topic, _ignore, MEASURED_QOS)
        self._forces = node.create_subscription(WrenchStamped, params.wrench_topic, _ignore, MEASURED_QOS)
        self._frame_id = params.twist_frame_id or params.base_frame_id
        force_topic = (self._wrenches.topic_name, params.base_frame_id) if self._wrenches else ()
        self._guard = TwistGuard(params.heartbeat_s, self._twists.topic_name, self._frame_id, *force_topic)
        if not scope():
            node.get_logger().warning(NO_SCOPE)

    def newest_pose(self) -> PoseSample | None:
        """Return the newest pose that came since the last call, None if none did."""
        message = _newest(self._poses)
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
        message = _newest(self._forces)
        if message is None:
            return None
        force = message.wrench.force
        stamp_ns, age_ns = to_ns(message.header.stamp), self._age_ns(message)
        return ForceSample(stamp_ns, message.header.frame_id, (force.x, force.y, force.z), age_ns)

    def _age_ns(self, message: Any) -> int:
        stamp_ns = to_ns(message.header.stamp)
        return int(self._node.get_clock().now().nanoseconds) - stamp_ns if stamp_ns else 0

    def listeners(self) -> int:
        """Return how many nodes listen to the commanded velocities, and can also be reached by the guard."""
        return min(self._twists.get_subscription_count(), self._guard.reached)

    def unsafe(self) -> str:
        """Return why the arm must not go on although it obeys: another commands it, or no guard would stop it."""
        return self._guard.fault() or self._other_commander(
            (self._node.get_fully_qualified_name(), f'/{TWIST_GUARD_NODE}')
        )

    def beat(self, *, moving: bool) -> None:
        """Tell the guard that the commanding process lives."""
        self._guard.beat(moving=moving)

    def send_velocity(self, velocity_m_s: Vector) -> None:
        """Command a velocity."""
        message = _stamped(TwistStamped, self._node, self._frame_id)
        linear = message.twist.linear
        linear.x, linear.y, linear.z = velocity_m_s
        self._twists.publish(message)

    def send_force(self, force_n: Vector) -> None:
        """Command a force of the tool on its surroundings in the base frame."""
        if self._wrenches is None:
            return
        message = _stamped(WrenchStamped, self._node, self._params.base_frame_id)
        force = message.wrench.force
        force.x, force.y, force.z = force_n
        self._wrenches.publish(message)

    def switch_controllers(self, activate: Sequence[str], deactivate: Sequence[str]) -> None:
        """Let the controller manager switch both sets or nothing."""
        manager = self._params.controller_manager
        try:
            kind = importlib.import_module('controller_manager_msgs.srv').SwitchController
        except ImportError as error:
            raise DeviceError(
                f"parameter 'controller_manager' is '{manager}', which needs controller_manager_msgs; install it "
                "(ros-jazzy-controller-manager-msgs), or set it to '' and switch the controllers by hand"
            ) from error
        request = kind.Request(activate_controllers=[*activate], deactivate_controllers=[*deactivate])
        request.strictness = kind.Request.STRICT
        answer = self._ask(kind, f'{manager}/switch_controller', request)
        if answer is None or not answer.ok:
            did = 'does not answer' if answer is None else f'refused: {getattr(answer, "message", "") or "see its log"}'
            raise DeviceError(
                f"'{manager}' was asked to activate {' '.join(activate)} instead of {' '.join(deactivate)}, and {did}"
            )

    def _ask(self, kind: Any, name: str, request: Any) -> Any:
        """Return the answer of a service, None if none comes in time; nobody spins this node meanwhile."""
        client = self._node.create_client(kind, name)
        executor = SingleThreadedExecutor(context=self._context)
        try:
            if not client.wait_for_service(self._params.connect_timeout_s):
                return None
            future = client.call_async(request)
            rclpy.spin_until_future_complete(self._node, future, executor, self._params.connect_timeout_s)
            return future.result() if future.done() else None
        finally:
            executor.shutdown()
            self._node.destroy_client(client)

    def _wait_for_the_command(self) -> None:
        """Take the topics only once nobody else is there; who commands must not be disturbed by being looked at."""
        begin_s, found_s = time.monotonic(), 0.0
        while True:
            other, now_s = self._other_commander(), time.monotonic()
            waited_s = now_s - begin_s
            if other and waited_s > self._params.connect_timeout_s:
                self._leave()
                raise DeviceError(f'{other}; end it first. One of another user that was killed is forgotten after 20 s')
            # Discovery stalls for seconds after a process was killed: an empty graph is no proof that nobody commands.
            is_found = self._node.count_subscribers(self._commanded_topics[0])
            if not found_s and (is_found or waited_s > min(STALL_S, self._params.connect_timeout_s)):
                found_s = now_s
            if found_s and now_s - found_s >= DISCOVERY_S and not other and not self._unnamed_s:
                return
            if ENDING.is_set():
                self._leave()
                give_up_when_ending()
            time.sleep(LOOKING_S)

    def _other_commander(self, own: tuple[str, ...] = ()) -> str:
        """Return in a sentence who else commands, '' if nobody does; each name of ours may publish once."""
        found = {
            topic: [info for info in self._node.get_publishers_info_by_topic(topic) if not has_ended(info)]
            for topic in self._commanded_topics
            if self._node.count_publishers(topic) > len(own)
        }
        unnamed = any(info.node_name == UNNAMED for infos in found.values() for info in infos)
        self._unnamed_s = (self._unnamed_s or time.monotonic()) if unnamed else 0.0
        if unnamed and time.monotonic() - self._unnamed_s < UNNAMED_S:
            return ''
        for topic, infos in found.items():
            left = list(own)
            for info in infos:
                name = f'{info.node_namespace.rstrip("/")}/{info.node_name}'
                if name not in left:
                    return f"'{name}' commands the arm, too: it publishes on '{topic}'"
                left.remove(name)
        return ''

    def close(self) -> None:
        """Wait until what was sent has arrived, and leave."""
        self._twists.wait_for_all_acked(Duration(seconds=ARRIVAL_S))
        self._guard.dismiss()
        self._leave()

    def _leave(self) -> None:
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)
        if self._claim is not None:
            self._claim.close()


def _newest(subscription: Any) -> Any:
    """Return the newest message that waits, None if there is none."""
    newest = None
    with subscription.handle:
        for _ in range(MOST):
            taken = subscription.handle.take_message(subscription.msg_type, False)
            if taken is None:
                break
            newest = taken[0]
    return newest


def _ignore(_message: Any) -> None:
    """Nobody spins this node."""

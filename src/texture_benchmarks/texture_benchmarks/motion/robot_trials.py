"""Slides of emulated robots in real time, evaluated by where the finger really was and how hard it really pressed."""

from __future__ import annotations

import os
import socket
import statistics
import tempfile
import threading
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from unittest import mock

from texture_benchmarks.motion.trial import CIRCLE, SLIDE, ForceControlMetrics, force_control_metrics
from texture_core.exploration import ExplorationRequest, ExplorationState, Phase
from texture_core.finger_state import FingerState
from texture_core.node_process import NodeProcess
from texture_exploration.arms.in_hand import InHandArm, InHandParams
from texture_exploration.arms.protocol import Arm, ArmState
from texture_exploration.arms.rails import RailsArm, RailsParams
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.ros_controllers_params import RosControllersParams
from texture_exploration.arms.ur import UrArm
from texture_exploration.arms.ur_params import UrArmParams
from texture_exploration.explorer import Explorer
from texture_exploration.motions.touch import TouchParams
from texture_exploration.safety import SafetyLimits
from texture_simulation.devices.dynamixel import EmulatedDynamixelBus
from texture_simulation.devices.dynamixel_motors import LEAP_FINGERS, leap_hand
from texture_simulation.devices.rails import EmulatedRails
from texture_simulation.devices.rails_firmware import RailsMachine
from texture_simulation.devices.ur.params import UrControllerParams
from texture_simulation.devices.ur.process import ControllerProcess

HEIGHT_M = 0.002
UR_IP = '127.0.0.66'
CONTROLLER_DOMAIN = 99
LAG_S = 0.02
LIMITS = SafetyLimits(state_timeout_s=1.0, approach_timeout_s=40.0)  # a busy machine is not what is tried here
DEADLINE_S = 60.0
GRIP_S = 20.0
TOUCH = TouchParams()
RUB = ExplorationRequest('in_hand_sliding', speed_m_s=0.02, force_n=1.0, distance_m=0.02, duration_s=3.0)


class FingerLog:
    """Takes what an emulated robot tells the bench about its finger; usable as a context."""

    def __init__(self) -> None:
        self.fingers: list[FingerState] = []
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(('127.0.0.1', 0))
        self._socket.settimeout(0.1)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name='finger log', daemon=True)

    @property
    def port(self) -> int:
        """UDP port on loopback."""
        return int(self._socket.getsockname()[1])

    def __enter__(self) -> FingerLog:
        self._thread.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._ended.set()
        self._thread.join()
        self._socket.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            finger = FingerState.from_bytes(self._receive())
            if finger is not None:
                self.fingers.append(finger)

    def _receive(self) -> bytes:
        with suppress(TimeoutError):
            return self._socket.recv(1024)
        return b''


@contextmanager
def ur(stiffness_n_m: float, finger_port: int) -> Iterator[Arm]:
    """Start an emulated UR controller."""
    params = UrControllerParams(
        ip=UR_IP, finger_port=finger_port, stiffness_n_m=stiffness_n_m, start_height_m=HEIGHT_M, force_offset_n=0.0
    )
    with ControllerProcess(params):
        yield UrArm(UrArmParams(ip=UR_IP))


@contextmanager
def rails(stiffness_n_m: float, finger_port: int) -> Iterator[Arm]:
    """Start emulated rails."""
    machine = RailsMachine(stiffness_n_m=stiffness_n_m, start_height_m=HEIGHT_M)
    with (
        tempfile.TemporaryDirectory() as folder,
        EmulatedRails(Path(folder) / 'rails', machine, finger_port=finger_port) as made,
    ):
        yield RailsArm(RailsParams(device=str(made.port.link), height_m=HEIGHT_M))


@contextmanager
def hand(stiffness_n_m: float, finger_port: int) -> Iterator[Arm]:
    """Start an emulated LEAP hand; its index finger is looked at."""
    motors = leap_hand(stiffness_n_m)
    with (
        tempfile.TemporaryDirectory() as folder,
        EmulatedDynamixelBus(Path(folder) / 'hand', motors, LEAP_FINGERS['index'], finger_port) as made,
    ):
        yield InHandArm(InHandParams(hand='dynamixel', device=str(made.port.link), grip_timeout_s=GRIP_S))


@contextmanager
def ros_controllers(stiffness_n_m: float, finger_port: int) -> Iterator[Arm]:
    """Start an emulated velocity controller with a lag of 20 ms, known only through its topics, in a domain of its own.

    The stiffest contact is expected throughout, and may be met with half of the wanted force.
    """
    emulated = {'finger_port': finger_port, 'stiffness_n_m': stiffness_n_m, 'start_height_m': HEIGHT_M, 'lag_s': LAG_S}
    isolation = {'ROS_DOMAIN_ID': str(CONTROLLER_DOMAIN), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    with (
        mock.patch.dict(os.environ, isolation),
        NodeProcess('texture_simulation', 'twist_controller', emulated),
    ):
        # A busy machine is not what is tried here.
        yield RosControllersArm(
            RosControllersParams(
                connect_timeout_s=DEADLINE_S, deadman_s=1.0, max_stiffness_n_m=20000.0, max_impact_n=0.5
            )
        )


@dataclass(frozen=True)
class RobotUnderTest:
    """An emulated robot: how it is started, what it does, how it touches, and the module that it needs."""

    start: Callable[[float, int], AbstractContextManager[Arm]]
    needs: str
    requests: tuple[ExplorationRequest, ...] = (SLIDE, CIRCLE)
    touch: TouchParams = TOUCH


ROBOTS: Mapping[str, RobotUnderTest] = {
    'emulated UR': RobotUnderTest(ur, 'rtde_control'),
    'emulated rails': RobotUnderTest(rails, 'serial'),
    'emulated ROS controllers': RobotUnderTest(ros_controllers, 'rclpy', (SLIDE, CIRCLE, RUB)),
    # Motors tell their speed and current in coarse steps.
    'emulated hand': RobotUnderTest(
        hand, 'dynamixel_sdk', (RUB,), TouchParams(speed_tolerance=0.3, force_tolerance=0.2)
    ),
}


def typical_trial(name: str, stiffness_n_m: float, request: ExplorationRequest, repeats: int) -> ForceControlMetrics:
    """Return the median of each number of several trials, or one that failed: the machine may have been busy once.

    Parameters
    ----------
    name
        Name of the robot in `ROBOTS`.
    stiffness_n_m
        Stiffness of the surface.
    request
        What is explored.
    repeats
        Number of trials.

    Returns
    -------
    ForceControlMetrics
    """
    trials = [robot_trial(name, stiffness_n_m, request) for _ in range(repeats)]
    failed = [trial for trial in trials if not trial.success]
    if failed:
        return failed[0]
    names = [field.name for field in fields(ForceControlMetrics) if field.name not in ('success', 'message')]
    medians = {name: statistics.median(getattr(trial, name) for trial in trials) for name in names}
    return ForceControlMetrics(True, trials[0].message, **medians)


def robot_trial(name: str, stiffness_n_m: float, request: ExplorationRequest) -> ForceControlMetrics:
    """Explore once with one of `ROBOTS`, over a surface of that stiffness.

    Parameters
    ----------
    name
        Name of the robot in `ROBOTS`.
    stiffness_n_m
        Stiffness of the surface.
    request
        What is explored.

    Returns
    -------
    ForceControlMetrics
    """
    robot = ROBOTS[name]
    states: list[ExplorationState] = []
    with ExitStack() as stack:
        log = stack.enter_context(FingerLog())
        arm = stack.enter_context(robot.start(stiffness_n_m, log.port))
        explorer = Explorer(arm, replace(robot.touch, approach_stiffness_n_m=stiffness_n_m), LIMITS, states.append)
        stack.callback(explorer.close)
        explorer.connect()
        exploration = explorer.begin('trial', request)
        exploration.ended.wait(DEADLINE_S)
        return force_control_metrics(_by_phase(log.fingers, states), request, exploration.outcome)


def _by_phase(fingers: list[FingerState], states: list[ExplorationState]) -> list[tuple[Phase, ArmState]]:
    """Return where the finger was in which phase.

    What it did before the first is left out, as is what of a slide was not guaranteed to be steady: turns of strokes.
    """
    begins = [state.stamp_ns for state in states]
    log = []
    for finger in fingers:
        newest = bisect_right(begins, finger.time_ns) - 1
        if newest >= 0 and (states[newest].phase is not Phase.SLIDE or _guaranteed(states[newest], finger.time_ns)):
            log.append((states[newest].phase, _arm_state(finger)))
    return log


def _guaranteed(state: ExplorationState, time_ns: int) -> bool:
    return time_ns <= state.stamp_ns + state.steady_s * 1e9


def _arm_state(finger: FingerState) -> ArmState:
    velocity = (finger.vx_m_s, finger.vy_m_s, finger.vz_m_s)
    return ArmState(finger.time_ns, (finger.x_m, finger.y_m, finger.z_m), velocity, finger.force_n)

"""The emulated robots of the motion benchmark, and what they report about the finger."""

from __future__ import annotations

import os
import socket
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from texture_benchmarks.motion.trial import CIRCLE, SLIDE
from texture_core.exploration import ExplorationRequest
from texture_core.finger_state import FingerState
from texture_core.node_process import NodeProcess
from texture_exploration.arms.in_hand import InHandArm, InHandParams
from texture_exploration.arms.protocol import Arm
from texture_exploration.arms.rails import RailsArm, RailsParams
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.ros_controllers_params import RosControllersParams
from texture_exploration.arms.ur import UrArm
from texture_exploration.arms.ur_params import UrArmParams
from texture_exploration.motions.touch import TouchParams
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

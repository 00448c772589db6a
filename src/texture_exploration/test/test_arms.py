# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every arm of the catalogue keeps to, on its default parameters."""

import contextlib
import math
import os
import tempfile
import time
from pathlib import Path
from unittest import mock

import pytest

from texture_core.errors import CommandRefused, DeviceError
from texture_core.ros_testing import NodeProcess
from texture_exploration.arms.arm import Arm, ArmCommand
from texture_exploration.arms.catalogue import ARMS
from texture_simulation.devices.dynamixel import EmulatedDynamixelBus, leap_hand
from texture_simulation.devices.rails import EmulatedRails
from texture_simulation.devices.ur import ControllerProcess, UrControllerParams

pytestmark = [pytest.mark.realtime, pytest.mark.ros]


@contextlib.contextmanager
def ur_controller():
    pytest.importorskip('rtde_control', reason='ur-rtde is not installable here')
    with ControllerProcess(UrControllerParams(ip='127.0.0.57')):
        yield {'ip': '127.0.0.57'}


@contextlib.contextmanager
def emulated_rails():
    with tempfile.TemporaryDirectory() as folder, EmulatedRails(Path(folder) / 'rails') as rails:
        yield {'device': str(rails.port.link)}


@contextlib.contextmanager
def emulated_hand():
    pytest.importorskip('dynamixel_sdk', reason='dynamixel-sdk is not installed')
    with tempfile.TemporaryDirectory() as folder, EmulatedDynamixelBus(Path(folder) / 'bus', leap_hand()) as bus:
        yield {'device': str(bus.port.link), 'grip_timeout_s': 20.0}


@contextlib.contextmanager
def emulated_controllers():
    pytest.importorskip('rclpy', reason='there is no ROS here')
    domain = {'ROS_DOMAIN_ID': '92'}
    alone = mock.patch('texture_exploration.ros.controllers.ALONE_S', 1.0)  # no other commander is looked for here
    with mock.patch.dict(os.environ, domain), alone, NodeProcess('texture_simulation', 'twist_controller'):
        # Patient with a busy machine, which is not what is tried here; the emulated controller has a timeout.
        yield {'connect_timeout_s': 30.0, 'deadman_s': 1.0, 'controller_timeout_s': 0.1}


DEVICES = {
    'ros_controllers': emulated_controllers,
    'hand': emulated_hand,
    'ur': ur_controller,
    'rails': emulated_rails,
}  # what must be there for an arm, and the parameters that lead to it


@pytest.fixture(scope='module', params=ARMS)
def arm(request):
    """Return a connected arm and its device, both started once."""
    with DEVICES.get(request.param, lambda: contextlib.nullcontext({}))() as values:
        arm_class = ARMS[request.param]
        arm = arm_class(arm_class.Params(**values))
        arm.connect()
        yield arm
        arm.close()


def wait_for(condition, deadline_s=5.0):
    deadline = time.monotonic() + deadline_s
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.002)


def test_the_state_stays_young_while_the_arm_rests(arm):
    first = arm.state().time_ns
    wait_for(lambda: arm.state().time_ns > first)
    assert arm.state().fault == ''
    assert all(map(math.isfinite, (*arm.state().position, *arm.state().velocity, arm.state().force_n)))


def test_the_arm_moves_as_commanded_and_stops(arm):
    x, y, _ = arm.state().position

    def moves():  # a command expires, on a busy machine before it was carried out
        arm.command(ArmCommand(tangential_m_s=(0.02, -0.01)))
        return arm.state().position[0] > x and arm.state().position[1] < y

    wait_for(moves)
    arm.stop()
    wait_for(lambda: not any(arm.state().velocity))


def test_the_arm_stops_by_itself_when_it_hears_nothing(arm):
    def moves():
        arm.command(ArmCommand(normal_m_s=0.01))
        return arm.state().velocity[2] > 0

    wait_for(moves)
    wait_for(lambda: not any(arm.state().velocity))


def test_a_command_out_of_range_is_refused_and_the_arm_stands_still(arm):
    refused = [
        ArmCommand(tangential_m_s=(math.nan, 0.0)),
        ArmCommand(tangential_m_s=(0.0, math.inf)),
        ArmCommand(tangential_m_s=(5.0, 0.0)),
        ArmCommand(normal_m_s=math.inf),
        ArmCommand(normal_m_s=-5.0),
        ArmCommand(force_n=-1.0),
        ArmCommand(force_n=1000.0),
        ArmCommand(force_n=math.nan),
    ]
    for command in refused:
        arm.command(ArmCommand(tangential_m_s=(0.01, 0.0)))
        with pytest.raises(CommandRefused, match='the arm stopped'):
            arm.command(command)
        wait_for(lambda: not any(arm.state().velocity))
    assert arm.state().fault == ''


def test_a_closed_arm_refuses_commands_and_closing_twice_and_connecting_again_is_no_fault(arm):
    arm.close()
    with pytest.raises(DeviceError, match='not connected'):
        arm.command(ArmCommand(tangential_m_s=(0.01, 0.0)))
    arm.close()
    arm.connect()
    before = arm.state().time_ns
    wait_for(lambda: arm.state().time_ns > before)


def test_an_arm_with_a_base_frame_measures_from_where_the_surface_was_moved(arm):
    moves = type(arm).move_surface is not Arm.move_surface
    assert bool(arm.base_frame_id) == moves
    if moves:
        before_m = arm.state().position[2]
        x, y, z, *turned = arm.surface_pose
        arm.move_surface((x, y, z - 0.01, *turned))
        arm.connect()
        assert arm.state().position[2] == pytest.approx(before_m + 0.01, abs=1e-4)
        assert arm.surface_pose == pytest.approx((x, y, z - 0.01, *turned))

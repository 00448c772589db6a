# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import itertools
import os
import time
from contextlib import closing
from types import SimpleNamespace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped

from texture_core.ros import to_ns
from texture_core.ros_testing import LocalGraph
from texture_core.types import FingerReceiver, FingerState
from texture_simulation.nodes import twist_controller
from texture_simulation.nodes.leap_hand import LeapHandNode
from texture_simulation.nodes.rails import RailsNode
from texture_simulation.nodes.twist_controller import TwistControllerNode
from texture_simulation.nodes.ur_controller import UrControllerNode

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

DEADLINE_S = 20.0
NODES = {'rails': RailsNode, 'leap_hand': LeapHandNode}


@pytest.fixture
def graph():
    with LocalGraph(76) as graph:
        yield graph


@pytest.mark.parametrize('name', NODES)
def test_the_device_lives_with_its_node_and_reports_where_the_finger_is(name, graph, tmp_path):
    path = str(tmp_path / 'finger')
    with closing(FingerReceiver(path)) as emulator:
        node = graph.add(NODES[name], link=str(tmp_path / name), finger_pipe=path)
        before_ns = time.monotonic_ns()
        state = FingerState(0)
        while state.time_ns < before_ns:
            [*_, state] = emulator.states(DEADLINE_S)
        assert (state.z_m, state.force_n) == (pytest.approx(0.01), 0.0)
        assert (tmp_path / name).exists()
        assert node._report()[0] == 'OK'
        node.shutdown()
        assert not (tmp_path / name).exists()


IP = '127.0.0.65'


def test_the_controller_lives_and_ends_with_its_node_which_reports_if_it_dies(graph):
    reports = graph.listen(DiagnosticArray, '/diagnostics')
    node = graph.add(UrControllerNode, ip=IP)
    controller = node._controller
    assert controller.ask('robotmode') == 'Robotmode: RUNNING'
    graph.until(lambda: reports)
    assert (reports[0].status[0].message, reports[0].status[0].hardware_id) == ('the emulated controller runs', IP)
    os.kill(controller.pid, 9)
    os.waitid(os.P_PID, controller.pid, os.WEXITED | os.WNOWAIT)
    graph.until(lambda: 'the emulated controller ended' in reports[-1].status[0].message)


def test_a_pose_is_that_of_its_stamp_on_a_machine_that_pauses(graph, monkeypatch):
    node = graph.add(TwistControllerNode, command_timeout_s=0.0)
    pauses = itertools.cycle([0.0, 0.0, 0.0, 0.03])

    def time_ns():
        found = time.time_ns()
        time.sleep(next(pauses))
        return found

    monkeypatch.setattr(twist_controller, 'time', SimpleNamespace(**{**vars(time), 'time_ns': time_ns}))
    poses = graph.listen(PoseStamped, 'tcp_pose_broadcaster/pose')
    with node._lock:
        node._arm.command(time.monotonic_ns(), np.array([0.05, 0.0, 0.0]))
    graph.until(lambda: len(poses) > 60)
    places = np.array([(to_ns(one.header.stamp) * 1e-9, one.pose.position.x) for one in poses[20:]])
    ways_m = np.diff(places[::5], axis=0)  # 20 ms and more
    assert ways_m[:, 1] / ways_m[:, 0] == pytest.approx(0.05, rel=0.1)

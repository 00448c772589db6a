# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0

from __future__ import annotations

import os
import time
from contextlib import closing

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from texture_core.ros_testing import LocalGraph
from texture_core.types import FingerReceiver, FingerState
from texture_simulation.nodes.leap_hand import LeapHandNode
from texture_simulation.nodes.rails import RailsNode
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

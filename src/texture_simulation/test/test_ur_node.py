# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from texture_core.ros_testing import LocalGraph
from texture_simulation.nodes.ur_controller import UrControllerNode

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

IP = '127.0.0.65'


@pytest.fixture
def graph():
    with LocalGraph(91) as graph:
        yield graph


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

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The nodes of a robot brought up in order: the explorer takes control of its arm last, or not at all."""

import re
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_bringup.nodes.bring_up import BringUp
from texture_core.errors import DeviceError
from texture_core.ros_testing import LocalGraph
from texture_core.types import ExplorationRequest
from texture_drivers.nodes.sensor import SensorNode
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.nodes.explorer import ExplorerNode

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

EXPLORER = {'autostart': False, 'start_height_m': 0.002, 'state_timeout_s': 2.0, 'watch_signal': False}


@pytest.fixture
def graph():
    with LocalGraph(85, deadline_s=60.0) as graph:
        yield graph


@pytest.fixture
def recording(tmp_path):
    np.savez(tmp_path / 'slide.npz', samples=np.zeros((500, 1)), rate_hz=1000.0, channels=['film'])
    return {'sensor': 'file', 'device': str(tmp_path / 'slide.npz'), 'config': '{loop: true}', 'autostart': False}


def label(node):
    return node._state_machine.current_state[1]


def bring_up(graph, meanwhile=lambda: None, **parameters):
    """Bring nodes up in a thread, while the graph lets them answer; return what that raised."""
    given = [Parameter(name, value=value) for name, value in parameters.items()]
    with ThreadPoolExecutor() as pool:
        ended = pool.submit(lambda: BringUp(parameter_overrides=given))
        graph.until(lambda: meanwhile() or ended.done())
    return ended.exception()


def test_the_sensor_is_activated_before_the_explorer(graph, recording):
    sensor, explorer = graph.add(SensorNode, **recording), graph.add(ExplorerNode, **EXPLORER)
    assert (label(sensor), label(explorer)) == ('unconfigured', 'unconfigured')
    explore = graph.peer.create_client(srv.Explore, 'explore')
    graph.until(explore.service_is_ready)
    refused = explore.call_async(srv.Explore.Request(request=msg.ExplorationRequest(motion='linear_slide')))
    graph.until(refused.done)
    active = []  # in this order

    def seen():
        active.extend(node for node in (sensor, explorer) if label(node) == 'active' and node not in active)

    assert bring_up(graph, seen, nodes='sensor explorer') is None
    assert active == [sensor, explorer]
    assert refused.result().result.error_code == msg.ExplorationResult.ERROR_NOT_ACTIVE
    assert 'no control of the arm' in refused.result().result.message


def test_a_node_that_is_not_there_is_named_and_the_explorer_is_not_activated(graph):
    explorer = graph.add(ExplorerNode, **EXPLORER)
    error = bring_up(graph, nodes='classifier explorer', timeout_s=0.5)
    assert isinstance(error, DeviceError)
    assert re.match(r"node '/classifier' was not found; .* not activated or not reached: explorer", str(error))
    assert label(explorer) == 'unconfigured'


def test_a_deactivated_explorer_lifts_lets_go_and_refuses_until_it_is_activated_again(graph):
    explorer = graph.add(ExplorerNode, **{**EXPLORER, 'autostart': True})
    states = graph.listen(msg.ExplorationState, 'exploration')
    graph.until(lambda: states)
    exploration = explorer._explorer.begin('one', ExplorationRequest('linear_slide', speed_m_s=0.01, distance_m=0.1))
    graph.until(lambda: any(state.phase == msg.ExplorationState.PHASE_SLIDE for state in states))
    explorer.trigger_deactivate()
    assert exploration.ended.is_set()
    assert (exploration.outcome.success, exploration.outcome.lifted) == (False, True)
    assert exploration.outcome.message == 'the explorer released the arm'
    with pytest.raises(DeviceError, match='not connected'):
        explorer._explorer.arm.command(ArmCommand())
    recover = graph.peer.create_client(Trigger, 'explorer/recover')
    graph.until(recover.service_is_ready)
    answer = recover.call_async(Trigger.Request())
    graph.until(answer.done)
    assert not answer.result().success
    assert 'no control of the arm' in answer.result().message
    explorer.trigger_activate()
    assert explorer._explorer.fault() == ''
    explorer.trigger_shutdown()
    assert label(explorer) == 'finalized'
    with pytest.raises(DeviceError, match='not connected'):
        explorer._explorer.arm.command(ArmCommand())

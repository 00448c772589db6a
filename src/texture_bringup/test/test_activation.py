# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""An explorer moves its arm only while it is active."""

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from std_srvs.srv import Trigger
from texture_msgs import msg, srv

from texture_core.errors import DeviceError
from texture_core.ros_testing import LocalGraph
from texture_core.types import ExplorationRequest
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.nodes.explorer import ExplorerNode

pytestmark = [pytest.mark.realtime, pytest.mark.ros]


@pytest.fixture
def graph():
    with LocalGraph(85, deadline_s=60.0) as graph:
        yield graph


def test_an_explorer_refuses_until_it_is_active_and_lifts_lets_go_and_refuses_when_it_is_deactivated(graph):
    explorer = graph.add(ExplorerNode, autostart=False, start_height_m=0.002, state_timeout_s=2.0, watch_signal=False)
    assert explorer._state_machine.current_state[1] == 'unconfigured'
    explore = graph.peer.create_client(srv.Explore, 'explore')
    graph.until(explore.service_is_ready)
    refused = explore.call_async(srv.Explore.Request(request=msg.ExplorationRequest(motion='linear_slide')))
    graph.until(refused.done)
    assert refused.result().result.error_code == msg.ExplorationResult.ERROR_NOT_ACTIVE
    assert 'no control of the arm' in refused.result().result.message
    explorer.trigger_configure()
    explorer.trigger_activate()
    change = graph.peer.create_client(ChangeState, 'explorer/change_state')
    graph.until(change.service_is_ready)
    states = graph.listen(msg.ExplorationState, 'exploration')
    graph.until(lambda: states)
    exploration = explorer._explorer.begin('one', ExplorationRequest('linear_slide', speed_m_s=0.01, distance_m=0.1))
    graph.until(lambda: any(state.phase == msg.ExplorationState.PHASE_SLIDE for state in states))
    deactivated = change.call_async(ChangeState.Request(transition=Transition(id=Transition.TRANSITION_DEACTIVATE)))
    graph.until(deactivated.done)
    assert deactivated.result().success
    assert exploration.ended.is_set()
    assert (exploration.outcome.success, exploration.outcome.message) == (False, 'the explorer released the arm')
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
    assert explorer._state_machine.current_state[1] == 'finalized'
    with pytest.raises(DeviceError, match='not connected'):
        explorer._explorer.arm.command(ArmCommand())

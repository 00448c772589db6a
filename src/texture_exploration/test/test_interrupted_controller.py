# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""An emulated controller that is interrupted with the explorer, as by Ctrl-C in the terminal of a launch."""

import signal

import pytest

from texture_core.ros_testing import LocalGraph, NodeProcess
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.tool_state import RosControllersParams
from texture_exploration.explorer import Explorer
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

# Patient with a busy machine, which is not what is tried.
ARM = RosControllersParams(
    connect_timeout_s=30.0, deadman_s=1.0, max_impact_n=0.5, accept_no_timeout=True, accept_shared_group=True
)
LIMITS = SafetyLimits(state_timeout_s=2.0, approach_timeout_s=60.0)
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.05)
HELD = {'start_height_m': 0.003, 'command_timeout_s': 0.0}  # as a controller that keeps executing the last velocity
DEADLINE_S = 60.0


def test_an_emulated_controller_that_is_interrupted_with_the_explorer_lets_it_lift_the_finger_first():
    """A real controller is not part of that launch."""
    with LocalGraph(77, deadline_s=DEADLINE_S), NodeProcess('texture_simulation', 'twist_controller', HELD) as node:
        explorer = Explorer(RosControllersArm(ARM), TouchParams(), LIMITS, lambda state: None)
        try:
            explorer.connect()
            exploration = explorer.begin('one', SLIDE)
            while exploration.state.phase is not Phase.SLIDE:
                assert not exploration.ended.wait(0.002), exploration.outcome
            node.process.send_signal(signal.SIGINT)
            explorer.stop('interrupted')
            assert exploration.ended.wait(DEADLINE_S)
            assert exploration.outcome.message == 'interrupted'  # anything else ends without a lift
            assert exploration.outcome.lifted
        finally:
            explorer.close()
        assert node.process.wait(DEADLINE_S) == 0

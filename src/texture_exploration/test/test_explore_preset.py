# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A preset asked of a running explorer."""

import threading
from functools import partial

import pytest
from rclpy.parameter import Parameter

from texture_core.errors import UnknownName
from texture_core.ros import WaitingExecutor
from texture_core.ros_testing import LocalGraph
from texture_exploration.nodes.explore_preset import ExplorePreset
from texture_exploration.nodes.explorer import ExplorerNode

pytestmark = [pytest.mark.realtime, pytest.mark.ros]
PRESET = 'motion: linear_slide\nspeed_m_s: 0.1\nvary: {distance_m: [0.02, 0.03, 5.0]}\n'  # the last one is refused


@pytest.fixture
def graph():
    with LocalGraph(67, deadline_s=40.0) as graph:
        yield graph


def test_every_motion_of_a_preset_is_made_and_the_node_ends(graph, tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text(PRESET)
    quick = {'start_height_m': 0.002, 'state_timeout_s': 2.0, 'watch_signal': False}
    explorer = ExplorerNode(parameter_overrides=[Parameter(name, value=value) for name, value in quick.items()])
    ended = threading.Event()
    asker = graph.add(partial(ExplorePreset, ended.set), preset=str(path), surface='cork', repeats=1)
    executor = WaitingExecutor()
    executor.add_node(explorer)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        graph.until(ended.is_set)
    finally:
        explorer.shutdown()
        executor.shutdown()
        thread.join()
        explorer.destroy_node()
    assert not asker.all_succeeded
    assert dict(asker.counts) == {'done': 2, 'aborted': 0, 'refused': 1}


def test_an_unknown_preset_is_reported_with_the_nearest_name(graph):
    with pytest.raises(UnknownName, match="did you mean 'hu'"):
        graph.add(ExplorePreset, preset='huu')

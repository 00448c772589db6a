"""A preset asked of a running explorer."""

import threading
import time

import pytest
import rclpy
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.parameter import Parameter

from texture_core.errors import UnknownName
from texture_exploration.nodes.explore_preset import ExplorePreset
from texture_exploration.nodes.explorer import THREADS, ExplorerNode

pytestmark = pytest.mark.ros
DEADLINE_S = 40.0
PRESET = 'motion: linear_slide\nspeed_m_s: 0.1\ndistance_m: 0.02\nvary: {direction_deg: [0, 720, .inf]}\n'


def spin_until(executor, ended):
    deadline = time.monotonic() + DEADLINE_S
    while not ended.is_set():
        assert time.monotonic() < deadline
        executor.spin_once(timeout_sec=0.5)


def overrides(**values):
    return [Parameter(name, value=value) for name, value in values.items()]


@pytest.fixture
def ros(monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', '30')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    rclpy.init()
    yield
    rclpy.try_shutdown()


def test_every_motion_of_a_preset_is_made_and_the_node_ends(ros, tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text(PRESET)
    explorer = ExplorerNode(parameter_overrides=overrides(start_height_m=0.002, stale_s=2.0))
    ended = threading.Event()
    asker = ExplorePreset(ended.set, parameter_overrides=overrides(preset=str(path), surface='cork', repeats=1))
    executor = MultiThreadedExecutor(THREADS)
    executor.add_node(explorer)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    own = SingleThreadedExecutor()
    own.add_node(asker)
    try:
        spin_until(own, ended)
    finally:
        explorer.shutdown()
        executor.shutdown()
        thread.join()
        own.shutdown()
        explorer.destroy_node()
        asker.destroy_node()
    assert not asker.all_well
    assert dict(asker.counts) == {'done': 2, 'aborted': 0, 'refused': 1}


def test_an_unknown_preset_is_told_with_the_nearest_name(ros):
    with pytest.raises(UnknownName, match="did you mean 'hu'"):
        ExplorePreset(parameter_overrides=overrides(preset='huu'))

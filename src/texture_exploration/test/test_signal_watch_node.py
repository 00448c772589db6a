# SPDX-License-Identifier: Apache-2.0
"""A sensor that falls silent in the slide, as the explorer meets it: a process of its own."""

import subprocess
import sys
import time

import pytest
from texture_msgs import msg, srv

from texture_core.ros import SENSOR_QOS, STATE_QOS
from texture_core.ros_testing import LocalGraph
from texture_core.types import Phase

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

DEADLINE_S = 30.0
PARAMETERS = {'watch_signal': 'true', 'start_height_m': 0.002, 'state_timeout_s': 1.0}
EXPLORER = [sys.executable, '-c', 'from texture_exploration.nodes.explorer import main; main()', '--ros-args']
SLOW = {'motion': 'linear_slide', 'speed_m_s': 0.01, 'distance_m': 0.1}
QUICK = {'motion': 'linear_slide', 'speed_m_s': 0.1, 'distance_m': 0.02}


class Finger:
    """A client that also plays the sensor, for as long as `streaming`."""

    def __init__(self, graph):
        self.streaming, self.phases = True, []
        self.until, peer = graph.until, graph.peer
        self._signal = peer.create_publisher(msg.TactileSignal, 'signal', SENSOR_QOS)
        peer.create_timer(0.01, self._publish_samples)
        peer.create_subscription(msg.ExplorationState, 'exploration', self._on_state, STATE_QOS)
        self._explore = peer.create_client(srv.Explore, 'explore')

    def _publish_samples(self):
        if self.streaming:
            self._signal.publish(msg.TactileSignal())

    def _on_state(self, state):
        self.phases.append((tuple(Phase)[state.phase].value, time.monotonic()))

    def ready(self):
        return self._explore.service_is_ready() and self._signal.get_subscription_count() > 0

    def explore(self, **request):
        return self._explore.call_async(srv.Explore.Request(request=msg.ExplorationRequest(**request)))


@pytest.fixture
def finger():
    options = [word for name, value in PARAMETERS.items() for word in ('-p', f'{name}:={value}')]
    with LocalGraph(77) as graph, subprocess.Popen([*EXPLORER, *options]) as process:
        yield Finger(graph)
        process.terminate()


def test_a_silent_sensor_ends_the_slide_and_the_next_exploration_works(finger, record_property):
    finger.until(finger.ready)
    answer = finger.explore(**SLOW)
    finger.until(lambda: finger.phases and finger.phases[-1][0] == 'slide')
    finger.streaming, silent_s = False, time.monotonic()
    finger.until(lambda: finger.phases[-1][0] == 'lift')
    record_property('detected_s', finger.phases[-1][1] - silent_s)
    print(f'sensor silent: lifting after {1e3 * (finger.phases[-1][1] - silent_s):.0f} ms')
    finger.until(answer.done)
    assert answer.result().result.error_code == msg.ExplorationResult.ERROR_NO_SIGNAL
    assert answer.result().result.message.startswith("no samples have come on 'signal' for")
    finger.streaming = True
    again = finger.explore(**QUICK)
    finger.until(again.done)
    assert again.result().result.error_code == msg.ExplorationResult.ERROR_NONE, again.result()

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A classifier that is killed is back soon: started again by the launcher, its model loaded, estimates flowing."""

import os
import re
import signal
import time

import numpy as np
import pytest

pytestmark = [pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'


from texture_benchmarks.ros.graph import Graph
from texture_bringup.launcher import ChildLauncher, find_launch_file
from texture_core.ros import to_msg
from texture_core.types import FeatureVector
from texture_estimation.model import load_model
from texture_evaluation.train import train_from_bags
from texture_simulation.offline import SlidePlan, write_simulated

DOMAIN = 81
DEADLINE_S = 60.0
PERIOD_S = 0.02
SURFACES = ('glass', 'leather')
LAUNCH = """<launch>
  <node pkg="texture_estimation" exec="classifier" name="classifier" output="screen" {attributes}>
    <param name="model" value="{model}" type="str"/>
  </node>
</launch>
"""


@pytest.fixture
def model(tmp_path):
    bags = write_simulated(
        tmp_path / 'bags', SlidePlan(slides=3, slide_s=1.0), np.random.default_rng(0), surfaces=SURFACES
    )
    train_from_bags('default', bags, out=tmp_path / 'model')
    return tmp_path / 'model.json'


def as_shipped(file='emulator'):
    """Return how the launch file has the classifier started again."""
    return re.search(r'exec="classifier".*?(respawn=".*?" respawn_delay=".*?")>', find_launch_file(file).read_text())[1]


def times_to_be_ready_again(model, folder, kills):
    """Kill the classifier again and again; return the times, s, from each kill to the next estimate."""
    launch = folder / 'classifier.launch.xml'
    launch.write_text(LAUNCH.format(model=model, attributes=as_shipped().replace('$(var respawn)', 'true')))
    known = load_model(model)
    vector = FeatureVector(0, 'a', 0.5, 0.1, known.names, np.zeros(len(known.names)), feature_set=known.feature_set)
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_LOG_DIR': str(folder)}
    received = []
    with ChildLauncher(str(launch), {}, environment, folder / 'log', together=False), Graph(DOMAIN) as graph:
        graph.listen('texture', received.append)
        features = graph.publisher('features')

        def answered() -> bool:
            features.publish(to_msg(vector))
            graph.spin(PERIOD_S)
            return bool(received)

        graph.wait_until(answered, DEADLINE_S, 'estimates')
        assert received[-1].model
        times_s = []
        for _ in range(kills):
            graph.spin(1.0)  # what is in progress
            *_, pid = re.findall(r'\[launch\] classifier started \(process (\d+)\)', (folder / 'log').read_text())
            os.kill(int(pid), signal.SIGKILL)
            began_s = time.monotonic()
            received.clear()
            graph.wait_until(answered, DEADLINE_S, 'estimates')
            times_s.append(time.monotonic() - began_s)
    return times_s


def test_a_killed_classifier_predicts_again(model, tmp_path, record_property) -> None:
    (ready_s,) = times_to_be_ready_again(model, tmp_path, 1)
    record_property('ready_again_s', ready_s)

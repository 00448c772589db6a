# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Every executable, in the executor that it ships with: a message on each of its topics does not end it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile

from texture_core.ros_testing import LocalGraph, NodeProcess
from texture_drivers.nodes.adaptor import import_message

pytestmark = pytest.mark.ros

DOMAIN = 91
ANY = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # which every subscription takes
# Package, a topic that it subscribes, and parameters of each; FOLDER is an empty one.
NODES: dict[str, tuple[str, str, dict[str, Any]]] = {
    'adaptor': ('texture_drivers', 'imu/data_raw', {'mapping': 'imu'}),
    'sensor': ('texture_drivers', 'exploration', {'device': 'FOLDER/none'}),
    'feature_extractor': ('texture_features', 'signal', {}),
    'classifier': ('texture_estimation', 'features', {}),
    'roughness_estimator': ('texture_estimation', 'features', {}),
    'explorer': ('texture_exploration', 'texture', {'autostart': False}),
    'record': ('texture_recordings', '', {'out': 'FOLDER/bag'}),
    'emulator': ('texture_simulation', '', {'sensor_link': 'FOLDER/sensor', 'finger_pipe': 'FOLDER/finger'}),
    'leap_hand': ('texture_simulation', '', {'link': 'FOLDER/hand', 'finger_pipe': 'FOLDER/finger'}),
    'rails': ('texture_simulation', '', {'link': 'FOLDER/rails', 'finger_pipe': 'FOLDER/finger'}),
    'twist_controller': ('texture_simulation', 'twist_controller/twist', {'finger_pipe': 'FOLDER/finger'}),
    'ur_controller': ('texture_simulation', '', {'ip': '127.0.0.91', 'finger_pipe': 'FOLDER/finger'}),
    'dashboard': ('texture_bringup', 'signal', {'port': 8591}),
    'views': ('texture_bringup', 'signal', {}),
}


@pytest.fixture
def graph() -> Iterator[LocalGraph]:
    with LocalGraph(DOMAIN, deadline_s=60.0) as graph:
        yield graph


def test_no_node_is_left_out() -> None:
    files = {file.stem for file in Path(__file__).parents[2].glob('*/*/nodes/*.py')}
    assert files - {'__init__'} == NODES.keys() | {'replay'}  # it ends by itself; test_replay_record.py starts it


@pytest.mark.parametrize('name', NODES)
def test_a_node_survives_an_empty_message_on_each_of_its_topics(graph: LocalGraph, tmp_path: Path, name: str) -> None:
    package, topic, given = NODES[name]
    given = {
        key: value.replace('FOLDER', str(tmp_path)) if isinstance(value, str) else value for key, value in given.items()
    }
    client = AsyncParameterClient(graph.peer, name)
    with NodeProcess(package, name, given, domain_id=DOMAIN) as node:

        def over(condition: Any) -> bool:
            assert node.process.poll() is None, node.output
            return bool(condition())

        def topics() -> dict[str, list[str]]:
            if (name, '/') not in graph.peer.get_node_names_and_namespaces():
                return {}
            return dict(graph.peer.get_subscriber_names_and_types_by_node(name, '/'))

        graph.until(lambda: over(client.services_are_ready))
        graph.until(lambda: over(lambda: not topic or f'/{topic}' in topics()))
        for topic, [kind] in topics().items():
            message = import_message(kind)()
            publisher = graph.peer.create_publisher(type(message), topic, ANY)
            graph.until(lambda publisher=publisher: over(publisher.get_subscription_count))
            publisher.publish(message)
        for _ in range(2):  # the second answer comes after the messages
            answer = client.get_parameters(['use_sim_time'])
            graph.until(lambda answer=answer: over(answer.done))

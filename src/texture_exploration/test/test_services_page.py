# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The lines of docs/operate.md, as requests to running nodes."""

import importlib
import re
import shlex
from pathlib import Path

import pytest
import yaml
from rclpy.action import ActionClient
from std_srvs.srv import Trigger
from texture_msgs.msg import ExplorationResult

from texture_core.ros_testing import LocalGraph, filled
from texture_exploration.nodes import explorer
from texture_exploration.nodes.explorer import ExplorerNode

pytestmark = [pytest.mark.realtime, pytest.mark.ros]

PAGE = Path(__file__).parents[3] / 'docs' / 'operate.md'
LINE = re.compile(r'`(ros2 (?:service call|action send_goal) [^`]+)`')
OF_OTHERS = {
    '/explorer/touch_surface',
    '/explorer/forget_touches',
    '/sensor/tare',
    '/classifier/add_texture',
    '/classifier/remove_last_added',
    '/classifier/remove_texture',
}


def parsed(line):
    """Return name, class and values of a line."""
    words = [word for word in shlex.split(line) if not word.startswith('--')]
    name, kind, values = words[3:]
    package, folder, cls = kind.split('/')
    return name, getattr(importlib.import_module(f'{package}.{folder}'), cls), yaml.safe_load(values)


LINES = [parsed(line) for line in LINE.findall(PAGE.read_text())]


@pytest.mark.parametrize(('name', 'kind', 'values'), LINES, ids=[f'{n}-{k.__name__}' for n, k, _ in LINES])
def test_every_line_fits_its_type(name, kind, values):
    filled((kind.Goal if hasattr(kind, 'Goal') else kind.Request)(), values)


def test_the_page_names_every_service_of_the_explorer():
    source = Path(explorer.__file__).read_text()
    offered = {name.replace('~', '/explorer') for name in re.findall(r"_offer\('(~/\w+)'", source)}
    assert offered
    assert offered <= {name for name, _, _ in LINES}


def test_the_explorer_answers_every_line_that_is_its_own():
    with LocalGraph(93, deadline_s=60.0) as graph:
        graph.add(ExplorerNode, start_height_m=0.002, state_timeout_s=1.0, watch_signal=False)
        for name, kind, values in LINES:
            if name in OF_OTHERS:
                continue
            if hasattr(kind, 'Goal'):
                client = ActionClient(graph.peer, kind, name)
                assert client.wait_for_server(30.0)
                sent = client.send_goal_async(filled(kind.Goal(), values))
                graph.until(sent.done)
                answered = sent.result().get_result_async()
                graph.until(answered.done)
                result = answered.result().result.result
            else:
                client = graph.peer.create_client(kind, name)
                assert client.wait_for_service(30.0)
                answered = client.call_async(filled(kind.Request(), values))
                graph.until(answered.done)
                result = answered.result()
            result = getattr(result, 'result', result)  # of the service
            success = result.success if kind is Trigger else result.error_code == ExplorationResult.ERROR_NONE
            assert success, (name, result.message)

# SPDX-License-Identifier: Apache-2.0
"""The layout for Foxglove shows what the nodes really publish."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from std_srvs.srv import Trigger
from texture_msgs import srv

from texture_recordings.ros import TOPICS

pytestmark = pytest.mark.ros  # needs the built messages

LAYOUT = json.loads((Path(__file__).parents[1] / 'config' / 'foxglove.json').read_text())
FIELD = re.compile(r'^(/\w+)(?:\.(\w+)(\[:\])?)?$')
# What scripts in the layout make of the topics of the suite, and of which of them.
SCRIPTS = [script['sourceCode'] for script in LAYOUT['userNodes'].values()]
MADE = {re.search(r'export const output = "(/\w+)"', code).group(1) for code in SCRIPTS}
PANELS = LAYOUT['configById']
BUTTONS = {name: config for name, config in PANELS.items() if name.startswith('CallService!')}
VIEWS = {name: config for name, config in PANELS.items() if name not in BUTTONS}
# Services with a request of their own; the others are triggers.
REQUESTS = {'/explore': srv.Explore, '/add_texture': srv.AddTexture, '/remove_texture': srv.RemoveTexture}
SERVICE = re.compile(r"create_service\([\w.]+, '(\w+)'")
TYPES = {'/' + topic.name.lstrip('/'): topic.type for topic in TOPICS.values()}


def paths(config: Any) -> list[str]:
    """Return every message path that a panel names, however deep."""
    if isinstance(config, dict):
        named = [key for key in config if key.startswith('/')]
        return named + [path for value in config.values() for path in paths(value)]
    if isinstance(config, list):
        return [path for value in config for path in paths(value)]
    return [config] if isinstance(config, str) and config.startswith('/') else []


@pytest.mark.parametrize('panel', VIEWS)
def test_a_panel_shows_fields_that_its_messages_have(panel: str) -> None:
    shown = paths(VIEWS[panel])
    assert shown
    for path in shown:
        topic, field, all_of_it = FIELD.fullmatch(path).groups()
        if topic in MADE:
            continue
        assert topic in TYPES, f'{path}: nobody publishes {topic}'
        if field:
            kind = TYPES[topic].get_fields_and_field_types()[field]
            assert kind.startswith('sequence<') == bool(all_of_it), f'{path} is a {kind}'


def test_the_topics_of_the_suite_are_all_shown_but_the_features() -> None:
    shown = {FIELD.fullmatch(path).group(1) for path in paths(VIEWS)}
    assert set(TYPES) - shown == {'/features'}


@pytest.mark.parametrize('button', BUTTONS)
def test_a_button_calls_a_service_of_a_node_with_a_request_that_fits(button: str) -> None:
    name = BUTTONS[button]['serviceName']
    nodes = Path(__file__).parents[2].glob('*/texture_*/nodes/*.py')
    assert name in {f'/{service}' for node in nodes for service in SERVICE.findall(node.read_text())}
    values = json.loads(BUTTONS[button]['requestPayload'])
    REQUESTS.get(name, Trigger).Request(**values)  # rclpy checks names and types


def test_an_operator_has_a_button_for_each_of_his_actions() -> None:
    called = {config['serviceName'] for config in BUTTONS.values()}
    assert {'/explore', '/stop', '/recover', '/tare', '/touch_surface', '/add_texture', '/remove_texture'} <= called

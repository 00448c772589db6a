# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The layout for Foxglove shows what the nodes really publish."""

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from std_srvs.srv import Trigger
from texture_msgs import srv

from texture_bringup.nodes.views import VIEW_TYPES
from texture_core.ros_testing import filled
from texture_recordings.ros import TOPICS

pytestmark = pytest.mark.ros  # needs the built messages

CONFIG, PAGE = Path(__file__).parents[1] / 'config', Path(__file__).parents[3] / 'docs' / 'interfaces.md'
LAYOUT = json.loads((CONFIG / 'foxglove.json').read_text())
FIELD = re.compile(r'^((?:/\w+)+)(?:\.(\w+)(\[(?::|\d+)\])?)?$')
PANELS = LAYOUT['configById']
BUTTONS = {name: config for name, config in PANELS.items() if name.startswith('CallService!')}
VIEWS = {name: config for name, config in PANELS.items() if name not in BUTTONS}
# Services with a request of their own; the others are triggers.
REQUESTS = {
    '/explore': srv.Explore,
    '/classifier/add_texture': srv.AddTexture,
    '/classifier/remove_texture': srv.RemoveTexture,
}
SERVICE = re.compile(r"(?:create_service\([\w.]+, |_offer\()'([\w~/]+)'")
SHOWN = {f'/views/{name}': kind for name, kind in VIEW_TYPES.items()}
TYPES = {'/' + topic.name.lstrip('/'): topic.type for topic in TOPICS.values()} | SHOWN


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
        assert topic in TYPES, f'{path}: nobody publishes {topic}'
        if field:
            kind = TYPES[topic].get_fields_and_field_types()[field]
            assert kind.startswith('sequence<') == bool(all_of_it), f'{path} is a {kind}'


def test_all_is_shown_but_features_labels_and_the_signals_that_have_a_view() -> None:
    shown = {FIELD.fullmatch(path).group(1) for path in paths(VIEWS)}
    assert set(TYPES) - shown == {'/features', '/model_info', '/signal', '/signal_static'}


@pytest.mark.parametrize('button', BUTTONS)
def test_a_button_calls_a_service_of_a_node_with_a_request_that_fits(button: str) -> None:
    name = BUTTONS[button]['serviceName']
    nodes = Path(__file__).parents[2].glob('*/texture_*/nodes/*.py')
    offered = {
        f'/{service}'.replace('/~', f'/{node.stem}') for node in nodes for service in SERVICE.findall(node.read_text())
    }
    assert name in offered
    values = json.loads(BUTTONS[button]['requestPayload'])
    filled(REQUESTS.get(name, Trigger).Request(), values)


@pytest.mark.parametrize('file', ['foxglove.json', 'views.rviz'])
def test_the_line_of_the_page_moves_all_topics_services_and_frames_into_a_namespace(file: str) -> None:
    [script] = re.findall(r"^ {4}sed -E '(.+)' foxglove", PAGE.read_text(), re.MULTILINE)
    moved = subprocess.run(['sed', '-E', script, CONFIG / file], check=True, capture_output=True, text=True).stdout
    content = yaml.safe_load(moved)  # JSON is YAML
    assert {path.split('/')[1] for path in paths(content)} - {'diagnostics'} == {'left'}
    assert set(re.findall(r'(?:followTf|frameId|Frame)"?: "?([\w/]+)', moved)) == {'left/surface'}


def test_an_operator_has_a_button_for_each_of_his_actions() -> None:
    called = {config['serviceName'] for config in BUTTONS.values()}
    assert set(REQUESTS) | {'/explorer/stop', '/explorer/recover', '/sensor/tare', '/explorer/touch_surface'} <= called

"""The layout for Foxglove shows what the nodes really publish."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from texture_recordings.ros.topics import TOPICS

pytestmark = pytest.mark.ros  # needs the built messages

LAYOUT = json.loads((Path(__file__).parents[1] / 'config' / 'foxglove.json').read_text())
FIELD = re.compile(r'^(/\w+)(?:\.(\w+)(\[:\])?)?$')
# What scripts in the layout make of the topics of the suite, and of which of them.
SCRIPTS = [script['sourceCode'] for script in LAYOUT['userNodes'].values()]
MADE = {re.search(r'export const output = "(/\w+)"', code).group(1) for code in SCRIPTS}
TYPES = {'/' + topic.name.lstrip('/'): topic.type for topic in TOPICS.values()}


def paths(config: Any) -> list[str]:
    """Return every message path that a panel names, however deep."""
    if isinstance(config, dict):
        named = [key for key in config if key.startswith('/')]
        return named + [path for value in config.values() for path in paths(value)]
    if isinstance(config, list):
        return [path for value in config for path in paths(value)]
    return [config] if isinstance(config, str) and config.startswith('/') else []


def placed(node: Any) -> list[str]:
    return [node] if isinstance(node, str) else placed(node['first']) + placed(node['second'])


@pytest.mark.parametrize('panel', LAYOUT['configById'])
def test_a_panel_shows_fields_that_its_messages_have(panel: str) -> None:
    shown = paths(LAYOUT['configById'][panel])
    assert shown
    for path in shown:
        topic, field, all_of_it = FIELD.fullmatch(path).groups()
        if topic in MADE:
            continue
        assert topic in TYPES, f'{path}: nobody publishes {topic}'
        if field:
            kind = TYPES[topic].get_fields_and_field_types()[field]
            assert kind.startswith('sequence<') == bool(all_of_it), f'{path} is a {kind}'


def test_every_panel_has_its_place() -> None:
    assert sorted(placed(LAYOUT['layout'])) == sorted(LAYOUT['configById'])


def test_the_topics_of_the_suite_are_all_shown_but_the_features() -> None:
    shown = {FIELD.fullmatch(path).group(1) for path in paths(LAYOUT['configById'])}
    assert set(TYPES) - shown == {'/features'}


@pytest.mark.parametrize('code', SCRIPTS)
def test_a_script_reads_fields_that_its_messages_have(code: str) -> None:
    inputs = re.findall(r'"(/\w+)"', re.search(r'export const inputs = \[(.*?)\]', code).group(1))
    assert inputs
    fields = {field for topic in inputs for field in TYPES[topic].get_fields_and_field_types()}
    read = set(re.findall(r'(?:event\.message|\bstate)\.(\w+)', code))
    assert read
    assert read <= fields
    slide = re.search(r'const SLIDE = (\d+);', code)
    assert int(slide.group(1)) == TYPES['/exploration'].SLIDE

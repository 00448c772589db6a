"""Read a `node` element with its params and remaps."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from texture_core.errors import InvalidLaunch
from texture_launch import template
from texture_launch.description import NodeDescription
from texture_launch.elements import NODE_TEXTS, attribute, check_form, truth
from texture_launch.scope import Scope
from texture_launch.values import parameter_value

ON_SCREEN = {'': False, 'log': False, 'screen': True, 'both': True}
SHUTDOWN_ON_EXIT = {'': False, 'shutdown': True}


def read_node(element: Element, scope: Scope) -> NodeDescription:
    """Return the node that an element describes, everything in it substituted."""
    texts = {name: scope.expand(element.get(name, '')) for name in NODE_TEXTS}
    attribute(element, 'pkg')
    attribute(element, 'exec')
    return NodeDescription(
        package=texts['pkg'],
        executable=texts['exec'],
        name=texts['name'],
        namespace=joined_namespace(scope.namespace, texts['namespace']) or '/' * ('namespace' in element.attrib),
        arguments=command_line(element.get('args', ''), scope),
        parameters=tuple(_parameters(item, scope) for item in element.findall('param')),
        remappings=tuple(_remapping(item, scope) for item in element.findall('remap')),
        screen=_choice(texts['output'], ON_SCREEN, 'output'),
        respawn=truth(texts['respawn'] or 'false', "'respawn' of <node>"),
        respawn_delay_s=_seconds(texts['respawn_delay']),
        needed=_choice(texts['on_exit'], SHUTDOWN_ON_EXIT, 'on_exit'),
        environment=dict(scope.environment),
    )


def joined_namespace(base: str, name: str) -> str:
    """Return an absolute namespace, `name` below `base` unless it is absolute itself; '' if both are ''."""
    joined = name if name.startswith('/') or not (base or name) else f'{base}/{name}'
    return '/' + joined.strip('/') if joined else ''


def command_line(text: str, scope: Scope) -> tuple[str, ...]:
    """Return the arguments in a text, split at spaces outside quotes; what a substitution gives is never split.

    Raises
    ------
    InvalidLaunch
        If quotes are not closed.
    """
    parts = template.parse(text)
    values = {f'\0{index}\0': part for index, part in enumerate(parts) if isinstance(part, template.Call)}
    marked = ''.join(part if isinstance(part, str) else f'\0{index}\0' for index, part in enumerate(parts))
    try:
        words = shlex.split(marked)
    except ValueError as error:
        raise InvalidLaunch(f"'args' of <node> is '{text}', whose quotes are not closed") from error
    for mark, call in values.items():
        value = template.expand((call,), scope.perform)
        words = [word.replace(mark, value) for word in words]
    return tuple(words)


def _choice(text: str, choices: Mapping[str, bool], name: str) -> bool:
    if text not in choices:
        raise InvalidLaunch(f"'{name}' of <node> is '{text}'; allowed is one of {', '.join(filter(None, choices))}")
    return choices[text]


def _seconds(text: str) -> float:
    try:
        seconds = float(text or 0.0)
    except ValueError:
        seconds = math.nan
    if not 0.0 <= seconds < math.inf:
        raise InvalidLaunch(f"'respawn_delay' of <node> is '{text}'; a number of seconds from 0 is needed")
    return seconds


def _parameters(element: Element, scope: Scope) -> Path | dict[str, Any]:
    check_form(element, 'param')
    if 'from' not in element.attrib:
        return dict(_named(element, scope, prefix=''))
    path = Path(scope.expand(element.attrib['from']))
    if 'name' in element.attrib:
        raise InvalidLaunch(f"<param from='{path}'> has a name, too; the file holds the names")
    if not path.is_file():
        raise InvalidLaunch(f"there is no parameter file '{path}'; give the path of one")
    return path


def _named(element: Element, scope: Scope, prefix: str) -> list[tuple[str, Any]]:
    """Return the names, joined with dots, and values of a param and of those inside it."""
    check_form(element, 'param')
    name = prefix + scope.expand(attribute(element, 'name'))
    if len(element) and 'value' in element.attrib:
        raise InvalidLaunch(f"<param name='{name}'> has both a value and params inside; give one of them")
    if len(element):
        return [pair for child in element for pair in _named(child, scope, f'{name}.')]
    try:
        value = parameter_value(attribute(element, 'value'), element.get('type', 'yaml'), scope.expand)
    except InvalidLaunch as error:
        raise InvalidLaunch(f"<param name='{name}'>: {error}") from error
    return [(name, value)]


def _remapping(element: Element, scope: Scope) -> tuple[str, str]:
    check_form(element, 'remap')
    return scope.expand(attribute(element, 'from')), scope.expand(attribute(element, 'to'))

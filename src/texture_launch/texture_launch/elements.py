"""The elements of a launch file: which attributes and children they may have, and how these are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element

from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidLaunch

CONDITIONS = ('if', 'unless')
TRUTH = {'true': True, '1': True, 'false': False, '0': False}
NODE_TEXTS = ('pkg', 'exec', 'name', 'namespace', 'output', 'respawn', 'respawn_delay', 'on_exit')
# Attributes and child elements of each element; None: any element.
ALLOWED: Mapping[str, tuple[Sequence[str], Sequence[str] | None]] = {
    'launch': (('version',), None),
    'arg': (('name', 'default', 'description', *CONDITIONS), ('choice',)),
    'arg of an include': (('name', 'value'), ()),
    'choice': (('value',), ()),
    'let': (('name', 'value', *CONDITIONS), ()),
    'set_env': (('name', 'value', *CONDITIONS), ()),
    'push_ros_namespace': (('namespace', *CONDITIONS), ()),
    'push-ros-namespace': (('namespace', *CONDITIONS), ()),
    'group': (('scoped', *CONDITIONS), None),
    'include': (('file', *CONDITIONS), ('arg',)),
    'node': ((*NODE_TEXTS, 'args', *CONDITIONS), ('param', 'remap')),
    'param': (('name', 'value', 'type', 'from'), ('param',)),
    'remap': (('from', 'to'), ()),
}


def check_form(element: Element, kind: str) -> None:
    """Raise UnknownName if an element has an attribute or a child that its kind does not know."""
    attributes, children = ALLOWED[kind]
    for name in element.attrib:
        if name not in attributes:
            raise unknown_name(name, attributes, f'attribute of <{element.tag}>')
    for child in element:
        if children is not None and child.tag not in children:
            raise unknown_name(child.tag, children, f'element inside <{element.tag}>')


def attribute(element: Element, name: str) -> str:
    """Return an attribute that must be there.

    Raises
    ------
    InvalidLaunch
        If it is missing.
    """
    if name not in element.attrib:
        raise InvalidLaunch(f"<{element.tag}> has no attribute '{name}'; give it one")
    return element.attrib[name]


def truth(text: str, where: str) -> bool:
    """Return whether a text says true; `where` is named in the error if it says neither.

    Raises
    ------
    InvalidLaunch
        If it says neither.
    """
    value = TRUTH.get(text.strip().lower())
    if value is None:
        raise InvalidLaunch(f"{where} is '{text}'; true, false, 1 or 0 is needed")
    return value


def is_declaration(element: Element) -> bool:
    """Return whether an `arg` declares an argument; the other kind, inside an include, gives one a value."""
    return 'value' not in element.attrib

"""Read an XML launch file: from its elements, in order, to the nodes it asks for.

The elements and their attributes are a subset of upstream's (`ros2 launch`), with the same meaning: a `group` is a
scope of its own, an `include` is not, so the arguments given to it stay set behind it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from texture_core.catalogue import unknown_name
from texture_core.errors import InvalidLaunch, TextureError
from texture_launch.bounded_xml import MAX_ELEMENTS, parse_launch_file
from texture_launch.description import Argument, NodeDescription
from texture_launch.elements import CONDITIONS, attribute, check_form, is_declaration, truth
from texture_launch.node_element import joined_namespace, read_node
from texture_launch.scope import Scope

MAX_INCLUDES = 20  # of files within each other


@dataclass
class ReadState:
    """What has been read so far: nodes, names of all declared arguments, and the files being read."""

    nodes: list[NodeDescription] = field(default_factory=list)
    declared: set[str] = field(default_factory=set)
    files: list[Path] = field(default_factory=list)
    elements: int = 0


def read(path: Path, given: Mapping[str, str], environment: Mapping[str, str]) -> list[NodeDescription]:
    """Return the nodes that a launch file asks for, in its order.

    Parameters
    ----------
    given
        Launch arguments by name.
    environment
        Environment of the launcher: what `$(env …)` sees and the nodes inherit.
    path
        Of the launch file.

    Returns
    -------
    list of NodeDescription
        Included files in their place.

    Raises
    ------
    InvalidLaunch, UnknownName
        With the file and what is wrong in it.
    """
    reading = ReadState()
    _read_file(path, Scope(dict(given), dict(environment)), reading)
    for name in given:
        if name not in reading.declared:
            raise unknown_name(name, reading.declared, f'argument of {path.name}')
    return reading.nodes


def declared_arguments(path: Path) -> list[Argument]:
    """Return the arguments that a launch file itself declares."""
    elements = [item for item in parse_launch_file(path).iter('arg') if is_declaration(item)]
    return [Argument(item.get('name', ''), item.get('default'), item.get('description', '')) for item in elements]


def all_arguments(path: Path, environment: Mapping[str, str]) -> list[Argument]:
    """Return the arguments of a launch file, and of those it includes at a place that no argument decides."""
    found = {argument.name: argument for argument in declared_arguments(path)}
    for included in _certain_includes(path, environment, {path}):
        for argument in declared_arguments(included):
            found.setdefault(argument.name, argument)
    return list(found.values())


def _certain_includes(path: Path, environment: Mapping[str, str], seen: set[Path]) -> Iterator[Path]:
    """Yield the files that a file includes at a place that no argument decides, and those that they include, once."""
    for element in parse_launch_file(path).iter('include'):
        with contextlib.suppress(TextureError):
            included = Path(Scope({}, dict(environment)).expand(attribute(element, 'file')))
            if included in seen or len(seen) > MAX_INCLUDES:
                continue
            seen.add(included)
            inner = list(_certain_includes(included, environment, seen))
            yield included
            yield from inner


def _read_file(path: Path, scope: Scope, reading: ReadState) -> None:
    root = parse_launch_file(path)
    if len(reading.files) > MAX_INCLUDES:
        raise InvalidLaunch(f"'{path}' is included more than {MAX_INCLUDES} levels deep; does it include itself?")
    reading.files.append(path)
    # Also those behind a condition that is not met: to give one of them is no error.
    reading.declared |= {argument.name for argument in declared_arguments(path)}
    try:
        check_form(root, 'launch')
        _read_children(root, scope, reading)
    except TextureError as error:
        raise type(error)(f'{path.name}: {error}') from error
    reading.files.pop()


def _read_children(parent: Element, scope: Scope, reading: ReadState) -> None:
    for element in parent:
        reading.elements += 1
        if reading.elements > MAX_ELEMENTS:
            raise InvalidLaunch(
                f'the files included have more than {MAX_ELEMENTS} elements; do they include each other?'
            )
        if element.tag not in READERS:
            raise unknown_name(element.tag, READERS, 'launch element')
        check_form(element, element.tag)
        if _wanted(element, scope):
            READERS[element.tag](element, scope, reading)


def _wanted(element: Element, scope: Scope) -> bool:
    given = [name for name in CONDITIONS if name in element.attrib]
    if len(given) > 1:
        raise InvalidLaunch(f"<{element.tag}> has both 'if' and 'unless'; give one of them")
    if not given:
        return True
    met = truth(scope.expand(element.attrib[given[0]]), f"'{given[0]}' of <{element.tag}>")
    return met == (given[0] == 'if')


def _read_arg(element: Element, scope: Scope, _reading: ReadState) -> None:
    name = attribute(element, 'name')
    if name not in scope.variables:
        if 'default' not in element.attrib:
            raise InvalidLaunch(f"argument '{name}' is required; give {name}:=VALUE")
        scope.variables[name] = scope.expand(element.attrib['default'])
    choices = [attribute(choice, 'value') for choice in element]
    if choices and scope.variables[name] not in choices:
        raise InvalidLaunch(f"argument '{name}' is '{scope.variables[name]}'; allowed is one of {', '.join(choices)}")


def _read_let(element: Element, scope: Scope, _reading: ReadState) -> None:
    scope.variables[scope.expand(attribute(element, 'name'))] = scope.expand(attribute(element, 'value'))


def _read_set_env(element: Element, scope: Scope, _reading: ReadState) -> None:
    scope.environment[scope.expand(attribute(element, 'name'))] = scope.expand(attribute(element, 'value'))


def _read_namespace(element: Element, scope: Scope, _reading: ReadState) -> None:
    scope.namespace = joined_namespace(scope.namespace, scope.expand(attribute(element, 'namespace'))) or '/'


def _read_group(element: Element, scope: Scope, reading: ReadState) -> None:
    scoped = truth(element.get('scoped', 'true'), "'scoped' of <group>")
    _read_children(element, scope.copy() if scoped else scope, reading)


def _read_include(element: Element, scope: Scope, reading: ReadState) -> None:
    path = Path(scope.expand(attribute(element, 'file')))
    known = {argument.name for argument in declared_arguments(path)}
    given = {}
    for item in element:
        check_form(item, 'arg of an include')
        name = scope.expand(attribute(item, 'name'))
        if name not in known:
            raise unknown_name(name, known, f'argument of {path.name}')
        given[name] = scope.expand(attribute(item, 'value'))
    scope.variables.update(given)
    _read_file(path, scope, reading)


def _read_node(element: Element, scope: Scope, reading: ReadState) -> None:
    reading.nodes.append(read_node(element, scope))


READERS: Mapping[str, Callable[[Element, Scope, ReadState], None]] = {
    'arg': _read_arg,
    'let': _read_let,
    'set_env': _read_set_env,
    'push_ros_namespace': _read_namespace,
    'push-ros-namespace': _read_namespace,
    'group': _read_group,
    'include': _read_include,
    'node': _read_node,
}

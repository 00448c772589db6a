# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Start the nodes of an XML launch file where the launcher of ROS 2 is missing."""

from __future__ import annotations

import contextlib
import math
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from texture_core.config import (
    PARSE_ERRORS,
    FileRefused,
    executable,
    find,
    find_file,
    folder,
    parse_yaml,
    prefix,
    read_bounded,
    ros_namespace,
    unknown_name,
    yaml_text,
)
from texture_core.errors import InvalidLaunch, LaunchFailed, TextureError, UnknownName

# --------------------
# A sub-command as a child process of another program, which watches and ends it.

ChildT = TypeVar('ChildT', bound='Child')
CAUSE = '[launch] the launch ended because '
STOP_DEADLINE_S = 30.0  # a launcher kills its nodes after 8 s, a recorder may be behind


def ending_with_parent(number: str, command_line: Iterable[str]) -> list[str]:
    """Return a command line whose process the kernel sends a signal when its parent, or that one's thread, has died.

    A parent that has died before the kernel was asked is no longer the parent of what looks for it.
    """
    if shutil.which('setpriv') is None:
        raise LaunchFailed("the program 'setpriv' is missing; install the package util-linux")
    look = 'test "$PPID" = "$1" && shift && exec "$@"'
    return ['setpriv', '--pdeathsig', number, 'sh', '-c', look, 'launch', str(os.getpid()), *command_line]


class Child:
    """Run a sub-command of `texture`; use it in a `with` block."""

    called = 'the command'

    def __init__(self, arguments: Sequence[str], environment: Mapping[str, str], log: Path) -> None:
        self.log = log
        self._command = ending_with_parent('INT', [sys.executable, '-m', 'texture_bringup.command', *arguments])
        self._environment = environment
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self: ChildT) -> ChildT:
        with self.log.open('wb') as log:
            self._process = subprocess.Popen(
                self._command,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,  # Ctrl-C reaches this program only, which then stops the child in order
            )
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    @property
    def end(self) -> str:
        """How the child has ended, with the cause if its last line is one; '' while it runs."""
        if self._process is None or (code := self._process.poll()) is None:
            return ''
        last = self.log.read_text(errors='replace').rstrip().rpartition('\n')[2]
        if last.startswith(CAUSE):
            return last.removeprefix('[launch] ')
        return f'{self.called} {ending(code)}{f": {last}" * bool(FAULT.match(last))}'

    def stop(self) -> None:
        """Stop the child and wait until nothing of it is left."""
        if self._process is None:
            return
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(STOP_DEADLINE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()  # nodes of a launcher end with it
            self._process.wait()


class ChildLauncher(Child):
    """Run `texture launch FILE …`, whose nodes end together."""

    called = 'the launch'

    def __init__(self, file: str, arguments: Mapping[str, object], environment: Mapping[str, str], log: Path) -> None:
        given = (f'{name}:={value}' for name, value in arguments.items())
        super().__init__(['launch', '--together', file, *given], environment, log)

    def check(self) -> None:
        """Raise LaunchFailed if the nodes have ended."""
        if self.end:
            raise LaunchFailed(f'{self.end}; the output of all nodes is in {self.log}')


# --------------------
# What a launch file describes, with all substitutions made.


@dataclass(frozen=True)
class NodeDescription:
    """One node to run.

    `namespace` is absolute, or '' where the file names none. Each item of `parameters` is a parameter file or a
    mapping of names to values; later ones override earlier ones. `origins` holds the texts of these values as the file
    has them, by name. `environment` is the whole environment of the process.
    """

    package: str
    executable: str
    name: str = ''
    namespace: str = ''
    parameters: tuple[Path | Mapping[str, Any], ...] = ()
    origins: Mapping[str, str] = field(default_factory=dict)
    remappings: tuple[tuple[str, str], ...] = ()
    respawn: bool = False
    respawn_delay_s: float = 0.0
    respawn_max_retries: int = -1  # below 0: as often as it dies
    needed: bool = False
    environment: Mapping[str, str] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Name of the node in the output: its full name as far as the file gives it."""
        return f'{self.namespace.lstrip("/")}/{self.name or self.executable}'.lstrip('/')

    @property
    def full_name(self) -> str:
        """Its name in ROS, for a node that bears the name of its program unless the file gives one."""
        return f'{self.namespace.rstrip("/")}/{self.name or self.executable}'

    @property
    def parameter_key(self) -> str:
        """The key of its parameters in a parameter file: its full name if known, else every node of the process."""
        return f'{self.namespace.rstrip("/")}/{self.name}' if self.name and self.namespace else '/**'


def command(node: NodeDescription, parameter_folder: Path) -> list[str]:
    """Return the command line of a node; parameters given in the launch file are written to `parameter_folder`."""
    options = [f'__node:={node.name}'] * bool(node.name) + [f'__ns:={node.namespace}'] * bool(node.namespace)
    options = [word for rule in options for word in ('-r', rule)]
    for index, parameters in enumerate(node.parameters):
        file = parameters if isinstance(parameters, Path) else parameter_folder / f'{index}.yaml'
        if not isinstance(parameters, Path):
            parameter_folder.mkdir(parents=True, exist_ok=True)
            file.write_text(yaml_text({node.parameter_key: {'ros__parameters': dict(parameters)}}))
        options += ['--params-file', str(file)]
    options += [word for source, target in node.remappings for word in ('-r', f'{source}:={target}')]
    return [str(executable(node.package, node.executable)), '--ros-args', *options]


# --------------------
# One node as a separate process group, which ends with the launcher.

# A line at WARN or above, the sentence of a user's error, the end of a traceback.
FAULT = re.compile(r'\[(WARN|ERROR|FATAL)\]|texture: |[\w.]+(Error|Exception): ')
CLOSE_S = 1.0  # for the last lines of a process that has ended; one that left the group may hold the pipe open


class RunningNode(subprocess.Popen[str]):
    """A running node, and a thread that shows the lines that it writes. Start it from the main thread."""

    def __init__(
        self,
        node: NodeDescription,
        command_line: Sequence[str],
        environment: Mapping[str, str],
        say: Callable[[str], None],
    ) -> None:
        self.node = node
        self.deaths = 0  # of processes of the same node before
        self.signals = 0  # stop signals sent so far
        self.fault = ''  # the last line that it wrote, if that is a warning or an error
        self._say = say
        self._ended_s = math.inf
        # Stop signals wait until a node of the suite handles them, see `texture_core.start`.
        held = ['env', '--block-signal=INT,TERM'] if node.package.startswith('texture_') else []
        super().__init__(
            ending_with_parent('TERM', [*held, *command_line]),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            # A pipe would hold the output of Python programs back until 8 KiB have come together.
            env={**environment, 'PYTHONUNBUFFERED': '1'},
            start_new_session=True,
            text=True,
            errors='replace',
        )
        say(f'[launch] {node.label} started (process {self.pid})')
        self._reader = threading.Thread(target=self._read, name=node.label, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.stdout is not None
        for line in self.stdout:
            self.fault = line.rstrip() if FAULT.match(line) else ''
            self._say(f'[{self.node.label}] {line.rstrip()}')

    def has_ended(self, now: float) -> bool:
        """Return whether it has ended and its last lines are shown; end what it has started itself."""
        if self.poll() is None:
            return False
        if self._ended_s == math.inf:
            self._ended_s = now
            self.send(signal.SIGKILL)
        return not self._reader.is_alive() or now - self._ended_s > CLOSE_S

    def close(self) -> None:
        """End it with what it has started itself, and show what is left."""
        self.send(signal.SIGKILL)
        self.wait()
        self._reader.join(CLOSE_S)

    def send(self, number: signal.Signals) -> None:
        """Send a signal to the whole group of the process; one that is gone is left alone."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, number)


def ending(returncode: int) -> str:
    """Return how a process ended, as text."""
    if returncode >= 0:
        return f'died with exit code {returncode}' if returncode else 'has finished'
    names = {number.value: number.name for number in signal.Signals}
    return f'was killed by {names.get(-returncode, f"signal {-returncode}")}'


EXPLORER = 'explorer'  # the program whose parameter files are for it alone
# One that was killed or failed lifts no finger.
MAY_PRESS = 'the finger may still press: look at the robot, and call `texture lift`'  # of one that runs again
PRESSES = 'the arm may continue to press: raise the finger by freedrive or pendant before you launch again'


# --------------------
# Run the nodes of a launch file: show their output, restart those that may be restarted, leave no process behind.

# How nodes are stopped: time after the request, s, and signal.
STOP = ((0.0, signal.SIGINT), (5.0, signal.SIGTERM), (8.0, signal.SIGKILL))
EMULATED = 'texture_simulation'  # package of the devices that are ended last: a finger may be lifted from them
STOPPING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
POLL_S = 0.1
PROFILES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')  # where Fast DDS looks for settings
MISTAKE = 2  # exit code of a node that has reported an invalid input
DISPENSABLE = ('dashboard', 'views')  # what was given to them wrongly stops no arm


class Supervisor:
    """Run nodes until all have ended or a stop is requested."""

    def __init__(self, nodes: Sequence[NodeDescription], say: Callable[[str], None], *, together: bool = False) -> None:
        self._nodes = nodes
        self._say = say
        self._together = together
        self._commands: dict[int, list[str]] = {}  # by the id of the node
        self._due: list[tuple[float, NodeDescription, int]] = []  # when to start which node, and how often it had died
        self._running: list[RunningNode] = []
        self._stopping_since_s: float | None = None
        self._code = 0
        self._cause = ''  # why the launch ends without a request

    def run(self) -> int:
        """Run the nodes to their end; return 0 if none died, 2 if a needed one reported an invalid input, else 1.

        SIGINT, SIGTERM and SIGHUP stop them; further ones change nothing, as an explorer needs its time to lift the
        finger. A node that had to be killed counts as one that died.
        """
        handlers = {number: signal.signal(number, lambda *_: self.stop()) for number in STOPPING_SIGNALS}
        with tempfile.TemporaryDirectory(prefix='texture_launch_') as folder:
            try:
                for index, node in enumerate(self._nodes):
                    self._commands[id(node)] = command(node, Path(folder) / str(index))
                self._due = [(0.0, node, 0) for node in self._nodes]
                while self._running or self._due:
                    self._step(time.monotonic())
                    time.sleep(POLL_S)
            finally:
                for process in self._running:  # what an error of the launcher itself has left
                    process.close()
                for number, handler in handlers.items():
                    signal.signal(number, handler)
        if self._cause:  # repeated, as nodes that are being stopped write many lines
            self._say(f'{CAUSE}{self._cause}')
        return self._code

    def stop(self) -> None:
        """Begin to stop all nodes, unless that has begun."""
        if self._stopping_since_s is None:
            self._stopping_since_s = time.monotonic()

    def _step(self, now: float) -> None:
        if self._stopping_since_s is not None:
            self._due.clear()
            self._send_signals(now - self._stopping_since_s)
        for when, node, deaths in list(self._due):
            if when <= now:
                self._due.remove((when, node, deaths))
                self._start(node, deaths)
        for process in list(self._running):
            if process.has_ended(now):
                self._end(process, process.returncode)

    def _start(self, node: NodeDescription, deaths: int) -> None:
        environment = dict(node.environment)
        if deaths and not any(environment.get(name) for name in PROFILES):
            # In the place of a dead node, with which the others still count, Fast DDS is to be discovered soon.
            environment[PROFILES[0]] = str(folder('texture_bringup', 'config/fastdds') / 'restart.xml')
        process = RunningNode(node, self._commands[id(node)], environment, self._say)
        process.deaths = deaths
        self._running.append(process)

    def _send_signals(self, since_s: float) -> None:
        due = sum(at_s <= since_s for at_s, _ in STOP)
        number = STOP[due - 1][1]
        users = [one for one in self._running if one.node.package != EMULATED]
        targets = [one for one in (users if users and due == 1 else self._running) if one.signals < due]
        if not targets:
            return
        self._say(f'[launch] {number.name} to {", ".join(one.node.label for one in targets)}')
        for process in targets:
            process.signals = due
            process.send(number)
        if number is signal.SIGKILL:
            self._code = 1
            self._say('[launch] nodes that did not end were killed; check whether the finger still presses')

    def _end(self, process: RunningNode, code: int) -> None:
        self._running.remove(process)
        node, stopping = process.node, self._stopping_since_s is not None
        # What was started wrongly would only end again.
        restart = node.respawn and code != MISTAKE and not (stopping or self._together)
        restart = restart and (node.respawn_max_retries < 0 or process.deaths < node.respawn_max_retries)
        needed = node.needed or node.respawn or (self._together and code != 0)
        needed = needed or (code == MISTAKE and node.executable not in DISPENSABLE)
        if code != 0 and not (stopping or restart):
            self._code = MISTAKE if code == MISTAKE and needed else 1
        pressing = f'; {MAY_PRESS if restart else PRESSES}' * (node.executable == EXPLORER and code not in (0, MISTAKE))
        self._say(f'[launch] {node.label} {ending(code)}{pressing}')
        if restart:
            self._due.append((time.monotonic() + node.respawn_delay_s, node, process.deaths + 1))
        elif needed and not stopping:
            self._say(f'[launch] {node.label} is required by the other nodes, which are stopped now')
            fault = f': {process.fault}' * bool(code > 0 and process.fault)  # what is killed gives no reason
            self._cause = f'{node.label} {ending(code)}{fault}{pressing}'
            self.stop()


# --------------------
# Texts with substitutions such as `$(var speed)`, as ROS 2 launch files write them.

# An innermost call: its name, and its arguments separated by one space; one with spaces is quoted.
CALL = re.compile(r"""\$\(([A-Za-z][\w-]*)((?: (?:"[^"$()]*"|'[^'$()]*'|[^\s"'$()]+))*)\)""")
VARIABLE = re.compile(r'\$\(var (\w+)\)')
PERFORMED = re.compile(r'\0(\d+)\0')
Perform = Callable[[str, Sequence[str]], str]


def expand(text: str, perform: Perform) -> str:
    """Return a text with its calls performed: `perform(name, arguments)` gives the text of each, innermost first."""
    done: list[str] = []  # results of calls; marks replace them, as nothing in them is a call or a quote

    def resolved(part: str) -> str:
        return PERFORMED.sub(lambda mark: done[int(mark[1])], part)

    def call(found: re.Match[str]) -> str:
        done.append(perform(found[1], [resolved(part) for part in shlex.split(found[2])]))
        return f'\0{len(done) - 1}\0'

    while (expanded := CALL.sub(call, text)) != text:
        text = expanded
    if '$(' in text:
        raise InvalidLaunch(
            f"'{resolved(text)}' holds no substitution; write $(name argument …), closed and with single spaces"
        )
    return resolved(text)


# --------------------
# The type of a parameter given as text: YAML's rules, as in ROS 2 launch files.

TRUTH = {'true': True, '1': True, 'false': False, '0': False}
SCALARS = (bool, int, float, str)


def _scalar(text: str) -> Any:
    """Return what YAML reads in a text; the text itself if it is no YAML."""
    try:
        value = parse_yaml(text) if text else text
    except PARSE_ERRORS:
        return text
    if not isinstance(value, SCALARS):
        raise ValueError(text)
    return value


# What reads a text, and what is allowed.
TYPES: Mapping[str, tuple[Callable[[str], Any], str]] = {
    'yaml': (_scalar, 'true or false, a number or a text'),
    'str': (str, 'a text'),
    'float': (float, 'a number'),
    'int': (int, 'a whole number'),
    'bool': (lambda text: TRUTH[text.strip().lower()], 'true, false, 1 or 0'),
}


def typed(text: str, type_name: str, where: str) -> Any:
    """Return a text as a value of a type.

    Quotes do not keep `'$(var x)'` a string, as upstream reads the text as YAML before and after the substitution:
    `type="str"` does.
    """
    read, allowed = find(TYPES, type_name, 'parameter type')
    try:
        return read(text)
    except (ValueError, KeyError) as error:
        raise InvalidLaunch(f"{where} is '{text}'; {allowed} is needed") from error


# --------------------
# Read an XML launch file: from its elements, in order, to its nodes.
#
# The elements and their attributes are a subset of upstream's (`ros2 launch`), with the same meaning: a `group` has a
# separate scope, an `include` has none, so the arguments given to it stay set behind it.

MAX_BYTES = 200_000  # of one file; the longest in use has 5 kB
MAX_INCLUDES = 20  # of files within each other
CONDITIONS = {'if': True, 'unless': False}
RESPAWN = {'respawn': 'false', 'respawn_delay': '0', 'respawn_max_retries': '-1'}
ELEMENTS = {tag: tag for tag in ('arg', 'let', 'set_env', 'push_ros_namespace', 'group', 'include', 'node')}
# The attributes of each element, and the kinds of its child elements by their tag.
ALLOWED: Mapping[str, tuple[Collection[str], Mapping[str, str]]] = {
    'launch': ((), ELEMENTS),
    'arg': (('name', 'default', 'description', *CONDITIONS), {'choice': 'choice'}),
    'choice': (('value',), {}),
    'arg of an include': (('name', 'value'), {}),
    'let': (('name', 'value', *CONDITIONS), {}),
    'set_env': (('name', 'value', *CONDITIONS), {}),
    'push_ros_namespace': (('namespace', *CONDITIONS), {}),
    'group': (CONDITIONS, ELEMENTS),
    'include': (('file', *CONDITIONS), {'arg': 'arg of an include'}),
    'node': (  # all output is shown
        ('pkg', 'exec', 'name', 'namespace', *RESPAWN, 'on_exit', 'output', *CONDITIONS),
        {'param': 'param', 'remap': 'remap'},
    ),
    'param': (('name', 'value', 'type', 'from'), {}),
    'remap': (('from', 'to'), {}),
}
# The fewest and the most arguments that a substitution takes.
SUBSTITUTIONS = {'var': (1, 1), 'env': (1, 2), 'find-pkg-share': (1, 1), 'not-equals': (2, 2)}


def find_launch_file(name_or_path: str) -> Path:
    """Return a launch file: a path, or the name of one that a package ships, such as 'emulator'."""
    return find_file(name_or_path, 'texture_bringup', 'launch', 'launch file', '.launch.xml')


def given_arguments(texts: Iterable[str]) -> dict[str, str]:
    """Return the launch arguments in texts of the form NAME:=VALUE."""
    given: dict[str, str] = {}
    for text in texts:
        name, mark, value = text.partition(':=')
        if not (name and mark):
            raise InvalidLaunch(f"argument '{text}' has no value; write NAME:=VALUE")
        if name in given:
            raise InvalidLaunch(f"'{name}' came twice, as '{given[name]}' and as '{value}'; give it once")
        given[name] = value
    return given


def read(path: Path, given: Mapping[str, str], environment: Mapping[str, str]) -> list[NodeDescription]:
    """Return the nodes of a launch file, in its order."""
    reader = _Reader(given, environment)
    reader.read_file(path)
    for name in given:
        if name not in reader.declared:
            error = unknown_name(name, reader.declared, f'argument of {path.name}')
            explorer = '. Parameters of the explorer are in the file of explorer_params:=FILE'
            raise UnknownName(f'{error}{explorer * ("explorer_params" in reader.declared)}')
    return reader.nodes


def joined_namespace(base: str, name: str) -> str:
    """Return an absolute namespace, `name` below `base` unless it is absolute itself; '' if both are ''."""
    joined = name if ros_namespace(name).startswith('/') or not (base or name) else f'{base}/{name}'
    return '/' + joined.strip('/') if joined else ''


def _root(path: Path) -> Element:
    """Return the <launch> element of a file."""
    try:
        root: Element = ElementTree.fromstring(read_bounded(path, MAX_BYTES))
    except OSError as error:
        raise InvalidLaunch(f"launch file '{path}' cannot be read: {error.strerror}") from error
    except FileRefused as error:
        raise InvalidLaunch(f"launch file '{path}' is not read: {error}") from error
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # the last two: of its encoding
        if path.suffix == '.py':
            raise InvalidLaunch(
                f"'{path}' is a launch file in Python, which `ros2 launch` runs; XML is needed"
            ) from error
        raise InvalidLaunch(f"launch file '{path}' is not well-formed XML: {error}") from error
    if root.tag != 'launch':
        raise InvalidLaunch(f"launch file '{path}' begins with <{root.tag}>; <launch> is needed")
    return root


def _declared(root: Element) -> dict[str, Element]:
    """Return the arguments that a file declares; an `arg` with a value, inside an include, gives one instead."""
    return {item.get('name', ''): item for item in root.iter('arg') if 'value' not in item.attrib}


def _check_form(element: Element, kind: str) -> None:
    attributes, children = ALLOWED[kind]
    for name in element.attrib:
        if name not in attributes:
            raise unknown_name(name, attributes, f'attribute of <{element.tag}>')
    for child in element:
        if child.tag not in children:
            raise unknown_name(child.tag, children, f'element inside <{element.tag}>')
        _check_form(child, children[child.tag])


class _Reader:
    """Read launch files: collects the nodes, and the names of all declared arguments.

    Variables, environment and namespace are those at the present place; elements change them for what follows.
    """

    def __init__(self, variables: Mapping[str, str], environment: Mapping[str, str]) -> None:
        self.nodes: list[NodeDescription] = []
        self.declared: set[str] = set()
        self._variables, self._environment, self._namespace = dict(variables), dict(environment), ''
        self._depth = 0

    def read_file(self, path: Path) -> None:
        """Read a file; its nodes join those of other files."""
        root = _root(path)
        if self._depth > MAX_INCLUDES:
            raise InvalidLaunch(f"'{path}' is included more than {MAX_INCLUDES} levels deep; does it include itself?")
        self._depth += 1
        # Also those behind a condition that is not met: to give one of them is no error.
        self.declared |= set(_declared(root))
        try:
            _check_form(root, 'launch')
            self._read_children(root)
        except TextureError as error:
            raise type(error)(f'{path.name}: {error}') from error
        self._depth -= 1

    def text(self, element: Element, name: str) -> str:
        """Return an attribute with its substitutions performed."""
        if name not in element.attrib:
            raise InvalidLaunch(f"<{element.tag}> has no attribute '{name}'; give it one")
        return expand(element.attrib[name], self._perform)

    def _perform(self, name: str, arguments: Sequence[str]) -> str:
        """Return the value of one substitution; UnknownName or InvalidLaunch if it has none."""
        fewest, most = find(SUBSTITUTIONS, name, 'substitution')
        if not fewest <= len(arguments) <= most:
            raise InvalidLaunch(
                f'$({" ".join([name, *arguments])}) has {len(arguments)} arguments; {fewest} to {most} are needed'
            )
        first, *rest = arguments
        if name == 'find-pkg-share':
            return str(prefix(first) / 'share' / first)
        if name == 'not-equals':
            return 'true' if first != rest[0] else 'false'
        known = self._variables if name == 'var' else self._environment
        if first in known:
            return known[first]
        if rest:
            return rest[0]
        if name == 'var':
            raise unknown_name(first, known, 'launch variable')
        raise InvalidLaunch(
            f"environment variable '{first}' is not set; set it, or give a default: $(env {first} DEFAULT)"
        )

    def _read_children(self, parent: Element) -> None:
        for element in parent:
            met = []
            for name in (name for name in CONDITIONS if name in element.attrib):
                given = VARIABLE.fullmatch(element.attrib[name])
                where = f"argument '{given[1]}'" if given else f"'{name}' of <{element.tag}>"
                met.append(typed(self.text(element, name), 'bool', where) is CONDITIONS[name])
            if all(met):
                getattr(self, f'_read_{element.tag}')(element)
            elif element.tag == 'include':
                with contextlib.suppress(TextureError):
                    self.declared |= set(_declared(_root(Path(self.text(element, 'file')))))

    def _read_arg(self, element: Element) -> None:
        name = self.text(element, 'name')
        if name not in self._variables:
            if 'default' not in element.attrib:
                about = f' ({element.get("description", "").rstrip(".")})' * ('description' in element.attrib)
                raise InvalidLaunch(f"argument '{name}' is required{about}; give {name}:=VALUE")
            self._variables[name] = self.text(element, 'default')
        value, choices = self._variables[name], [self.text(choice, 'value') for choice in element]
        if choices and value not in choices:
            raise InvalidLaunch(f"argument '{name}' is '{value}'; allowed is one of {', '.join(choices)}")

    def _read_let(self, element: Element) -> None:
        self._variables[self.text(element, 'name')] = self.text(element, 'value')

    def _read_set_env(self, element: Element) -> None:
        self._environment[self.text(element, 'name')] = self.text(element, 'value')

    def _read_push_ros_namespace(self, element: Element) -> None:
        self._namespace = joined_namespace(self._namespace, self.text(element, 'namespace')) or '/'

    def _read_group(self, element: Element) -> None:
        before = dict(self._variables), dict(self._environment), self._namespace
        self._read_children(element)
        self._variables, self._environment, self._namespace = before

    def _read_include(self, element: Element) -> None:
        path = Path(self.text(element, 'file'))
        given = {self.text(item, 'name'): self.text(item, 'value') for item in element}
        others, self.declared = self.declared, set()
        self._variables.update(given)
        self.read_file(path)
        for name in given:
            if name not in self.declared:  # by this file or by one that it includes
                raise unknown_name(name, self.declared, f'argument of {path.name}')
        self.declared |= others

    def _read_node(self, element: Element) -> None:
        texts = {name: self.text(element, name) for name in element.attrib}
        if (on_exit := texts.get('on_exit', 'shutdown')) != 'shutdown':
            raise InvalidLaunch(f"'on_exit' of <node> is '{on_exit}'; allowed is shutdown")
        namespace = joined_namespace(self._namespace, texts.get('namespace', ''))
        types = ('bool', 'float', 'int')
        respawn, delay_s, retries = (
            typed(texts.get(name, usual), kind, f"'{name}' of <node>")
            for (name, usual), kind in zip(RESPAWN.items(), types, strict=True)
        )
        self.nodes.append(
            NodeDescription(
                package=self.text(element, 'pkg'),
                executable=self.text(element, 'exec'),
                name=texts.get('name', ''),
                namespace=namespace or '/' * ('namespace' in texts),
                parameters=tuple(self._parameter(item) for item in element.findall('param')),
                origins={item.get('name', ''): item.get('value', '') for item in element.findall('param')},
                remappings=tuple((self.text(item, 'from'), self.text(item, 'to')) for item in element.findall('remap')),
                respawn=respawn,
                respawn_delay_s=delay_s,
                respawn_max_retries=retries,
                needed='on_exit' in texts,
                environment=dict(self._environment),
            )
        )

    def _parameter(self, element: Element) -> Path | dict[str, Any]:
        """Return a parameter file, or a name with its value."""
        if 'from' not in element.attrib:
            name, kind = self.text(element, 'name'), element.get('type', 'yaml')
            return {name: typed(self.text(element, 'value'), kind, f"the value of <param name='{name}'>")}
        path = Path(self.text(element, 'from'))
        if path == Path():
            raise InvalidLaunch(f'{element.get("from")} is empty; give the path of a parameter file, or leave it out')
        if 'name' in element.attrib:
            raise InvalidLaunch(f"<param from='{path}'> also has a name; the file holds the names")
        if not path.is_file():
            if path.parts[-4:-1] == ('texture_bringup', 'config', 'robots'):
                raise unknown_name(path.stem, [item.stem for item in path.parent.glob('*.yaml')], 'preset')
            fault = f"'{path}' is a folder" if path.is_dir() else f"there is no parameter file '{path}'"
            raise InvalidLaunch(f'{fault}; give the path of a parameter file')
        return path

# SPDX-License-Identifier: Apache-2.0
"""Start the nodes of an XML launch file where ROS 2's own launcher is missing."""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import math
import os
import re
import selectors
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from subprocess import Popen
from typing import IO, Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import yaml

from texture_core import config
from texture_core.config import PARSE_ERRORS, FileRefused, find, parse_yaml, read_bounded, unknown_name
from texture_core.errors import InvalidLaunch, LaunchFailed, TextureError

# --------------------
# Read an XML file.

MAX_BYTES = 200_000  # of one file; the longest in use has 5 kB


def parse_launch_file(path: Path) -> Element:
    """Return the <launch> element of a file.

    Raises
    ------
    InvalidLaunch
        If the file cannot be read, is too large or is no launch file.
    """
    try:
        content = read_bounded(path, MAX_BYTES)
        root: Element = ElementTree.fromstring(content)
    except OSError as error:
        raise InvalidLaunch(f"launch file '{path}' cannot be read: {error.strerror}") from error
    except FileRefused as error:
        raise InvalidLaunch(f"launch file '{path}' is not read: {error}") from error
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # the last two: of its encoding
        raise InvalidLaunch(f"launch file '{path}' is not well-formed XML: {error}") from error
    if root.tag != 'launch':
        raise InvalidLaunch(f"launch file '{path}' begins with <{root.tag}>; <launch> is needed")
    return root


# --------------------
# A launcher as a child of another program, which watches and ends it.

DEATH = re.compile(r'\[launch\] .* (died with|was killed by) .*')
STOP_DEADLINE_S = 15.0  # the launcher itself kills after 8 s


class ChildLauncher:
    """Run `texture launch FILE …` beside this program; use it in a `with` block.

    Parameters
    ----------
    file
        Path or name of the launch file.
    arguments
        Launch arguments.
    environment
        Environment of the nodes.
    log
        File for everything the nodes say.
    together
        Whether the launch ends when one node dies, even if the launch file would start it again.
    """

    def __init__(
        self,
        file: str,
        arguments: Mapping[str, object],
        environment: Mapping[str, str],
        log: Path,
        *,
        together: bool = True,
    ) -> None:
        self.log = log
        self._options = ['--parent', str(os.getpid()), *['--together'] * together]
        self._given = [f'{name}:={value}' for name, value in arguments.items()]
        self._file = file
        self._environment = environment
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> ChildLauncher:
        command = [sys.executable, '-m', 'texture_bringup.commands.launch', *self._options]
        with self.log.open('wb') as log:
            self._process = subprocess.Popen(
                [*command, self._file, *self._given],
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,  # Ctrl-C reaches this program, which then stops the nodes in its own order
            )
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def check(self) -> None:
        """Raise LaunchFailed, with what the log says, if the nodes have ended.

        Raises
        ------
        LaunchFailed
            If they have.
        """
        if self._process is not None and self._process.poll() is not None:
            raise LaunchFailed(f'{self._reason()}; everything the nodes said is in {self.log}')

    def wait(self, deadline_s: float) -> int:
        """Wait until the nodes have ended by themselves; return the exit code of the launcher."""
        assert self._process is not None
        return self._process.wait(deadline_s)

    def stop(self) -> None:
        """Stop the nodes and wait until none is left."""
        if self._process is None:
            return
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(STOP_DEADLINE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()  # its nodes end with it
            self._process.wait()

    def _reason(self) -> str:
        """Return the sentence of the log that names what went wrong: a node that died, else the last line."""
        lines = self.log.read_text(errors='replace').splitlines()
        deaths = [line.removeprefix('[launch] ') for line in lines if DEATH.fullmatch(line)]
        last = lines[-1] if lines else 'the launcher ended without a word'
        return f'node {deaths[0]}' if deaths else last


# --------------------
# What a launch file asks for, with everything substituted.


@dataclass(frozen=True)
class Argument:
    """An argument that a launch file declares; `default` None makes it required."""

    name: str
    default: str | None
    description: str


@dataclass(frozen=True)
class NodeDescription:
    """One node to run.

    `namespace` is absolute, or '' where the file names none. Each item of `parameters` is a parameter file or a
    mapping of names to values; later ones override earlier ones. `environment` is the whole environment of the process.
    """

    package: str
    executable: str
    name: str = ''
    namespace: str = ''
    arguments: tuple[str, ...] = ()
    parameters: tuple[Path | Mapping[str, Any], ...] = ()
    remappings: tuple[tuple[str, str], ...] = ()
    screen: bool = False
    respawn: bool = False
    respawn_delay_s: float = 0.0
    needed: bool = False
    environment: Mapping[str, str] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """How the node is called in the output: its full name as far as the file gives it."""
        name = self.name or self.executable
        return f'{self.namespace.lstrip("/")}/{name}'.lstrip('/')

    @property
    def parameter_key(self) -> str:
        """The key of its parameters in a parameter file: its full name if known, else every node of the process."""
        if not (self.name and self.namespace):
            return '/**'
        return f'{self.namespace.rstrip("/")}/{self.name}'


# --------------------
# The elements of a launch file: which attributes and children they may have, and how these are read.

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


# --------------------
# Find the launch file that a user means.

SUFFIX = '.launch.xml'


def find_launch_file(name_or_path: str) -> Path:
    """Return a launch file: a path, or the name of one of this package, such as 'emulator' or 'emulator.launch.xml'.

    Raises
    ------
    UnknownName
        If there is neither, with the nearest name.
    """
    path = Path(name_or_path).expanduser()
    if path.is_file():
        return path
    shipped = {
        item.name.removesuffix(SUFFIX): item for item in config.folder('texture_bringup', 'launch').glob(f'*{SUFFIX}')
    }
    name = name_or_path.removesuffix(SUFFIX)
    if name not in shipped:
        raise unknown_name(name, shipped, 'launch file')
    return shipped[name]


def given_arguments(texts: Iterable[str]) -> dict[str, str]:
    """Return the launch arguments in texts of the form NAME:=VALUE; the last one of a name counts.

    Raises
    ------
    InvalidLaunch
        If a text has no ':='.
    """
    given = {}
    for text in texts:
        name, mark, value = text.partition(':=')
        if not (name and mark):
            raise InvalidLaunch(f"argument '{text}' has no value; write NAME:=VALUE")
        given[name] = value
    return given


# --------------------
# What a process writes, shown line by line.

CHUNK = 65536


class Output:
    """One stream of a process; `say` receives each line with the label in front."""

    def __init__(self, stream: IO[bytes], label: str, say: Callable[[str], None]) -> None:
        self.stream = stream
        self._label = label
        self._say = say
        self._rest = b''
        os.set_blocking(stream.fileno(), False)

    def read(self) -> bool:
        """Show the lines that have arrived; return whether anything had."""
        try:
            data = os.read(self.stream.fileno(), CHUNK)
        except BlockingIOError:
            return False
        *lines, self._rest = (self._rest + data).split(b'\n')
        self._show(lines)
        return bool(data)

    def close(self) -> None:
        """Show what is left, also of an unfinished line, and close the stream."""
        while self.read():
            pass
        self._show([self._rest] if self._rest else [])
        self.stream.close()

    def _show(self, lines: list[bytes]) -> None:
        for line in lines:
            self._say(f'[{self._label}] {line.decode(errors="replace").rstrip()}')


# --------------------
# Find ROS packages and their executables over AMENT_PREFIX_PATH.

INDEX = Path('share') / 'ament_index' / 'resource_index' / 'packages'


def prefix(package: str) -> Path:
    """Return the first prefix that holds a package.

    Raises
    ------
    UnknownName
        If none does, with the nearest package.
    """
    for candidate in _prefixes():
        if (candidate / INDEX / package).exists():
            return candidate
    installed = {item.name for place in _prefixes() for item in (place / INDEX).glob('*')}
    raise unknown_name(package, installed, 'package')


def share(package: str) -> Path:
    """Return the share folder of a package."""
    return prefix(package) / 'share' / package


def executable(package: str, name: str) -> Path:
    """Return the path of an executable of a package.

    Raises
    ------
    UnknownName
        If there is none, with the nearest of the package.
    """
    folder = prefix(package) / 'lib' / package
    path = folder / name
    if not (path.is_file() and os.access(path, os.X_OK)):
        raise unknown_name(name, {item.name for item in folder.glob('*')}, f"executable of package '{package}'")
    return path


def _prefixes() -> list[Path]:
    return [Path(item) for item in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if item]


# --------------------
# One node as a process of its own group, which ends with the launcher.

PR_SET_PDEATHSIG = 1  # linux/prctl.h
LIBC = ctypes.CDLL(None)


def command(node: NodeDescription, parameter_folder: Path) -> list[str]:
    """Return the command line of a node; parameters given in the launch file are written to `parameter_folder`."""
    names = [f'__node:={node.name}'] * bool(node.name) + [f'__ns:={node.namespace}'] * bool(node.namespace)
    options = [part for rule in names for part in ('-r', rule)]
    for index, parameters in enumerate(node.parameters):
        file = parameters if isinstance(parameters, Path) else parameter_folder / f'{index}.yaml'
        if not isinstance(parameters, Path):
            _write_parameters(file, node.parameter_key, parameters)
        options += ['--params-file', str(file)]
    for source, target in node.remappings:
        options += ['-r', f'{source}:={target}']
    return [str(executable(node.package, node.executable)), *node.arguments, '--ros-args', *options]


def _write_parameters(file: Path, key: str, parameters: Mapping[str, Any]) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(yaml.safe_dump({key: {'ros__parameters': dict(parameters)}}))


def start(command_line: Sequence[str], environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    """Start a process in a session of its own; the kernel sends it SIGTERM if the calling thread dies, however it dies.

    Call it from the main thread of a program without other threads.

    Raises
    ------
    LaunchFailed
        If the system refuses to start it.
    """
    try:
        return _popen(command_line, environment)
    except OSError as error:
        raise LaunchFailed(f"'{command_line[0]}' cannot be started: {error.strerror}") from error


def _popen(command_line: Sequence[str], environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        command_line,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        # A pipe would hold the output of Python programs back until 8 KiB have come together.
        env={**environment, 'PYTHONUNBUFFERED': '1'},
        preexec_fn=partial(end_with, os.getpid(), signal.SIGTERM),  # noqa: PLW1509 - the launcher is a program without threads
        start_new_session=True,
    )


def end_with(parent: int, number: signal.Signals) -> None:
    """Let the kernel send this process a signal when its parent dies, however it dies."""
    if hasattr(LIBC, 'prctl'):
        LIBC.prctl(PR_SET_PDEATHSIG, number)
    if os.getppid() != parent:  # it died before the wish was made
        os._exit(1)


def send(process: subprocess.Popen[bytes], number: signal.Signals) -> None:
    """Send a signal to the whole group of a process; one that is gone is left alone."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, number)


def interrupt(process: subprocess.Popen[bytes]) -> None:
    """Ask a process and its group to end: by SIGINT, or by SIGTERM while it cannot answer to a signal yet.

    A Python program that is still importing would only print a traceback on SIGINT. It has its own handlers for SIGINT
    and SIGTERM once it runs, and none for SIGTERM before.
    """
    send(process, signal.SIGINT if _catches(process.pid, signal.SIGTERM) else signal.SIGTERM)


def _catches(pid: int, number: signal.Signals) -> bool:
    """Return whether a process has a handler for a signal; True where that cannot be found out."""
    try:
        status = Path(f'/proc/{pid}/status').read_text(encoding='ascii', errors='replace')
    except OSError:
        return True
    caught = next((line.split()[1] for line in status.splitlines() if line.startswith('SigCgt:')), 'f' * 16)
    return bool(int(caught, 16) >> (number - 1) & 1)


def pipe(stream: IO[bytes] | None) -> IO[bytes]:
    """Return a stream of a process that `start` has given a pipe."""
    assert stream is not None
    return stream


def ending(returncode: int) -> str:
    """Return how a process ended, in words."""
    if returncode >= 0:
        return f'died with exit code {returncode}' if returncode else 'has finished'
    try:
        return f'was killed by {signal.Signals(-returncode).name}'
    except ValueError:
        return f'was killed by signal {-returncode}'


# --------------------
# Run the nodes of a launch file together: show what they say, restart what may be restarted, leave nothing behind.

# How nodes are asked to end: so many seconds after the wish, this signal.
STOP = ((0.0, signal.SIGINT), (5.0, signal.SIGTERM), (8.0, signal.SIGKILL))
STOPPING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
POLL_S = 0.1
PROFILES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')  # where Fast DDS looks for settings
MISTAKE = 2  # exit code of a node that was given something it cannot use, and said so


@dataclass(frozen=True, eq=False)
class Job:
    """A node with its command line."""

    node: NodeDescription
    command: Sequence[str]
    again: bool = False  # it has died before

    @property
    def environment(self) -> Mapping[str, str]:
        """The environment of its process; in the place of a dead one, Fast DDS has settings to be discovered soon."""
        given = self.node.environment
        if not self.again or any(given.get(name) for name in PROFILES):
            return given
        return {**given, PROFILES[0]: str(config.folder('texture_bringup', 'config/fastdds') / 'restart.xml')}


@dataclass(frozen=True, eq=False)
class Running:
    """A job that has been started."""

    job: Job
    process: Popen[bytes]
    outputs: tuple[Output, ...]

    @property
    def label(self) -> str:
        """How the node is called in the output."""
        return self.job.node.label


class Supervisor:
    """Run nodes until all have ended or a stop is asked for.

    Parameters
    ----------
    nodes
        What to run.
    say
        Receives each line to show, without its line end.
    together
        Whether all are stopped when one dies, whatever the launch file says about it, and none is started again.
    """

    def __init__(self, nodes: Sequence[NodeDescription], say: Callable[[str], None], *, together: bool = False) -> None:
        self._nodes = nodes
        self._say = say
        self._together = together
        self._due: list[tuple[float, Job]] = []  # when to start it
        self._running: list[Running] = []
        self._selector = selectors.DefaultSelector()
        self._stopping_since_s: float | None = None
        self._signals_sent = 0
        self._failed = False

    def run(self) -> int:
        """Run the nodes to their end; return 0 if none died by itself, else 1.

        SIGINT, SIGTERM and SIGHUP stop them; a second one goes on to the next stronger signal at once.
        """
        handlers = {number: signal.signal(number, self._on_signal) for number in STOPPING_SIGNALS}
        with tempfile.TemporaryDirectory(prefix='texture_launch_') as folder:
            try:
                jobs = [Job(node, command(node, Path(folder) / str(i))) for i, node in enumerate(self._nodes)]
                self._due = [(0.0, job) for job in jobs]
                while self._running or self._due:
                    self._step(time.monotonic())
            finally:
                self._kill_all()
                for number, handler in handlers.items():
                    signal.signal(number, handler)
        return int(self._failed)

    def stop(self) -> None:
        """Begin to stop all nodes, or, if that has begun, go on to the next stronger signal."""
        now = time.monotonic()
        if self._stopping_since_s is None:
            self._stopping_since_s = now
        elif self._signals_sent < len(STOP):
            self._stopping_since_s = now - STOP[self._signals_sent][0]

    def _on_signal(self, _number: int, _frame: object) -> None:
        self.stop()

    def _step(self, now: float) -> None:
        if self._stopping_since_s is not None:
            self._due.clear()
            self._send_signals(now - self._stopping_since_s)
        for when, job in list(self._due):
            if when <= now:
                self._due.remove((when, job))
                self._start(job)
        for key, _ in self._selector.select(POLL_S):
            if not key.data.read():  # the end of the stream: it would stay readable for ever
                self._selector.unregister(key.fileobj)
        for running in list(self._running):
            if running.process.poll() is not None:
                self._end(running)

    def _start(self, job: Job) -> None:
        started = start(job.command, job.environment)
        # As upstream: without output="screen", what a node prints is not shown, only its log and error messages.
        printed = self._say if job.node.screen else _nowhere
        label = job.node.label
        outputs = (
            Output(pipe(started.stdout), label, printed),
            Output(pipe(started.stderr), label, self._say),
        )
        for output in outputs:
            self._selector.register(output.stream, selectors.EVENT_READ, output)
        self._running.append(Running(job, started, outputs))
        self._say(f'[launch] {label} started (process {started.pid})')

    def _send_signals(self, since_s: float) -> None:
        while self._signals_sent < len(STOP) and STOP[self._signals_sent][0] <= since_s:
            number = STOP[self._signals_sent][1]
            self._signals_sent += 1
            if self._running:
                self._say(f'[launch] {number.name} to {", ".join(running.label for running in self._running)}')
            for running in self._running:
                if number == signal.SIGINT:
                    interrupt(running.process)
                else:
                    send(running.process, number)

    def _end(self, running: Running) -> None:
        self._forget(running)
        node, returncode = running.job.node, running.process.returncode
        requested_for = self._stopping_since_s is not None
        # What was started wrongly would only end again.
        restart = node.respawn and returncode != MISTAKE and not (requested_for or self._together)
        needed = node.needed or node.respawn or (self._together and returncode != 0)
        self._failed |= returncode != 0 and not (requested_for or restart)
        self._say(f'[launch] {running.label} {ending(returncode)}')
        if restart:
            self._due.append((time.monotonic() + node.respawn_delay_s, replace(running.job, again=True)))
        elif needed and not requested_for:
            self._say(f'[launch] {running.label} is needed by the others, which are stopped now')
            self.stop()

    def _forget(self, running: Running) -> None:
        self._running.remove(running)
        send(running.process, signal.SIGKILL)  # what it had started itself
        for output in running.outputs:
            if output.stream.fileno() in self._selector.get_map():
                self._selector.unregister(output.stream)
            output.close()

    def _kill_all(self) -> None:
        """End what an error of the launcher itself has left."""
        for running in list(self._running):
            send(running.process, signal.SIGKILL)
            running.process.wait()
            self._forget(running)
        self._selector.close()


def _nowhere(_line: str) -> None:
    pass


# --------------------
# Texts with substitutions such as `$(var speed)`, as ROS 2 launch files write them.

NAME = re.compile(r'[A-Za-z][\w-]*')


@dataclass(frozen=True)
class Call:
    """One substitution: `$(name argument …)`; each argument is a template of its own."""

    name: str
    arguments: tuple[Template, ...]


Part = str | Call
Template = tuple[Part, ...]
Perform = Callable[[str, Sequence[str]], str]


def parse(text: str) -> Template:
    """Return the parts of a text in order: literal strings and calls.

    A backslash takes the next character literally. Inside a call, arguments stand one space apart; an argument with
    spaces is quoted.

    Raises
    ------
    InvalidLaunch
        If a call is not closed or not well formed.
    """
    return _Reader(text).template(stop='')


def expand(template: Template, perform: Perform) -> str:
    """Return the text of a template; `perform(name, arguments)` gives the text of a call, innermost first."""
    return ''.join(
        part
        if isinstance(part, str)
        else perform(part.name, [expand(argument, perform) for argument in part.arguments])
        for part in template
    )


class _Reader:
    """Read a text from left to right."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._at = 0

    def template(self, stop: str) -> Template:
        """Return the parts up to the end or the first plain character of `stop`."""
        parts: list[Part] = []
        while self._at < len(self._text) and self._text[self._at] not in (*stop,):
            if self._text.startswith('$(', self._at):
                parts.append(self._call())
            elif parts and isinstance(parts[-1], str):
                parts[-1] += self._character()
            else:
                parts.append(self._character())
        return tuple(parts)

    def _character(self) -> str:
        if self._text[self._at] == '\\' and self._at + 1 < len(self._text):
            self._at += 1
        self._at += 1
        return self._text[self._at - 1]

    def _call(self) -> Call:
        start = self._at
        self._at += len('$(')
        name = NAME.match(self._text, self._at)
        if not name:
            raise self._malformed(start)
        self._at = name.end()
        arguments = []
        while self._text.startswith(' ', self._at):
            self._at += 1
            arguments.append(self._argument(start))
        if not self._text.startswith(')', self._at):
            raise self._malformed(start)
        self._at += 1
        return Call(name.group(), tuple(arguments))

    def _argument(self, start: int) -> Template:
        quote = self._text[self._at : self._at + 1]
        if quote in ("'", '"') and quote:
            self._at += 1
            argument = self.template(stop=quote)
            if not self._text.startswith(quote, self._at):
                raise self._malformed(start)
            self._at += 1
            return argument
        argument = self.template(stop=' )')
        if not argument:
            raise self._malformed(start)
        return argument

    def _malformed(self, start: int) -> InvalidLaunch:
        return InvalidLaunch(
            f"'{self._text[start:]}' is no substitution; write $(name argument …), closed and with single spaces"
        )


# --------------------
# What a launch file can refer to at one place: variables, environment, namespace, packages.


@dataclass
class Scope:
    """Variables, environment and namespace; elements change them for what follows in the same scope."""

    variables: dict[str, str]
    environment: dict[str, str]
    namespace: str = ''

    def copy(self) -> Scope:
        """Return a scope whose changes do not reach this one."""
        return dataclasses.replace(self, variables=dict(self.variables), environment=dict(self.environment))

    def expand(self, text: str) -> str:
        """Return a text with its substitutions performed."""
        return expand(parse(text), self.perform)

    def perform(self, name: str, arguments: Sequence[str]) -> str:
        """Return what one substitution stands for.

        Raises
        ------
        UnknownName, InvalidLaunch
            If there is no such substitution, variable or package, or the number of arguments is wrong.
        """
        substitution = find(SUBSTITUTIONS, name, 'substitution')
        if not substitution.fewest <= len(arguments) <= substitution.most:
            raise InvalidLaunch(
                f'$({" ".join([name, *arguments])}) has {len(arguments)} arguments; '
                f'{substitution.fewest} to {substitution.most} are needed'
            )
        return substitution.perform(self, arguments)


def _variable(scope: Scope, arguments: Sequence[str]) -> str:
    name, *default = arguments
    if name not in scope.variables and not default:
        raise unknown_name(name, scope.variables, 'launch variable')
    return scope.variables.get(name, *default)


def _environment(scope: Scope, arguments: Sequence[str]) -> str:
    name, *default = arguments
    if name not in scope.environment and not default:
        raise InvalidLaunch(
            f"environment variable '{name}' is not set; set it, or give a default: $(env {name} DEFAULT)"
        )
    return scope.environment.get(name, *default)


def _find_share(_scope: Scope, arguments: Sequence[str]) -> str:
    return str(share(arguments[0]))


def _not_equals(_scope: Scope, arguments: Sequence[str]) -> str:
    left, right = arguments
    return 'true' if left != right else 'false'


@dataclass(frozen=True)
class Substitution:
    """How a call is performed, and how many arguments it takes."""

    perform: Callable[[Scope, Sequence[str]], str]
    fewest: int
    most: int


SUBSTITUTIONS: Mapping[str, Substitution] = {
    'var': Substitution(_variable, 1, 2),
    'env': Substitution(_environment, 1, 2),
    'find-pkg-share': Substitution(_find_share, 1, 1),
    'not-equals': Substitution(_not_equals, 2, 2),
}


# --------------------
# The type of a parameter given as text: YAML's rules, as in ROS 2 launch files.

SCALARS = (bool, int, float, str)
# The `type` attribute of a param; (type, whether a list of it); None lets YAML decide.
TYPES: Mapping[str, tuple[type | None, bool]] = {
    'str': (str, False),
    'bool': (bool, False),
    'int': (int, False),
    'float': (float, False),
    'list_of_str': (str, True),
    'list_of_bool': (bool, True),
    'list_of_int': (int, True),
    'list_of_float': (float, True),
    'yaml': (None, False),
}
BOOLEANS = {'1': True, '0': False, 'true': True, 'false': False}


def parameter_value(text: str, type_name: str, expand: Callable[[str], str]) -> Any:
    """Return the value of a parameter: bool, int, float, str or a list of one of them.

    Upstream reads the text as YAML first and performs substitutions afterwards, in what is a string then; the result
    is read as YAML again. So quotes do not keep `'$(var x)'` a string: `type="str"` does.

    Parameters
    ----------
    text
        Value as it stands in the launch file.
    type_name
        Content of the attribute `type`; '' lets the text decide.
    expand
        Performs the substitutions in a text.

    Returns
    -------
    bool, int, float, str or a list of one of them

    Raises
    ------
    InvalidLaunch
        If the text is no value of the type.
    """
    kind, is_list = find(TYPES, type_name, 'parameter type')
    value = _list(text, kind) if is_list else _scalar(text, kind, has_calls(text))
    if isinstance(value, list):
        return _uniform([_performed(item, kind, expand) for item in value], text)
    return _performed(value, kind, expand)


def has_calls(text: str) -> bool:
    """Return whether a text holds a substitution."""
    return any(isinstance(part, Call) for part in parse(text))


def _performed(value: Any, kind: type | None, expand: Callable[[str], str]) -> Any:
    if not isinstance(value, str):
        return value
    return _scalar(expand(value), kind, pending=False) if has_calls(value) else expand(value)


def _scalar(text: str, kind: type | None, pending: bool) -> Any:
    """Return the value of a text; one with substitutions still to perform (`pending`) may stay a string."""
    if kind is str or not text:
        return text
    try:
        return CONVERT[kind](text)
    except PARSE_ERRORS as error:
        if pending or (kind is None and isinstance(error, yaml.YAMLError)):
            return text
        wanted = kind.__name__ if kind else 'bool, int, float, str or a list of one of them'
        raise InvalidLaunch(f"parameter value '{text}' is no {wanted}; change it, or the param's type") from error


def _boolean(text: str) -> bool:
    value = parse_yaml(text) if text not in BOOLEANS else BOOLEANS[text]
    if not isinstance(value, bool):
        raise ValueError(text)
    return value


def _by_yaml(text: str) -> Any:
    value = parse_yaml(text)
    if not isinstance(value, (*SCALARS, list)):
        raise ValueError(text)
    return value


CONVERT: Mapping[type | None, Callable[[str], Any]] = {int: int, float: float, bool: _boolean, None: _by_yaml}


def _list(text: str, kind: type | None) -> list[Any]:
    try:
        value = parse_yaml(text)
    except PARSE_ERRORS as error:
        raise InvalidLaunch(f"parameter value '{text}' is no list in YAML: {error}") from error
    if not isinstance(value, list) or not all(isinstance(item, (str, kind or str)) for item in value):
        raise InvalidLaunch(f"parameter value '{text}' is no list of {kind.__name__ if kind else 'values'}")
    return value


def _uniform(items: list[Any], text: str) -> list[Any]:
    if len({type(item) for item in items}) > 1 or not all(isinstance(item, SCALARS) for item in items):
        raise InvalidLaunch(
            f"parameter value '{text}' is a list of several types; give one bool, int, float or str throughout"
        )
    return items


# --------------------
# Read a `node` element with its params and remaps.

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
    parts = parse(text)
    values = {f'\0{index}\0': part for index, part in enumerate(parts) if isinstance(part, Call)}
    marked = ''.join(part if isinstance(part, str) else f'\0{index}\0' for index, part in enumerate(parts))
    try:
        words = shlex.split(marked)
    except ValueError as error:
        raise InvalidLaunch(f"'args' of <node> is '{text}', whose quotes are not closed") from error
    for mark, call in values.items():
        value = expand((call,), scope.perform)
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


# --------------------
# Read an XML launch file: from its elements, in order, to the nodes it asks for.
#
# The elements and their attributes are a subset of upstream's (`ros2 launch`), with the same meaning: a `group` is a
# scope of its own, an `include` is not, so the arguments given to it stay set behind it.

MAX_INCLUDES = 20  # of files within each other


@dataclass
class ReadState:
    """What has been read so far: nodes, names of all declared arguments, and the files being read."""

    nodes: list[NodeDescription] = field(default_factory=list)
    declared: set[str] = field(default_factory=set)
    files: list[Path] = field(default_factory=list)


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

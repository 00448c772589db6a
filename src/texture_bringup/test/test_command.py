# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import os
import re
import signal
import subprocess
import sys
from pathlib import Path
from unittest.mock import MagicMock

import pytest
from rcl_interfaces.msg import ParameterType
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from std_srvs.srv import Trigger

from texture_bringup import operator as operators
from texture_bringup.command import installed, main, summary
from texture_core.errors import TextureError
from texture_core.ros_testing import LocalGraph

pytestmark = pytest.mark.ros  # some sub-commands are nodes


def test_without_a_sub_command_the_help_is_printed(capsys) -> None:
    assert main([]) == 0
    shown = capsys.readouterr().out
    assert all(f'  {name} ' in shown and summary(command) in shown for name, command in installed().items())
    assert 'Further:' not in shown  # each of ours has its group


def test_the_help_imports_no_sub_command() -> None:
    script = (
        'import sys; from texture_bringup.command import main; main([]); '
        "print([name for name in ('numpy', 'sklearn', 'matplotlib', 'rclpy') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, '-c', script], check=True, stdout=subprocess.PIPE, text=True)
    assert done.stdout.split('\n')[-2] == '[]'


def test_every_module_of_a_folder_commands_is_a_sub_command() -> None:
    modules = {
        f'{path.parts[-3]}.commands.{path.stem}'
        for path in Path(__file__).resolve().parents[2].glob('*/texture_*/commands/[a-z]*.py')
    }
    assert len(modules) > 10
    assert modules == {command.module for command in installed().values()}


def prefix() -> Path:
    """Return where the suite is installed."""
    places = [Path(place) for place in os.environ['AMENT_PREFIX_PATH'].split(os.pathsep)]
    return next(place for place in places if (place / 'lib' / 'texture_bringup').is_dir())


def test_the_command_is_on_the_path_of_a_shell_that_has_sourced_the_workspace() -> None:
    clean = {'HOME': os.environ.get('HOME', '/'), 'PATH': '/usr/bin:/bin'}
    script = f'source {prefix()}/setup.bash && cd / && texture list surfaces'
    done = subprocess.run(['bash', '-c', script], check=False, capture_output=True, text=True, env=clean)
    assert 'ridge_2mm_deep' in done.stdout, done.stderr


def test_ros2_run_finds_the_command() -> None:
    program = prefix() / 'lib' / 'texture_bringup' / 'texture'  # where `ros2 run` looks
    done = subprocess.run([program, 'trian'], check=False, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, '')
    assert "did you mean 'train'?" in done.stderr


@pytest.mark.parametrize('arguments', [[], ['train', '--help']])
def test_a_reader_who_has_seen_enough_ends_the_command_quietly(arguments) -> None:
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, '-m', 'texture_bringup.command', *arguments]
    ended = subprocess.run(
        command, check=False, stdout=write, stderr=subprocess.PIPE, env={**os.environ, 'PYTHONUNBUFFERED': ''}
    )
    os.close(write)
    said = [
        line for line in ended.stderr.splitlines() if not line.startswith(b'loading the libraries ')
    ]  # on a busy machine
    assert (ended.returncode, said) == (141, [])


@pytest.mark.parametrize('unbuffered', ['', '1'])
def test_output_onto_a_full_disk_is_one_sentence(unbuffered) -> None:
    command = [sys.executable, '-m', 'texture_bringup.command']
    with Path('/dev/full').open('w') as full:
        ended = subprocess.run(
            command,
            check=False,
            stdout=full,
            stderr=subprocess.PIPE,
            env={**os.environ, 'PYTHONUNBUFFERED': unbuffered},
        )
    sentence = b'texture: the output cannot be written: No space left on device; make room, or write it elsewhere\n'
    assert (ended.returncode, ended.stderr) == (2, sentence)


@pytest.mark.parametrize('name', installed())
def test_every_sub_command_explains_itself(name, capsys) -> None:
    with pytest.raises(SystemExit) as ended:
        main([name, '--help'])
    assert ended.value.code == 0
    assert summary(installed()[name]) in ' '.join(capsys.readouterr().out.split())


def test_the_version_is_that_of_the_package(capsys):
    assert main(['--version']) == 0
    assert re.fullmatch(r'texture \d+\.\d+\.\d+\n', capsys.readouterr().out)


@pytest.mark.parametrize(('line', 'wanted'), [('texture expl', 'explore'), ('texture explore --surf', '--surface')])
def test_a_shell_completes_sub_commands_and_options(line, wanted):
    """As bash asks through argcomplete: by environment variables, the answer on file descriptor 8."""
    asking = {'_ARGCOMPLETE': '1', 'COMP_LINE': line, 'COMP_POINT': str(len(line)), '_ARGCOMPLETE_IFS': '\n'}
    shell = f'exec 8>&1 9>/dev/null; {sys.executable} -m texture_bringup.command'
    done = subprocess.run(
        ['bash', '-c', shell], env={**os.environ, **asking}, capture_output=True, text=True, check=True
    )
    assert wanted in done.stdout.split()


def ran(setting: str, *before: str, **environment: str) -> tuple[int, str]:
    """Return the exit code of a program that prepares something and runs the command, and what it reports."""
    script = f'import atexit, signal, sys; from texture_bringup import command; {setting}; sys.exit(command.program())'
    done = subprocess.run(
        [*before, sys.executable, '-c', script],
        env={**os.environ, **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL),  # also under nohup
    )
    return done.returncode, done.stderr


NOTHING = 'texture: interrupted; nothing was requested\n'


@pytest.mark.parametrize(('before', 'end'), [([], (130, NOTHING)), (['nohup'], (0, ''))])
def test_a_closed_terminal_interrupts_a_command_unless_it_runs_under_nohup(before, end):
    closed = 'lambda: command.run_program(lambda: signal.raise_signal(signal.SIGHUP) or 0)'
    assert ran(f'command.main = {closed}', *before) == end


HIDES = """
class Library:
    def load(self):
        try:
            signal.raise_signal(signal.{})
        except KeyboardInterrupt:
            raise ImportError('the extension is not there')
command.installed = lambda: {{'explore': Library()}}
sys.argv[1:] = ['explore']"""
DONE = """
from types import SimpleNamespace
module = SimpleNamespace(configure=lambda _: None, run=lambda _: signal.raise_signal(signal.{}))
command.summary = lambda _: ''
command.installed = lambda: {{'explore': SimpleNamespace(load=lambda: module)}}
sys.argv[1:] = ['explore']"""


@pytest.mark.parametrize('number', ['SIGINT', 'SIGTERM', 'SIGHUP'])
@pytest.mark.parametrize(('library', 'said'), [(HIDES, NOTHING), (DONE, 'texture: interrupted\n')])
def test_a_command_is_interrupted_while_a_library_hides_it_and_after_loading(number, library, said):
    assert ran(f'exec({library.format(number)!r})') == (130, said)


def test_ctrl_c_once_more_while_the_program_ends_shows_no_traceback():
    again = 'atexit.register(lambda: signal.raise_signal(signal.SIGINT))'
    assert ran(f'command.main = lambda: 130; {again}') == (130, '')


DOMAIN, MIDDLEWARE = 'ROS_DOMAIN_ID', 'RMW_IMPLEMENTATION'
ALLOWED = {
    DOMAIN: '; set it to a whole number from 0 to 232, or unset it',
    MIDDLEWARE: ', which is not installed here; unset it, or install that package of ROS',
}


@pytest.mark.parametrize(
    ('command', 'name', 'value'),
    [
        ('stop', DOMAIN, 'abc'),
        ('explore linear_slide', DOMAIN, '-1'),
        ('launch emulator', DOMAIN, '233'),
        ('dashboard', DOMAIN, '900'),
        ('stop', MIDDLEWARE, 'rmw_none_cpp'),
        ('launch emulator', MIDDLEWARE, 'rmw_none_cpp'),
        ('dashboard', MIDDLEWARE, 'rmw_none_cpp'),
    ],
)
def test_a_setting_that_ros_cannot_have_is_refused_with_what_is_allowed(command, name, value):
    code, said = ran(f'sys.argv[1:] = {command.split()}', **{name: value})
    quiet = ('loading the libraries ', 'checking what the launch')  # on a busy machine
    lines = [line for line in said.splitlines() if not line.startswith(quiet)]
    assert (code, lines) == (2, [f"texture: {name} is '{value}'{ALLOWED[name]}"])


def test_the_doctor_shows_a_missing_middleware_and_goes_on():
    code, said = ran("sys.argv[1:] = ['doctor']; sys.stdout = sys.stderr", RMW_IMPLEMENTATION='rmw_none_cpp')
    assert code == 0
    assert "cannot be loaded: RMW_IMPLEMENTATION is 'rmw_none_cpp'" in said
    assert '\nversions ' in said


NODES = {'tare': 'sensor'}  # the others are of the explorer
SERVICES = ['stop', 'recover', 'lift', 'touch-surface', 'forget-touches', 'tare']


@pytest.mark.parametrize(('name', 'success'), [*((name, True) for name in SERVICES), ('stop', False)])
def test_a_command_calls_its_service_and_ends_with_its_success(name, success, monkeypatch, capsys):
    operator = MagicMock()
    entered = operator.return_value.__enter__.return_value
    call = entered.stop if name == 'stop' else entered.call
    call.return_value = success, 'as it is'
    monkeypatch.setattr('texture_bringup.commands.services.Operator', operator)
    assert main([name, '--namespace', 'left']) == (0 if success else 1)
    assert capsys.readouterr().out == 'as it is\n'
    operator.assert_called_once_with('left')
    assert call.call_args.args[:1] == (
        () if name == 'stop' else (f'{NODES.get(name, "explorer")}/{name.replace("-", "_")}',)
    )


@pytest.mark.realtime
def test_a_service_that_no_node_offers_is_one_sentence_and_exit_code_2(monkeypatch, capsys):
    monkeypatch.setattr(operators, 'OFFERED_S', 0.2)
    monkeypatch.setenv('ROS_DOMAIN_ID', '97')
    assert main(['stop', '--namespace', 'left']) == 2
    said = capsys.readouterr().err
    assert "no node offers the service '/left/explorer/stop'" in said
    assert said.count('\n') == 1


class Fragile(LifecycleNode):
    """A lifecycle node that cannot be activated while it is broken."""

    def __init__(self, **options):
        super().__init__('fragile', **options)
        self.broken = False

    def on_activate(self, state):
        return TransitionCallbackReturn.FAILURE if self.broken else super().on_activate(state)


@pytest.mark.realtime
def test_running_nodes_are_activated_and_deactivated_and_called_and_a_refusal_is_reported(asked, monkeypatch, capsys):
    monkeypatch.setenv('ROS_DOMAIN_ID', '97')
    with LocalGraph(97, deadline_s=60.0) as graph:
        node = graph.add(Fragile)
        for command, state in (('activate', 'active'), ('deactivate', 'inactive'), ('deactivate', 'inactive')):
            assert asked(graph, command, 'fragile') == 0
            assert capsys.readouterr().out == f'fragile: {state}\n'
        node.broken = True
        assert asked(graph, 'activate', 'fragile') == 2
        assert "node 'fragile' is inactive and refuses to change" in capsys.readouterr().err
        graph.peer.create_service(
            Trigger, 'explorer/recover', lambda _request, _answer: Trigger.Response(message='it burns')
        )
        assert asked(graph, 'recover') == 1
    assert capsys.readouterr().out == 'it burns\n'


@pytest.mark.parametrize(
    ('kind', 'text', 'value'),
    [
        (ParameterType.PARAMETER_BOOL, 'False', False),
        (ParameterType.PARAMETER_INTEGER, '1', 1),
        (ParameterType.PARAMETER_DOUBLE, '0', 0.0),  # which a node refuses as an integer
        (ParameterType.PARAMETER_STRING, '12', '12'),
        (ParameterType.PARAMETER_BOOL, 'no', "parameter 'x' is 'no'; true, false, 1 or 0 is needed"),
        (ParameterType.PARAMETER_DOUBLE, 'much', "parameter 'x' is 'much'; a number is needed"),
        (ParameterType.PARAMETER_DOUBLE_ARRAY, '1', "parameter 'x' is a list, which cannot be set from a text"),
    ],
)
def test_a_text_is_read_as_the_type_that_the_node_declared_or_refused(kind, text, value):
    try:
        read = operators.parameter_from_text('x', text, kind).value
    except TextureError as error:
        read = str(error)[: len(value)]
    assert (read, type(read)) == (value, type(value))

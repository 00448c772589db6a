# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The launcher as a program, with shell scripts for nodes: no ROS is needed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from texture_bringup.launcher import ending_with_parent
from texture_core.errors import LaunchFailed

pytestmark = pytest.mark.realtime

GOOD = 'trap "exit 0" INT TERM; echo "ready $$"; while :; do sleep 0.05; done'
STUBBORN = 'trap "" INT; trap "exit 0" TERM; echo "ready $$"; while :; do sleep 0.05; done'
PARENT = 'sleep 1000 & trap "exit 0" INT TERM; echo "ready $!"; while :; do sleep 0.05; done'
DEADLINE_S = 20.0


class Launched:
    """A running launcher."""

    def __init__(self, file: Path, prefix: Path, options: tuple[str, ...], program: tuple[str, ...]) -> None:
        self.environment = {**os.environ, 'AMENT_PREFIX_PATH': str(prefix), 'TMPDIR': str(prefix)}
        self.command = [*program, sys.executable, '-m', 'texture_bringup.command', 'launch', *options, str(file)]
        self.process = subprocess.Popen(
            self.command, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.lines = []

    def wait_for(self, text: str) -> str:
        """Return the next line that holds a text."""
        for line in self.process.stdout:
            self.lines.append(line.rstrip())
            if text in line:
                return line
        raise AssertionError(f"the launcher ended without '{text}': {self.lines}")

    def ready(self) -> int:
        """Return the process id that the next node says it is ready with."""
        return int(self.wait_for('ready').split()[-1])

    def end(self) -> int:
        """Return the exit code once it ends."""
        output, _ = self.process.communicate(timeout=DEADLINE_S)
        self.lines += output.splitlines()
        return self.process.returncode


@pytest.fixture
def launch(tmp_path):
    """Return a function: scripts by node name (and extra attributes of a node) → a running launcher."""
    (tmp_path / 'share/ament_index/resource_index/packages').mkdir(parents=True)
    (tmp_path / 'lib/p').mkdir(parents=True)
    (tmp_path / 'lib/texture_simulation').symlink_to('p')
    for package in ('p', 'texture_simulation'):
        (tmp_path / 'share/ament_index/resource_index/packages' / package).touch()
    started = []

    def start(scripts: dict[str, str], *options: str, program: tuple[str, ...] = (), **attributes: str) -> Launched:
        nodes = ''
        for name, script in scripts.items():
            (tmp_path / 'lib/p' / name).write_text(f'#!/bin/sh\n{script}\n')
            (tmp_path / 'lib/p' / name).chmod(0o755)
            package = 'texture_simulation' if name == 'emulated' else 'p'
            nodes += f'<node pkg="{package}" exec="{name}" output="screen" {attributes.get(name, "")}/>'
        (tmp_path / 'a.launch.xml').write_text(f'<launch>{nodes}</launch>')
        started.append(Launched(tmp_path / 'a.launch.xml', tmp_path, options, program))
        return started[-1]

    yield start
    for item in started:
        item.process.kill()
        item.process.wait()
        item.process.stdout.close()


def gone(pid: int) -> bool:
    """Return whether a process ends before the deadline (one that waits to be reaped has ended)."""
    deadline = time.monotonic() + DEADLINE_S
    while time.monotonic() < deadline:
        try:
            if Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] == 'Z':
                return True
        except (FileNotFoundError, ProcessLookupError):
            return True
        time.sleep(0.02)
    return False


def test_a_stop_ends_every_node_and_what_nodes_started(launch) -> None:
    launched = launch({'good': GOOD, 'parent': PARENT})
    pids = [launched.ready(), launched.ready()]
    launched.process.send_signal(signal.SIGTERM)
    assert launched.end() == 0
    assert all(gone(pid) for pid in pids)
    assert any(line.startswith('[good] ready') for line in launched.lines)


def test_emulated_devices_are_ended_once_the_nodes_that_use_them_have_ended(launch) -> None:
    lifting = 'trap "sleep 1; echo lifted; exit 0" INT TERM; echo "ready $$"; while :; do sleep 0.05; done'
    launched = launch({'emulated': GOOD, 'lifting': lifting})
    launched.ready(), launched.ready()
    launched.process.send_signal(signal.SIGINT)
    assert launched.end() == 0
    said = ['[lifting] lifted', '[launch] lifting has finished', '[launch] SIGINT to emulated']
    assert [line for line in launched.lines if line in said] == said


def test_further_ctrl_c_leave_a_node_its_time_to_lift_the_finger(launch) -> None:
    script = 'trap "sleep 1; echo lifted; exit 0" INT TERM; echo "ready $$"; while :; do sleep 0.05; done'
    launched = launch({'lifting': script})
    launched.ready()
    for _ in range(4):
        launched.process.send_signal(signal.SIGINT)
        time.sleep(0.1)
    assert launched.end() == 0
    assert any('lifted' in line for line in launched.lines)
    assert not any('SIGTERM to' in line for line in launched.lines)


def test_a_node_that_had_to_be_killed_fails_the_launch_and_the_finger_is_named(launch) -> None:
    launched = launch({'deaf': 'trap "" INT TERM; echo "ready $$"; while :; do sleep 0.05; done'})
    pid = launched.ready()
    launched.process.send_signal(signal.SIGINT)
    assert launched.end() == 1
    assert gone(pid)
    assert any('whether the finger still presses' in line for line in launched.lines)


@pytest.mark.parametrize(('name', 'code'), [('bad', 3), ('dashboard', 2)])  # a page that cannot listen stops no arm
def test_a_node_that_dies_is_named_with_its_code_and_the_others_go_on(launch, name, code) -> None:
    launched = launch({'good': GOOD, name: f'exit {code}'})
    launched.wait_for(f'{name} died with exit code {code}')
    assert launched.process.poll() is None
    launched.process.send_signal(signal.SIGINT)
    assert launched.end() == 1


@pytest.mark.parametrize(
    ('script', 'attributes', 'expected', 'cause'),
    [
        ('echo "[ERROR] why"; exit 3', 'on_exit="shutdown"', (1, 1), 'died with exit code 3: [ERROR] why'),
        # The last line of a node that works says nothing of its end, nor does an old warning of one that is killed.
        ('echo "[INFO] why"; kill -9 $$', 'on_exit="shutdown"', (1, 1), 'was killed by SIGKILL'),
        ('echo "[WARN] why"; kill -9 $$', 'on_exit="shutdown"', (1, 1), 'was killed by SIGKILL'),
        (
            'echo KeyError: why; exit 3',
            'respawn="true" respawn_max_retries="2"',
            (1, 3),
            'died with exit code 3: KeyError: why',
        ),
        # It was started wrongly.
        ('echo texture: why; exit 2', 'respawn="true"', (2, 1), 'died with exit code 2: texture: why'),
        ('echo texture: why; exit 2', '', (2, 1), 'died with exit code 2: texture: why'),
    ],
)
def test_the_death_of_a_needed_node_stops_the_others_and_is_named_last(
    launch, script, attributes, expected, cause
) -> None:
    launched = launch({'good': GOOD, 'bad': script}, bad=attributes)
    assert (launched.end(), sum('[bad] ' in line and 'why' in line for line in launched.lines)) == expected
    assert '[launch] bad is required by the other nodes, which are stopped now' in launched.lines
    assert launched.lines[-1] == f'[launch] the launch ended because bad {cause}'


@pytest.mark.parametrize(('end', 'presses'), [('kill -9 $$', True), ('exit 1', True), ('exit 2', False)])
def test_the_end_of_a_killed_explorer_says_that_the_arm_may_continue_to_press(launch, end, presses) -> None:
    launched = launch({'good': GOOD, 'explorer': end}, explorer='on_exit="shutdown"')
    assert launched.end() in (1, 2)
    assert ('; the arm may continue to press: raise the finger' in launched.lines[-1]) == presses


def test_of_a_killed_explorer_that_is_restarted_the_sentence_names_the_lift(launch) -> None:
    launched = launch({'explorer': GOOD}, explorer='respawn="true"')
    os.kill(launched.ready(), signal.SIGKILL)
    assert 'the finger may still press: look at the robot, and call `texture lift`' in launched.wait_for('SIGKILL')
    launched.ready()
    launched.process.send_signal(signal.SIGINT)
    assert launched.end() == 0


def test_a_node_that_may_be_restarted_comes_back(launch) -> None:
    launched = launch({'phoenix': GOOD}, phoenix='respawn="true"')
    first = launched.ready()
    os.kill(first, signal.SIGKILL)
    second = launched.ready()
    assert second != first
    launched.process.send_signal(signal.SIGINT)
    assert launched.end() == 0


@pytest.mark.parametrize(('given', 'again'), [('', 'restart.xml'), ('/mine.xml', 'mine.xml')])
def test_a_node_in_the_place_of_a_dead_one_gets_the_profile_for_restarts(launch, monkeypatch, given, again) -> None:
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', given)
    launched = launch({'phoenix': f'echo "profile $FASTRTPS_DEFAULT_PROFILES_FILE"; {GOOD}'}, phoenix='respawn="true"')
    profiles = []
    for _ in range(2):
        profiles.append(launched.wait_for('profile').split('profile')[1].strip())
        os.kill(launched.ready(), signal.SIGKILL)
    assert profiles[0] == given
    assert Path(profiles[1]).name == again


def test_together_the_death_of_any_node_stops_all_and_none_is_restarted(launch) -> None:
    launched = launch({'good': GOOD, 'phoenix': GOOD}, '--together', phoenix='respawn="true"')
    pids = [launched.ready(), launched.ready()]
    phoenix = next(line for line in launched.lines if line.startswith('[phoenix] ready'))
    os.kill(int(phoenix.split()[-1]), signal.SIGKILL)
    assert launched.end() == 1
    assert all(gone(pid) for pid in pids)


# As the demonstration does.
RUN = 'import subprocess, sys; from texture_bringup.launcher import ending_with_parent as ending; '
PROGRAM = (sys.executable, '-c', RUN + 'subprocess.run(ending("INT", sys.argv[1:]))')


@pytest.mark.parametrize('program', [(), PROGRAM])
def test_nodes_end_with_a_launcher_or_with_its_program_that_is_killed(launch, program) -> None:
    launched = launch({'good': GOOD}, '--together', program=program)
    pid = launched.ready()
    launched.process.kill()
    assert gone(pid)


def test_nodes_that_all_finish_end_the_launcher_and_their_last_line_is_shown(launch) -> None:
    launched = launch({'short': 'printf "no line end"'})
    assert launched.end() == 0
    assert '[short] no line end' in launched.lines


def test_nodes_are_stopped_when_nobody_reads_the_output_any_more(launch) -> None:
    launched = launch({'chatty': 'trap "exit 0" INT TERM; echo "ready $$"; while :; do sleep 0.05; echo more; done'})
    pid = launched.ready()
    launched.process.stdout.close()
    assert gone(pid)
    assert launched.process.wait(DEADLINE_S) == 0


def test_nodes_are_stopped_when_the_disk_that_takes_the_output_is_full(launch) -> None:
    first = launch({'good': GOOD})
    with Path('/dev/full').open('w') as full:  # ends with 0 once all nodes have ended
        subprocess.run(first.command, check=True, env=first.environment, stdout=full, timeout=DEADLINE_S)


def test_a_letter_that_the_output_cannot_show_is_written_by_its_code(launch, monkeypatch) -> None:
    monkeypatch.setenv('PYTHONIOENCODING', 'ascii')
    launched = launch({'good': f"printf 'caf\\303\\251\\n'; {GOOD}"})
    pid = launched.ready()
    assert any('caf\\xe9' in line for line in launched.lines)
    launched.process.send_signal(signal.SIGINT)
    assert launched.end() == 0
    assert gone(pid)


def test_processes_that_left_the_group_of_their_node_hold_nothing_up(launch) -> None:
    launched = launch({'good': GOOD, **dict.fromkeys('abcd', 'setsid sleep 10 & exit 3')})
    launched.wait_for('started')
    began_s = time.monotonic()
    for _ in 'abcd':
        launched.wait_for('died with exit code 3')
    assert time.monotonic() - began_s < 3.0  # not one second for each
    launched.process.send_signal(signal.SIGINT)
    assert launched.end() == 1


def test_a_missing_setpriv_is_named(monkeypatch) -> None:
    monkeypatch.setenv('PATH', '')
    with pytest.raises(LaunchFailed, match='install the package util-linux'):
        ending_with_parent('INT', ['true'])

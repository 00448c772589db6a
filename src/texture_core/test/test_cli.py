# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from texture_core import cli
from texture_core.cli import Parser, add_namespace, add_slides, core_count
from texture_core.errors import TextureError


def test_a_long_task_says_how_far_it_is_and_a_nested_or_short_one_nothing(monkeypatch, capsys) -> None:
    monkeypatch.setattr(cli, 'LOG_PERIOD_S', 0.2)
    cli.show_progress()
    assert list(cli.progress('ab', 'count letters', 2)) == ['a', 'b']
    assert capsys.readouterr().err == ''
    monkeypatch.setattr(cli, 'QUIET_S', 0.1)
    for letter in cli.progress('ab', 'count letters', 2):
        with cli.task('spell'):
            time.sleep(0.25 if letter == 'b' else 0.0)
    assert capsys.readouterr().err == 'count letters 1 of 2, 0 s\n'


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_stop_while_a_node_imports_ends_it_with_0_and_without_a_traceback(number, tmp_path: Path) -> None:
    nodes, executable = tmp_path / 'slow' / 'nodes', tmp_path / 'lib' / 'slow' / 'one'
    for folder in (nodes, executable.parent):
        folder.mkdir(parents=True)
    (nodes / 'one.py').write_text("import time\nprint('imports', flush=True)\ntime.sleep(60)")
    executable.write_text('from texture_core.start import node\nnode()')
    environment = {**os.environ, 'PYTHONPATH': f'{tmp_path}:{os.environ.get("PYTHONPATH", "")}'}
    command = [sys.executable, str(executable)]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == 'imports\n'
    process.send_signal(number)
    assert process.communicate(timeout=30.0) == ('', '')
    assert process.returncode == 0


@pytest.mark.parametrize(
    ('given', 'sentence'),
    [
        (
            ['oak', '--spedd', '1'],
            "no option of touch '--spedd'; did you mean '--speed'? Known: --help, --jobs, --kind, ",
        ),
        *(
            (['oak', '--speed', number, '--jobs', '0'], "--jobs is '0'; 0 cores compute nothing")
            for number in ('-5e-05', '-1.E3', '-.5', '-inf', '-nan')
        ),
        (['oak', '--speed', 'fast'], "--speed is 'fast'; a number is needed: speed, 5 % at least"),
        (['oak', '--jobs', '0'], "--jobs is '0'; 0 cores compute nothing; 1 or more are needed, or -1 for all"),
        (['oak', '--kind', 'liner'], "no value of --kind 'liner'; did you mean 'linear'? Known: circular, linear"),
        (['oak', '--slides', ''], "--slides is ''; write N-M, or leave it out for all"),
        (['oak', '--speed'], '--speed expected one argument; write --speed M/S'),
        (['oak', '--namespace', 'le ft'], "the namespace is 'le ft'; allowed are letters, digits and _"),
        (['oak', 'elm'], "'elm' is one argument too many; write touch [-h] [--speed M/S]"),
        ([], 'the following arguments are required: surface; write touch [-h] [--speed M/S]'),
        (['--spede', '1'], "no option of touch '--spede'; did you mean '--speed'?"),
    ],
)
def test_a_mistake_in_an_option_is_answered_with_what_came_and_what_is_allowed(given, sentence) -> None:
    parser = Parser(prog='touch')
    parser.add_argument('surface')
    parser.add_argument('--speed', type=float, metavar='M/S', help='speed, 5 %% at least')
    parser.add_argument('--jobs', type=core_count)
    add_namespace(parser)
    add_slides(parser)
    parser.add_argument('--kind', choices=('linear', 'circular'))
    with pytest.raises(TextureError) as refused:
        parser.parse_args(given)
    assert str(refused.value).startswith(sentence)

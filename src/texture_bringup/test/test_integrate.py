# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The integrator's walkthrough, line by line: every line that begins with `texture` is run as it stands in the page."""

import os
import re
import shlex
from pathlib import Path

import pytest

pytestmark = [pytest.mark.benchmark, pytest.mark.realtime, pytest.mark.ros]
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

from texture_bringup import command
from texture_bringup.commands.explore import ABORTED, NO_MODEL, REJECTED
from texture_bringup.launcher import ChildLauncher
from texture_bringup.operator import Operator

DOMAIN = 98
DEADLINE_S = 90.0
PAGE = Path(__file__).parents[3] / 'docs' / 'integrate.md'
LINE = re.compile(r'^ {4}(texture [^#\n]+?)(?: +# says: (.+))?$', re.MULTILINE)
# A busy machine may hold up the emulated controller for longer than a real one is allowed to be silent.
PATIENT = """/**:
  ros__parameters:
    state_timeout_s: 2.0
    deadman_s: 1.5
    connect_timeout_s: 60.0
    signal_timeout_s: 5.0
    estimate_timeout_s: 10.0
"""


def launched(words, folder, log):
    """Return the launcher of a `texture launch` line, with places of its own."""
    own = {'devices': folder, 'explorer_params': folder / 'patient.yaml'}
    given = dict(word.split(':=') for word in words[3:])
    return ChildLauncher(words[2], {**own, **given}, dict(os.environ), log)


def ended_with(words, said, launch):
    """Return the exit code of a line: no label is accepted on this page, without a model or after eight slides."""
    if words[1] != 'explore':
        return 0
    if said.startswith('no surface'):
        return ABORTED
    return REJECTED if any(word.startswith('model:=') for word in launch) else NO_MODEL


def test_every_line_of_the_walkthrough_does_what_the_page_says(tmp_path, monkeypatch, capsys):
    for name, value in {'ROS_DOMAIN_ID': str(DOMAIN), 'ROS_LOG_DIR': str(tmp_path)}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'patient.yaml').write_text(PATIENT)
    lines = LINE.findall(PAGE.read_text())
    assert len(lines) >= 12
    launcher, launch = None, ()
    try:
        for number, (line, said) in enumerate(lines):
            words = shlex.split(line)
            if words[1] == 'launch':
                if launcher is not None:
                    launcher.stop()
                launch, launcher = words, launched(words, tmp_path, tmp_path / f'nodes{number}.log')
                launcher.__enter__()
                with Operator(guard=launcher.check) as operator:
                    operator.wait_for_explorer(DEADLINE_S)
                    operator.wait_for_signal(DEADLINE_S)
                continue
            if words[1] == 'train' and launcher is not None:
                launcher.stop()  # which completes the recording
                launcher = None
            code = command.main(words[1:])
            reported = ''.join(capsys.readouterr())
            log = launcher.log.read_text() if launcher else ''
            assert code == ended_with(words, said, launch), line + reported + log
            assert said in reported, line + reported + log
    finally:
        if launcher is not None:
            launcher.stop()

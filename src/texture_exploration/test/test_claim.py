# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""One commander an arm: the lock on its name, which ends with the last process that holds it."""

import os
import subprocess
import sys

import pytest

from texture_core.errors import DeviceError
from texture_exploration.arms import arm as arms
from texture_exploration.arms.arm import claim

# A process that takes the arm, and a child, such as its guard, that outlives it.
HOLDING = """
import os, subprocess, sys
from texture_exploration.arms.arm import claim
lock = claim(sys.argv[1], 0.0)
if sys.argv[2] == 'with a guard':
    subprocess.Popen([sys.executable, '-c', 'input()'], pass_fds=[lock])
print('held', flush=True)
input()
"""


@pytest.fixture
def name(tmp_path):
    name = f'a test, {tmp_path}'
    yield name
    for path in arms.RUNTIME.glob('tactile_texture_a%20test*'):
        path.unlink()


def holding(name, how, **environment):
    process = subprocess.Popen(
        [sys.executable, '-c', HOLDING, name, how],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, **environment},
    )
    assert process.stdout.readline() == b'held\n'
    return process


def test_a_second_process_is_refused_by_name_wherever_its_temporary_files_are_and_gets_the_arm_of_a_killed_one(
    name, tmp_path
):
    with holding(name, 'alone', TMPDIR=str(tmp_path)) as process:
        with pytest.raises(DeviceError, match='another process on this machine commands the arm'):
            claim(name, 0.1)
        os.close(claim(f'{name}, another', 0.0))
        process.kill()
    os.close(claim(name, 0.0))


def test_the_guard_of_a_killed_process_keeps_the_arm_until_it_ends(name):
    with holding(name, 'with a guard') as process:
        process.kill()
        process.wait()
        with pytest.raises(DeviceError, match='or its guard still stops it'):
            claim(name, 0.1)
        process.stdin.close()  # ends the guard, too
        os.close(claim(name, 20.0))


def test_what_stands_in_place_of_the_lock_is_refused_and_not_waited_for(name, tmp_path, monkeypatch):
    monkeypatch.setattr(arms, 'RUNTIME', tmp_path / 'none')
    with pytest.raises(DeviceError, match='cannot be opened'):
        claim(name, 0.0)

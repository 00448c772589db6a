# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The unmodified client package ur-rtde on the emulated controller, over TCP."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from texture_core.types import FingerReceiver
from texture_simulation.devices.ur import ControllerProcess, UrControllerParams

pytestmark = pytest.mark.realtime

SESSION = Path(__file__).with_name('ur_session.py')
DEADLINE_S = 60.0
IP = '127.0.0.60'


@pytest.fixture(scope='module')
def done():
    pytest.importorskip('rtde_control', reason='ur-rtde is not installable here')
    with ControllerProcess(UrControllerParams(ip=IP, unlock_delay_s=0.0)):
        command = [sys.executable, str(SESSION), IP]
        session = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert session.returncode == 0, session.stderr
    return json.loads(session.stdout.splitlines()[-1])


def test_the_force_sensor_shows_its_offset_until_it_is_zeroed(done):
    assert done['offset'][2] == pytest.approx(1.5 * 0.866, abs=0.2)
    assert done['zeroed'] == [True, True]


def test_force_control_holds_the_force_while_the_finger_slides_with_friction(done):
    assert done['force_mode'] == [True, True]
    assert done['slide'] == [True, True, pytest.approx(5.0, rel=0.05)]
    assert done['stop'] == [True, True, True]
    assert done['lifted'] == [True, True]


def test_the_watchdog_stops_the_program_only_when_it_is_not_kicked(done):
    assert done['watchdog'] == [True, True, True, False]
    assert done['again'] == [True, True, True]


def test_a_protective_stop_refuses_commands_until_it_is_unlocked(done):
    assert done['protective_stop'] == [True, 3, False]
    assert done['dashboard'] == ['5.12.0.0', 'Robotmode: RUNNING', 'Safetymode: PROTECTIVE_STOP']
    assert done['unlocked'] == [True, True]
    assert done['script_stopped']


@pytest.mark.parametrize('version', ['3.15', '5.23', '10.10'])
def test_other_versions_let_the_client_move(version):
    pytest.importorskip('rtde_control', reason='ur-rtde is not installable here')
    program = """
import os, sys, time
from rtde_control import RTDEControlInterface as Control
from rtde_receive import RTDEReceiveInterface as Receive
receive, control = Receive(sys.argv[1]), Control(sys.argv[1])
moved, deadline = control.speedL([0.05, 0, 0, 0, 0, 0], 1.0), time.monotonic() + 5.0
while receive.getActualTCPPose()[0] < 0.41 and time.monotonic() < deadline:
    time.sleep(0.01)
print(moved, control.speedStop(), receive.getActualTCPPose()[0] >= 0.41, flush=True)
os._exit(0)  # the interfaces would sleep
"""
    with ControllerProcess(UrControllerParams(ip=IP, version=version)):
        command = [sys.executable, '-c', program, IP]
        session = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert session.stdout.splitlines()[-1:] == ['True True True'], session.stderr


def test_it_tells_the_emulator_where_the_finger_is(tmp_path):
    path, states, end_s = str(tmp_path / 'finger'), [], time.monotonic() + DEADLINE_S
    params = UrControllerParams(ip=str(tmp_path / 'ur'), finger_pipe=path)
    with closing(FingerReceiver(path)) as emulator, ControllerProcess(params):
        while len(states) < 200 and time.monotonic() < end_s:
            states += emulator.states(1.0)
    states = states[:200]
    assert (states[-1].x_m, states[-1].z_m, states[-1].force_n) == (0.0, pytest.approx(0.01), 0.0)
    rate_hz = 199 / ((states[-1].time_ns - states[0].time_ns) * 1e-9)
    assert 100 < rate_hz < 600  # 500 Hz on a machine that is not busy

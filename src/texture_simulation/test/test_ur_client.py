# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The unmodified client package ur-rtde on the emulated controller, over TCP."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import closing

import pytest

from texture_core.types import FingerReceiver
from texture_simulation.devices.ur import ControllerProcess, UrControllerParams

pytestmark = pytest.mark.realtime

DEADLINE_S = 60.0
IP = '127.0.0.60'


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

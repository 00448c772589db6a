# SPDX-License-Identifier: Apache-2.0
"""The UR arm through the unmodified ur-rtde, on the emulated controller: a process of its own on a loopback address."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections import deque
from pathlib import Path

import numpy as np
import pytest

from texture_core.config import markdown_table
from texture_core.errors import DeviceError
from texture_core.types import ExplorationRequest, FingerState, Phase
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.ur import (
    PROTOCOL_VERSION,
    REQUEST_VERSION,
    RTDE_PORT,
    SETUP_INPUTS,
    TcpConnection,
    UrArm,
    UrArmParams,
    _ask,
)
from texture_exploration.arms.ur import UrArmParams as Params
from texture_exploration.explorer import Explorer
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import TouchParams
from texture_simulation.devices.ur import ControllerProcess, UrControllerParams

pytestmark = pytest.mark.realtime

PAGE = Path(__file__).parents[3] / 'docs' / 'reference' / 'parameters.md'
PARENT = Path(__file__).with_name('ur_parent.py')
DEADLINE_S = 20.0
SLIDING = ArmCommand(tangential_m_s=(0.02, 0.0))
UNLOCK_S = 0.3
needs_ur_rtde = pytest.mark.skipif(
    importlib.util.find_spec('rtde_control') is None, reason='ur-rtde is not installable here'
)


class EmulatedRig:
    """The emulated controller, and the true state of its finger, as it tells the emulator."""

    def __init__(self, ip):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(('127.0.0.1', 0))
        port = self._socket.getsockname()[1]
        self.ip = ip
        self.controller = ControllerProcess(UrControllerParams(ip=ip, finger_port=port, unlock_delay_s=UNLOCK_S))
        self.fingers = deque(maxlen=20000)
        threading.Thread(target=self._receive_commands, daemon=True).start()

    def _receive_commands(self):
        with contextlib.suppress(OSError):
            while data := self._socket.recv(256):
                self.fingers.append(FingerState.from_bytes(data))

    def moves(self):
        return abs(self.fingers[-1].vx_m_s) > 0.01

    def rests(self):
        finger = self.fingers[-1]
        return finger.vx_m_s == finger.vy_m_s == finger.vz_m_s == 0.0

    def close(self):
        self.controller.stop()
        # A datagram of nothing ends the thread.
        self._socket.sendto(b'', self._socket.getsockname())


@pytest.fixture(scope='module')
def emulator():
    emulator = EmulatedRig('127.0.0.50')
    emulator.controller.start()
    yield emulator
    emulator.close()


@pytest.fixture
def arm(emulator):
    arm = UrArm(UrArmParams(ip=emulator.ip))
    arm.connect()
    yield arm
    arm.close()


def wait_for(condition, deadline_s=DEADLINE_S):
    """Return after how many seconds the condition was true."""
    begin_s = time.monotonic()
    while not condition():
        assert time.monotonic() - begin_s < deadline_s
        time.sleep(0.002)
    return time.monotonic() - begin_s


def keep(arm, command, condition):
    """Command until a condition is true."""

    def step():
        arm.command(command)
        return condition()

    return wait_for(step)


def faulty(arm):
    """Return what is wrong with the arm, '' if nothing is."""
    try:
        return arm.state().fault
    except DeviceError as error:
        return str(error)


class Ticker:
    """A thread beside: how long was it kept from running at most?"""

    def __enter__(self):
        self.worst_s, self._ended = 0.0, threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        return self

    def _run(self):
        last_s = time.monotonic()
        while not self._ended.wait(0.005):
            now_s = time.monotonic()
            self.worst_s, last_s = max(self.worst_s, now_s - last_s), now_s

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()


def commands():
    """Yield the command line of every process."""
    for path in Path('/proc').glob('[0-9]*/cmdline'):
        with contextlib.suppress(OSError):
            yield path.read_bytes()


@contextlib.contextmanager
def listener(ip, port=30004, serve=None):
    """Someone who takes connections and, unless told otherwise, never answers."""
    with socket.create_server((ip, port)) as server:
        if serve is not None:
            threading.Thread(target=serve, args=(server,), daemon=True).start()
        yield


def answer_version(server):
    """Answer what the probe asks, as version 10.10 on which no program runs, and nothing else."""
    kept = []
    with contextlib.suppress(OSError):
        while True:
            connection, _ = server.accept()
            kept.append(connection)
            threading.Thread(target=_answer_version, args=(connection,), daemon=True).start()


def _answer_version(connection):
    with contextlib.suppress(OSError):
        while data := connection.recv(3):
            size, kind = struct.unpack('>HB', data)
            asked = connection.recv(size - 3) if size > 3 else b''
            if kind == 86:
                connection.sendall(struct.pack('>HBB', 4, 86, 1))
            elif kind == 118:
                connection.sendall(struct.pack('>HB4I', 19, 118, 10, 10, 0, 0))
            elif kind == 79 and asked.endswith(b'runtime_state'):
                connection.sendall(struct.pack('>HBB6s', 10, 79, 1, b'UINT32'))
            elif kind == 83:
                connection.sendall(struct.pack('>HBB', 4, 83, 1) + struct.pack('>HBBI', 8, 85, 1, 1))


@needs_ur_rtde
def test_it_touches_holds_2_newtons_slides_50_mm_at_20_mm_s_and_lifts(emulator, record_property):
    phases = []
    explorer = Explorer(
        UrArm(UrArmParams(ip=emulator.ip)),
        TouchParams(peak_speed_share=2.0),
        SafetyLimits(state_timeout_s=1.0),  # a busy machine may hold the process up; silence is tested below
        lambda state: phases.append((state.stamp_ns, state.phase)),
    )
    home = explorer.connect()
    try:
        request = ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=2.0, distance_m=0.05)
        exploration = explorer.begin('one', request)
        assert exploration.ended.wait(DEADLINE_S)
        assert exploration.outcome.success, exploration.outcome.message
        end = explorer.arm.state()
        counts = explorer.arm.counts
    finally:
        explorer.close()
    begin_ns = min(stamp for stamp, phase in phases if phase is Phase.SLIDE)
    end_ns = min(stamp for stamp, phase in phases if phase is Phase.LIFT)
    slide = [finger for finger in list(emulator.fingers) if begin_ns <= finger.time_ns < end_ns]
    times_s = np.array([finger.time_ns for finger in slide]) * 1e-9
    places_m = np.array([finger.x_m for finger in slide])
    forces_n = np.array([finger.force_n for finger in slide])
    speed_m_s = np.polyfit(times_s - times_s[0], places_m, 1)[0]
    record_property('speed_m_s', float(speed_m_s))
    record_property('force_n', float(forces_n.mean()))
    record_property('counts', dict(counts))
    assert speed_m_s == pytest.approx(0.02, rel=0.02)
    assert np.all(np.abs(forces_n - 2.0) <= 0.1)
    assert places_m[-1] - places_m[0] == pytest.approx(0.05, abs=0.001)
    # In a pause of the machine, of which steps too late tell, it goes on being lifted.
    assert -0.001 < end.position[2] - home[2] < (0.004 if explorer.counts['late_steps'] else 0.001)
    assert abs(end.force_n) < 0.2
    assert counts['refused'] == 0


@needs_ur_rtde
def test_commands_and_states_are_in_the_frame_of_the_surface(emulator):
    wall = UrArm(UrArmParams(ip=emulator.ip, surface_ry_rad=np.pi / 2))  # its z is the x of the base
    wall.connect()
    try:
        before = emulator.fingers[-1]
        goal_m = wall.state().position[2] + 0.01
        keep(wall, ArmCommand(normal_m_s=0.02), lambda: wall.state().position[2] > goal_m)
        wall.stop()
        wait_for(emulator.rests)
        after = emulator.fingers[-1]
        assert after.x_m - before.x_m > 0.0099
        assert (after.y_m, after.z_m) == pytest.approx((before.y_m, before.z_m), abs=1e-6)
    finally:
        wall.close()


@needs_ur_rtde
def test_the_force_sensor_is_zeroed_in_the_air_but_not_in_contact(arm, emulator):
    keep(arm, ArmCommand(normal_m_s=0.02), lambda: arm.state().position[2] > 0.008)
    arm.stop()
    wait_for(emulator.rests)
    keep(arm, ArmCommand(force_n=2.0), lambda: abs(emulator.fingers[-1].force_n - 2.0) < 0.05)
    arm.stop()
    wait_for(emulator.rests)
    keep(arm, ArmCommand(force_n=3.0), lambda: abs(emulator.fingers[-1].force_n - 3.0) < 0.05)
    assert arm.state().force_n == pytest.approx(3.0, abs=0.3)


@needs_ur_rtde
def test_a_protective_stop_is_a_fault_that_recover_clears_without_a_new_process(arm, emulator):
    keep(arm, SLIDING, emulator.moves)
    worker = arm.worker_pid
    emulator.controller.ask('emulate protective stop')
    wait_for(lambda: faulty(arm) == 'protective stop')
    wait_for(emulator.rests)
    arm.recover()
    assert (faulty(arm), arm.worker_pid) == ('', worker)
    keep(arm, SLIDING, emulator.moves)


@needs_ur_rtde
def test_connecting_releases_a_protective_stop_only_if_it_is_reported_to(arm, emulator):
    emulator.controller.ask('emulate protective stop')
    arm.close()
    with pytest.raises(DeviceError, match=r'held by its safety system \(PROTECTIVE_STOP\); find out why'):
        arm.connect()
    willing = UrArm(UrArmParams(ip=emulator.ip, unlock_protective_stop=True))
    willing.connect()
    assert faulty(willing) == ''
    willing.close()


@needs_ur_rtde
def test_a_program_that_was_stopped_by_hand_is_a_fault_that_connecting_clears(arm, emulator):
    emulator.controller.ask('stop')
    wait_for(lambda: faulty(arm).startswith('its control program was stopped'))
    arm.close()
    arm.connect()
    assert faulty(arm) == ''
    keep(arm, SLIDING, emulator.moves)


@needs_ur_rtde
def test_a_frozen_controller_is_a_fault_within_150_ms_and_stops_when_it_thaws(arm, emulator, record_property):
    keep(arm, SLIDING, emulator.moves)
    with Ticker() as ticker:
        emulator.controller.freeze()
        last_ns = emulator.fingers[-1].time_ns
        keep(arm, SLIDING, lambda: faulty(arm))
        silent_s = (time.monotonic_ns() - last_ns) * 1e-9
    record_property('detected_s', silent_s)
    assert 'silent' in faulty(arm)
    assert 0.1 <= silent_s < 0.15 + ticker.worst_s
    emulator.controller.resume()
    wait_for(lambda: faulty(arm) == '' and emulator.rests())
    keep(arm, SLIDING, emulator.moves)


@needs_ur_rtde
def test_a_worker_that_is_killed_leaves_the_arm_to_the_watchdog(arm, emulator, record_property):
    keep(arm, SLIDING, emulator.moves)
    os.kill(arm.worker_pid, signal.SIGKILL)
    record_property('stopped_s', wait_for(emulator.rests))
    wait_for(lambda: 'connect again' in faulty(arm))
    with pytest.raises(DeviceError, match='connect again'):
        arm.command(SLIDING)
    arm.close()
    arm.connect()
    keep(arm, SLIDING, emulator.moves)


@needs_ur_rtde
def test_a_worker_that_hangs_is_killed_when_the_arm_is_closed(arm, emulator):
    keep(arm, SLIDING, emulator.moves)
    worker = arm.worker_pid
    os.kill(worker, signal.SIGSTOP)
    wait_for(emulator.rests)  # the watchdog
    begin_s = time.monotonic()
    arm.close()
    assert time.monotonic() - begin_s < 5.0
    assert not Path(f'/proc/{worker}').exists()


@needs_ur_rtde
def test_when_the_parent_is_killed_the_arm_stops_and_the_worker_ends(emulator, record_property):
    parent = subprocess.Popen([sys.executable, str(PARENT), emulator.ip], stdout=subprocess.PIPE, text=True)
    with parent:
        worker = Path('/proc') / parent.stdout.readline().strip()
        wait_for(emulator.moves)
        parent.kill()
    record_property('stopped_s', wait_for(emulator.rests))
    wait_for(lambda: not worker.exists())
    again = UrArm(UrArmParams(ip=emulator.ip))
    again.connect()
    keep(again, SLIDING, emulator.moves)
    again.close()


@needs_ur_rtde
def test_a_controller_that_was_killed_is_reported_and_reached_again_when_it_is_back():
    emulator = EmulatedRig('127.0.0.51')
    arm = UrArm(UrArmParams(ip=emulator.ip))
    try:
        emulator.controller.start()
        arm.connect()
        keep(arm, SLIDING, emulator.moves)
        emulator.controller.stop()
        wait_for(lambda: faulty(arm) != '')
        wait_for(lambda: 'connection to the controller was lost' in faulty(arm))
        arm.close()
        with pytest.raises(DeviceError, match='nothing listens'):
            arm.connect()
        emulator.controller.start()
        arm.connect()
        keep(arm, SLIDING, emulator.moves)
    finally:
        arm.close()
        emulator.close()


@needs_ur_rtde
def test_nobody_there_is_said_in_a_sentence():
    with pytest.raises(DeviceError, match=r"nothing listens on 127\.0\.0\.52:30004; .* 'ip'"):
        UrArm(UrArmParams(ip='127.0.0.52')).connect()


@needs_ur_rtde
def test_a_controller_that_takes_connections_but_never_answers_blocks_nobody(record_property):
    arm = UrArm(UrArmParams(ip='127.0.0.53', probe_timeout_s=0.5))
    with listener('127.0.0.53'), Ticker() as ticker:
        begin_s = time.monotonic()
        with pytest.raises(DeviceError, match=r'does not answer as a UR controller within 0\.5 s'):
            arm.connect()
        connect_s = time.monotonic() - begin_s
    record_property('connect_s', connect_s)
    assert connect_s < 2.0
    assert ticker.worst_s < 1.0


@needs_ur_rtde
def test_a_controller_that_hangs_in_the_handshake_blocks_nobody_and_leaves_no_process(record_property):
    arm = UrArm(UrArmParams(ip='127.0.0.54', connect_timeout_s=1.0))
    with listener('127.0.0.54', serve=answer_version), Ticker() as ticker:
        begin_s = time.monotonic()
        with pytest.raises(DeviceError, match=r'stopped answering|did not let the arm be ready within 1 s'):
            arm.connect()
        record_property('connect_s', time.monotonic() - begin_s)
    assert ticker.worst_s < 1.0
    assert not [process for process in commands() if b'ur_worker' in process and b'127.0.0.54' in process]


@pytest.mark.parametrize(
    ('answers', 'sentence'),
    [
        (['Robotmode: POWER_OFF'], 'switch it on and release its brakes'),
        (['Robotmode: RUNNING', 'false'], 'switch the pendant to remote control'),
        (['Robotmode: RUNNING', 'true', 'Safetymode: ROBOT_EMERGENCY_STOP'], r'\(ROBOT_EMERGENCY_STOP\); find out why'),
    ],
)
def test_an_arm_that_is_not_ready_is_refused_with_what_to_do(answers, sentence):
    def rtde(server):
        connection, _ = server.accept()
        connection.recv(5)
        connection.sendall(struct.pack('>HBB', 4, 86, 1))
        connection.recv(3)
        connection.sendall(struct.pack('>HB4I', 19, 118, 5, 12, 0, 0))

    def dashboard(server):
        connection, _ = server.accept()
        lines = connection.makefile('rw')
        for line in ['Connected: Universal Robots Dashboard Server', *answers]:
            lines.write(line + '\n')
            lines.flush()
            lines.readline()

    ip = '127.0.0.55'
    with listener(ip, serve=rtde), listener(ip, 29999, serve=dashboard), pytest.raises(DeviceError, match=sentence):
        UrArm(UrArmParams(ip=ip)).connect()


def test_without_ur_rtde_the_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: None)
    with pytest.raises(DeviceError, match=r'pip install ur-rtde==1\.6\.5'):
        UrArm().connect()


def test_an_arm_that_was_never_connected_says_so():
    arm = UrArm()
    for call in (arm.state, arm.stop, arm.recover, lambda: arm.command(SLIDING)):
        with pytest.raises(DeviceError, match='connect it first'):
            call()
    arm.close()


def test_the_page_lists_the_parameters_as_they_are():
    assert markdown_table(Params) in PAGE.read_text()


@contextlib.contextmanager
def fieldbus(ip, registers):
    """Claim registers as an adapter of EtherNet/IP or PROFINET does, which no client may write then."""
    with contextlib.closing(TcpConnection(ip, RTDE_PORT, DEADLINE_S)) as line:
        _ask(line, REQUEST_VERSION, struct.pack('>H', PROTOCOL_VERSION))
        names = ','.join(f'input_int_register_{number}' for number in registers)
        assert b'IN_USE' not in _ask(line, SETUP_INPUTS, names.encode())
        yield


@needs_ur_rtde
def test_beside_a_fieldbus_the_upper_registers_are_used_and_the_lower_ones_left_alone(emulator):
    upper = UrArm(UrArmParams(ip=emulator.ip, upper_range_registers=True))
    with fieldbus(emulator.ip, range(24)):
        upper.connect()
        try:
            before_m = upper.state().position[0]
            keep(upper, SLIDING, lambda: upper.state().position[0] > before_m + 0.005)
            upper.stop()
            wait_for(emulator.rests)
            assert upper.state().fault == ''
        finally:
            upper.close()


@needs_ur_rtde
def test_without_the_upper_registers_a_fieldbus_that_holds_the_lower_ones_is_an_error(emulator):
    lower = UrArm(UrArmParams(ip=emulator.ip))
    with fieldbus(emulator.ip, range(24)), pytest.raises(DeviceError):
        lower.connect()
    lower.close()

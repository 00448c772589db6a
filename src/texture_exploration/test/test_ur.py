# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The UR arm through the unmodified ur-rtde, on the emulated controller: a process of its own on a loopback address.

What befalls it in a slide is in test_faults, what every arm refuses in test_arms.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from pathlib import Path

import numpy as np
import pytest

from texture_core.errors import CommandRefused, DeviceError
from texture_core.types import ExplorationRequest, FingerReceiver, Phase
from texture_exploration.arms import ur
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.ur import UrArm, UrArmParams
from texture_exploration.explorer import Explorer
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import REACTION_S, TouchParams
from texture_simulation.devices.ur import ControllerProcess, UrControllerParams

pytestmark = [
    pytest.mark.realtime,
    pytest.mark.skipif(importlib.util.find_spec('rtde_control') is None, reason='ur-rtde is not installable here'),
]

DEADLINE_S = 30.0
PARENT = Path(__file__).with_name('ur_parent.py')


SLIDING = ArmCommand(tangential_m_s=(0.02, 0.0))
UNLOCK_S = 0.2
SURFACE_Z_M = 0.108  # 8 mm above its declared place


class EmulatedRig:
    """The emulated controller, and the true state of its finger, as it is sent to the emulator."""

    def __init__(self, ip):
        self._folder = tempfile.TemporaryDirectory()
        path = f'{self._folder.name}/finger'
        self._pipe = FingerReceiver(path)
        self.ip = ip
        self.controller = ControllerProcess(
            UrControllerParams(ip=ip, finger_pipe=path, unlock_delay_s=UNLOCK_S, surface_z_m=SURFACE_Z_M)
        )
        self.fingers = deque(maxlen=50000)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._receive_states, daemon=True)
        self._thread.start()

    def _receive_states(self):
        while not self._closing.is_set():
            self.fingers += self._pipe.states(0.1)

    def since(self, time_ns):
        return [finger for finger in list(self.fingers) if finger.time_ns >= time_ns]

    def moves(self):
        return abs(self.fingers[-1].vx_m_s) > 0.01

    def rests(self):
        finger = self.fingers[-1]
        return finger.vx_m_s == finger.vy_m_s == finger.vz_m_s == 0.0

    def __enter__(self):
        self.controller.start()
        return self

    def __exit__(self, *_):
        self.controller.stop()
        self._closing.set()
        self._thread.join()
        self._pipe.close()
        self._folder.cleanup()


@pytest.fixture(scope='module')
def emulator():
    with EmulatedRig('127.0.0.50') as emulator:
        yield emulator


@contextlib.contextmanager
def connected(emulator, **values):
    patient = {'connect_timeout_s': 60.0, **values}  # with a busy machine, which starts the worker late
    arm = UrArm(UrArmParams(ip=emulator.ip, **patient))
    try:
        arm.connect()
        yield arm
    finally:
        arm.close()


@pytest.fixture
def arm(emulator):
    with connected(emulator) as arm:
        yield arm


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


def zero(arm):
    """Rise in free air and rest, until the force sensor is zeroed."""
    height_m = arm.state().position[2]
    keep(arm, ArmCommand(normal_m_s=0.02), lambda: arm.state().position[2] > height_m + 0.008)
    arm.stop()
    wait_for(lambda: arm.zeroed)


def faulty(arm):
    """Return what is wrong with the arm, '' if nothing is."""
    try:
        return arm.state().fault
    except DeviceError as error:
        return str(error)


def commands():
    """Yield the command line of every process."""
    for path in Path('/proc').glob('[0-9]*/cmdline'):
        with contextlib.suppress(OSError):
            yield path.read_bytes()


@contextlib.contextmanager
def listener(ip, port, serve=None):
    """Someone who takes connections and, by default, never answers."""
    with socket.create_server((ip, port)) as server:
        if serve is not None:
            threading.Thread(target=serve, args=(server,), daemon=True).start()
        yield


READY = ['URSoftware 5.12.0', 'Robotmode: RUNNING', 'true', 'Safetymode: NORMAL', 'Program running: false', 'STOPPED']


def dashboard(answers):
    """Return a server that greets as a dashboard and gives these answers to each client, one after the other."""
    left = iter(answers)

    def serve(server):
        with contextlib.suppress(OSError):
            while True:
                connection, _ = server.accept()
                lines = connection.makefile('rw')
                lines.write('Connected: Universal Robots Dashboard Server\n')
                lines.flush()
                while lines.readline():
                    lines.write(next(left) + '\n')
                    lines.flush()

    return serve


def test_it_touches_holds_2_newtons_slides_20_mm_at_20_mm_s_and_lifts(emulator, record_property):
    phases = []
    explorer = Explorer(
        UrArm(UrArmParams(ip=emulator.ip)),
        TouchParams(peak_speed_fraction=3.4),  # emulated, it makes up for up to 0.1 s; the speed is measured below
        SafetyLimits(state_timeout_s=1.0),  # a busy machine may hold the process up; silence is tested below
        lambda state: phases.append((state.stamp_ns, state.phase)),
    )
    home = explorer.connect()
    try:
        request = ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=2.0, distance_m=0.02)
        exploration = explorer.begin('one', request)
        assert exploration.ended.wait(DEADLINE_S)
        assert exploration.outcome.success, exploration.outcome.message
        end = explorer.arm.state()
        assert explorer.arm.warning() == ''  # nothing was refused
    finally:
        explorer.close()
    begin_ns = min(stamp for stamp, phase in phases if phase is Phase.SLIDE)
    end_ns = min(stamp for stamp, phase in phases if phase is Phase.LIFT)
    slide = [finger for finger in emulator.since(begin_ns) if finger.time_ns < end_ns]
    times_s = np.array([finger.time_ns for finger in slide]) * 1e-9
    places_m = np.array([finger.x_m for finger in slide])
    forces_n = np.array([finger.force_n for finger in slide])
    speed_m_s = np.polyfit(times_s - times_s[0], places_m, 1)[0]
    record_property('speed_m_s', float(speed_m_s))
    record_property('force_n', float(forces_n.mean()))
    assert speed_m_s == pytest.approx(0.02, rel=0.02)
    assert np.all(np.abs(forces_n - 2.0) <= 0.1)
    assert places_m[-1] - places_m[0] == pytest.approx(0.02, abs=0.001)
    # In a pause of the machine, of which steps too late tell, it goes on being lifted.
    assert -0.001 < end.position[2] - home[2] < (0.004 if explorer.counts['late_steps'] else 0.001)
    assert abs(end.force_n) < 0.2


def test_commands_and_states_are_in_the_frame_of_the_surface(emulator):
    with connected(emulator, surface_ry_rad=np.pi / 2) as wall:  # its z is the x of the base
        before = emulator.fingers[-1]
        goal_m = wall.state().position[2] + 0.01
        keep(wall, ArmCommand(normal_m_s=0.02), lambda: wall.state().position[2] > goal_m)
        wall.stop()
        wait_for(emulator.rests)
        after = emulator.fingers[-1]
    assert after.x_m - before.x_m > 0.0099
    assert (after.y_m, after.z_m) == pytest.approx((before.y_m, before.z_m), abs=1e-6)


def test_a_protective_stop_is_a_fault_that_recover_clears_for_a_new_connection(arm, emulator):
    keep(arm, SLIDING, emulator.moves)
    emulator.controller.ask('emulate protective stop')
    wait_for(lambda: faulty(arm) == 'protective stop')
    wait_for(emulator.rests)
    arm.recover()
    arm.connect()
    assert faulty(arm) == ''
    keep(arm, SLIDING, emulator.moves)


def test_connecting_releases_no_protective_stop(arm, emulator):
    emulator.controller.ask('emulate protective stop')
    arm.close()
    with pytest.raises(DeviceError, match=r'held by its safety system \(PROTECTIVE_STOP\); find the cause'):
        arm.connect()
    wait_for(lambda: 'releasing' in emulator.controller.ask('unlock protective stop'))  # as a person at the pendant


def test_a_worker_that_is_killed_leaves_the_arm_to_the_watchdog_and_the_controller_to_the_next(
    arm, emulator, record_property
):
    keep(arm, SLIDING, emulator.moves)
    os.kill(arm._link.process.pid, signal.SIGKILL)
    record_property('stopped_s', wait_for(emulator.rests))
    wait_for(lambda: 'connect again' in faulty(arm))
    with pytest.raises(DeviceError, match='connect again'):
        arm.command(SLIDING)
    for _ in range(2):  # the second time with the program of the killed process still there
        arm.close()
        arm.connect()
        keep(arm, SLIDING, emulator.moves)
        os.kill(arm._link.process.pid, signal.SIGKILL)


def test_a_worker_that_hangs_is_killed_when_the_arm_is_closed(arm, emulator):
    keep(arm, SLIDING, emulator.moves)
    worker = arm._link.process.pid
    os.kill(worker, signal.SIGSTOP)
    wait_for(emulator.rests)  # the watchdog
    begin_s = time.monotonic()
    arm.close()
    assert time.monotonic() - begin_s < 5.0
    assert not Path(f'/proc/{worker}').exists()


def test_a_worker_that_does_not_read_is_silent_and_a_stop_that_it_cannot_get_is_named(arm):
    worker = arm._link.process.pid
    os.kill(worker, signal.SIGSTOP)
    try:
        wait_for(lambda: time.monotonic_ns() - arm.state().time_ns > 200_000_000)
        for _ in range(3000):  # more than the line holds
            arm.command(SLIDING)
        with pytest.raises(DeviceError, match='does not read a stop'):
            arm.stop()
    finally:
        os.kill(worker, signal.SIGCONT)


def test_when_the_parent_is_killed_the_arm_stops_and_the_worker_ends(emulator, record_property):
    parent = subprocess.Popen([sys.executable, str(PARENT), emulator.ip], stdout=subprocess.PIPE, text=True)
    with parent:
        worker = Path('/proc') / parent.stdout.readline().strip()
        wait_for(emulator.moves)
        parent.kill()
    record_property('stopped_s', wait_for(emulator.rests))
    wait_for(lambda: not worker.exists())
    with connected(emulator) as again:
        keep(again, SLIDING, emulator.moves)


REFUSED = [  # who takes connections: nobody, one who never answers, a dashboard with these answers
    (None, r"nothing listens on 127\.0\.1\.0:29999; .* 'ip'"),
    ([], r'does not answer as a UR controller within 1\.5 s'),
    (['Robotmode: POWER_OFF'], 'switch it on and release its brakes'),
    (['Robotmode: RUNNING', 'false'], 'switch the pendant to remote control'),
    (['Robotmode: RUNNING', 'true', 'Safetymode: ROBOT_EMERGENCY_STOP'], r'\(ROBOT_EMERGENCY_STOP\); find'),
]


@pytest.mark.parametrize('number', range(len(REFUSED)))
def test_a_controller_that_is_not_there_or_not_ready_is_refused_within_3_s_with_what_to_do(number):
    answers, sentence = REFUSED[number]
    ip = f'127.0.1.{number}'  # the server of the case before may still hold its port
    serve = dashboard(['URSoftware 5.12.0', *answers]) if answers else None
    begin_s = time.monotonic()
    with contextlib.nullcontext() if answers is None else listener(ip, 29999, serve):
        with pytest.raises(DeviceError, match=sentence):
            UrArm(UrArmParams(ip=ip)).connect()
        assert time.monotonic() - begin_s < 3.0


def test_a_controller_that_hangs_in_the_handshake_is_named_and_leaves_no_process():
    ip = '127.0.0.54'
    refused = pytest.raises(DeviceError, match=r'stopped answering|did not let the arm be ready within 1 s')
    with listener(ip, 30004), listener(ip, 29999, dashboard(READY)), refused:
        UrArm(UrArmParams(ip=ip, connect_timeout_s=1.0)).connect()
    assert not [process for process in commands() if b'ur_worker' in process and ip.encode() in process]


# --------------------
# What would hurt the finger or the sample, with the true force from outside.

PRESSING = ArmCommand(force_n=3.0)


def press(arm, emulator):
    """Press until the arm holds 3 N by its sensor; return the true force."""
    held = deque(maxlen=50)

    def settled():
        held.append(arm.state().force_n)
        return len(held) == 50 and all(abs(force - 3.0) < 0.2 for force in held)

    keep(arm, PRESSING, settled)
    return emulator.fingers[-1].force_n


def gap(arm, emulator):
    """Command nothing for longer than a command holds."""
    time.sleep(2 * UrArmParams().command_timeout_s)
    wait_for(emulator.rests)


def protective_stop(arm, emulator):
    emulator.controller.ask('emulate protective stop')
    wait_for(lambda: arm.state().fault == 'protective stop')
    arm.recover()
    arm.connect()
    zero(arm)


@pytest.mark.parametrize('between', [gap, protective_stop])
def test_the_force_is_zeroed_in_free_air_alone_and_the_same_one_is_pressed_again(arm, emulator, between):
    begin_ns = time.monotonic_ns()
    zero(arm)
    forces = [press(arm, emulator)]
    for _ in range(2):
        between(arm, emulator)
        forces.append(press(arm, emulator))
    assert forces == [pytest.approx(3.0, abs=0.3)] * 3
    assert max(finger.force_n for finger in emulator.since(begin_ns)) < 4.5


def test_who_connects_in_contact_may_not_press_before_the_force_sensor_is_zeroed_in_free_air(emulator):
    with connected(emulator) as arm:
        zero(arm)
        press(arm, emulator)
    assert emulator.fingers[-1].force_n > 2.0
    begin_ns = time.monotonic_ns()
    with connected(emulator) as arm:
        with pytest.raises(CommandRefused, match='the force sensor is not zeroed'):
            arm.command(PRESSING)
        zero(arm)
        assert press(arm, emulator) == pytest.approx(3.0, abs=0.3)
        arm.stop()
        zero(arm)
    forces_n = [finger.force_n for finger in emulator.since(begin_ns)]
    assert (min(forces_n), max(forces_n) < 4.5) == (0.0, True)


def test_after_a_slow_acknowledgement_the_watchdog_guards_the_moving_arm_as_before(arm, emulator):
    assert emulator.controller.ask('emulate slow 0.3') == 'set to 0.3 seconds'
    zero(arm)
    keep(arm, SLIDING, emulator.moves)
    os.kill(arm._link.process.pid, signal.SIGSTOP)
    begin = emulator.fingers[-1]
    try:
        wait_for(emulator.rests)
    finally:
        os.kill(arm._link.process.pid, signal.SIGCONT)
        emulator.controller.ask('emulate slow 0')
    # The watchdog waits 100 ms; what is more is this machine, but not the second that it waits for a stop.
    assert emulator.fingers[-1].x_m - begin.x_m < 0.02 * 0.5
    assert emulator.controller.ask('programState').startswith('STOPPED')


ASKED_N = 1.4  # at 2 kN/m the finger comes down at 8 mm/s; only the watchdog forbids to come down faster


def hold_up(process_id, seconds):
    os.kill(process_id, signal.SIGSTOP)
    try:
        time.sleep(seconds)
    finally:
        os.kill(process_id, signal.SIGCONT)


def touches(finger):
    """Return whether the finger comes down and is about to meet the surface."""
    return finger.vz_m_s < -0.003 and finger.z_m < 0.0002


DEAFNESS = {
    'the line to the controller falls silent': lambda emulator, arm: emulator.controller.ask('emulate silence 1.0'),
    'the process that talks to it hangs': lambda emulator, arm: hold_up(arm._link.process.pid, 1.0),
    'the controller is held up': lambda emulator, arm: hold_up(emulator.controller.pid, 0.6),
}


@pytest.mark.parametrize(('what', 'late_s'), list(zip(DEAFNESS, (0.4, 0.0, 0.4), strict=True)))
def test_an_approach_that_hears_nothing_from_the_contact_on_presses_little_harder_than_asked(what, late_s):
    """Asked: 1.5 times the wanted force; a busy machine may hold the emulated watchdog up for another 0.1 s."""
    with EmulatedRig('127.0.0.83') as emulator:
        arm = UrArm(UrArmParams(ip=emulator.ip, connect_timeout_s=60.0))
        explorer = Explorer(arm, TouchParams(), SafetyLimits(state_timeout_s=1.0), lambda state: None)
        explorer.connect()
        try:
            emulator.controller.ask(f'emulate slow {late_s}')
            request = ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=ASKED_N, distance_m=0.02)
            for _ in range(5):  # a busy machine may miss the moment, of some 25 ms
                exploration = explorer.begin('one', request)
                wait_for(lambda ended=exploration.ended: touches(emulator.fingers[-1]) or ended.is_set())
                if not exploration.ended.is_set():
                    break
            assert not exploration.ended.is_set(), exploration.outcome
            down_m_s = -emulator.fingers[-1].vz_m_s
            DEAFNESS[what](emulator, arm)
            assert exploration.ended.wait(DEADLINE_S)
            assert 2000.0 * down_m_s * (0.1 + REACTION_S) < 1.6 * ASKED_N
            assert max(finger.force_n for finger in list(emulator.fingers)) < 2.7 * ASKED_N
        finally:
            explorer.close()


def test_a_command_towards_the_surface_holds_no_longer_than_the_watchdog_waits(arm, emulator):
    keep(arm, ArmCommand(normal_m_s=0.02), lambda: emulator.fingers[-1].z_m > 0.03)
    for direction, least_s, most_s in ((1, 0.15, 0.5), (-1, 0.03, 0.15)):
        arm.stop()
        wait_for(emulator.rests)
        moving = ArmCommand(normal_m_s=0.02 * direction)
        keep(arm, moving, lambda way=direction: emulator.fingers[-1].vz_m_s * way > 0.019)
        arm.command(moving)
        begin_m = emulator.fingers[-1].z_m
        wait_for(emulator.rests)
        held_s = abs(emulator.fingers[-1].z_m - begin_m) / 0.02
        assert least_s < held_s < most_s


def test_a_program_of_somebody_else_is_not_stopped(emulator):
    ask = emulator.controller.ask
    with connected(emulator) as arm:
        keep(arm, SLIDING, emulator.moves)
        ask('stop')
        wait_for(lambda: arm.state().fault.startswith('its control program was stopped'))
        ask('load external_control.urp')
        assert ask('play') == 'Starting program'
        wait_for(lambda: 'another user started one' in faulty(arm))
    another = r"another program is on the controller at .* \('PLAYING external_control\.urp'\).*stop it on the pendant"
    for refused in (another, 'PAUSED external_control'):
        with pytest.raises(DeviceError, match=refused):
            UrArm(UrArmParams(ip=emulator.ip)).connect()
        assert ask('programState').endswith(' external_control.urp')
        ask('pause')
    ask('stop')


def test_a_second_program_on_this_machine_or_on_another_is_refused(arm, emulator, monkeypatch):
    with pytest.raises(DeviceError, match='another process on this machine commands the arm'):
        UrArm(UrArmParams(ip=emulator.ip)).connect()
    monkeypatch.setattr(ur, 'claim', lambda *_: os.open(os.devnull, os.O_RDONLY))  # as on another machine
    with pytest.raises(DeviceError, match=r"another program is on the controller .*'PLAYING rtde_control'"):
        UrArm(UrArmParams(ip=emulator.ip)).connect()
    assert (arm.state().fault, arm.warning()) == ('', '')

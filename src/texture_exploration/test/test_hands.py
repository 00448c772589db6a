# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""Hands of Dynamixel motors, through the unmodified dynamixel-sdk on an emulated bus.

They hold and slide; whatever ends the command of motors ends their torque, and what is wrong with them is named.
"""

import contextlib
import itertools
import math
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import serial

from texture_core.config import find_file, load_yaml
from texture_core.errors import CommandRefused, DeviceError, InvalidParameter, UnknownName
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms import hand as hands
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.dynamixel import DynamixelBus
from texture_exploration.arms.hand import load_profile, read_profile
from texture_exploration.arms.in_hand import DynamixelFinger, InHandArm, InHandParams
from texture_exploration.explorer import Explorer
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams
from texture_simulation.devices.dynamixel import (
    GOAL_CURRENT,
    GOAL_POSITION,
    MODE,
    OVERLOAD,
    PING,
    READ,
    TORQUE,
    TRIPPED,
    WATCHDOG,
    EmulatedDynamixelBus,
    leap_hand,
)

pytestmark = pytest.mark.realtime
DEADLINE_S = 30.0
LEAP = load_profile('leap')
REBOOT_IT = (
    "motor 1 ('press' of index) reports overload; when it has cooled and nothing blocks it, call `texture recover`, "
    'or switch its power off and on'
)
THUMB = LEAP.fingers['thumb']['press'].id
PARENT = """
import sys, time
from texture_exploration.arms.in_hand import InHandArm, InHandParams

hand = InHandArm(InHandParams(device=sys.argv[1], grip_timeout_s=20.0))
hand.connect()
print('connected', flush=True)
time.sleep(600)
"""

pytest.importorskip('dynamixel_sdk')


def until(condition):
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def fault_of(hand):
    try:
        return hand.state().fault
    except DeviceError as error:
        return str(error)


def torque_is_off(bus):
    return not any(table[TORQUE] for table in bus.motors.tables.values())


def register(bus, motor, address):
    return int.from_bytes(bus.motors.tables[motor][address : address + 2], 'little')


@pytest.fixture(autouse=True)
def patience(monkeypatch):
    """On a busy machine the emulated motors may be late more often than real ones are."""
    monkeypatch.setattr('texture_exploration.arms.dynamixel.TRIES', 12)


@pytest.fixture
def bus(tmp_path):
    with EmulatedDynamixelBus(tmp_path / 'bus', leap_hand()) as made:
        yield made


@pytest.fixture
def hand(bus):
    made = arm_on(bus)
    yield made
    made.close()


def arm_on(bus, **params):
    return InHandArm(InHandParams(device=str(bus.port.link), grip_timeout_s=20.0, **params))


@pytest.fixture
def parent(bus):
    """A process that grips with the thumb, once the thumb has the object."""
    command = [sys.executable, '-c', PARENT, str(bus.port.link)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == 'connected\n'
            until(lambda: bus.motors.forces_n[THUMB] > 1.8)
            yield process
        finally:
            process.kill()


def test_a_failed_connection_leaves_no_motor_under_torque(bus, hand):
    bus.motors.fail(THUMB, OVERLOAD)
    with pytest.raises(DeviceError, match=r"motor 13 \('press' of thumb\) reports overload; .*call `texture recover`"):
        hand.connect()
    assert torque_is_off(bus)


@pytest.mark.filterwarnings('ignore::pytest.PytestUnhandledThreadExceptionWarning')  # it is raised on purpose
def test_an_error_in_the_program_lets_go_and_is_reported(bus, hand, monkeypatch):
    hand.connect()
    monkeypatch.setattr(DynamixelFinger, 'goals', lambda *_arguments: 1 / 0)
    until(lambda: 'error in its program (ZeroDivisionError' in fault_of(hand))
    until(lambda: torque_is_off(bus))


def test_a_process_that_is_killed_leaves_no_motor_under_torque_and_the_hand_to_the_next(bus, parent, hand):
    parent.send_signal(signal.SIGKILL)
    until(lambda: torque_is_off(bus))
    hand.connect()
    until(lambda: fault_of(hand) == '')


def test_a_process_that_hangs_is_noticed_by_the_motors_and_the_force_runs_out(bus, parent):
    parent.send_signal(signal.SIGSTOP)
    until(lambda: all(table[WATCHDOG] == TRIPPED for table in bus.motors.tables.values()))
    # The goal is now where the motor was, and its gain holds against the object: k·l² = 16 N·m/rad, gain 1.6 N·m/rad.
    until(lambda: bus.motors.forces_n[THUMB] < 0.25 * 2.0)


def test_a_cable_that_is_pulled_out_stops_the_motors(bus, hand):
    hand.connect()
    bus.unplug()
    until(lambda: 'cannot be reached' in fault_of(hand))
    until(lambda: all(table[WATCHDOG] == TRIPPED for table in bus.motors.tables.values()))
    with pytest.raises(DeviceError, match='check that it is plugged in'):
        hand.connect()
    bus.plug()
    hand.connect()
    until(lambda: fault_of(hand) == '')
    assert {table[WATCHDOG] for table in bus.motors.tables.values()} == {15}  # 0.3 s


def test_motors_that_were_stopped_by_their_watchdog_are_a_named_fault(bus, hand):
    hand.connect()
    bus.motors.tables[5][WATCHDOG] = TRIPPED
    until(lambda: "motor 5 ('press' of middle) got no message for 0.3 s, and its watchdog stopped it" in fault_of(hand))
    until(lambda: torque_is_off(bus))


def test_no_more_current_is_asked_for_than_a_motor_takes(bus, hand):
    bus.motors.write(1, 38, (100).to_bytes(2, 'little'))
    hand.connect()
    until(lambda: register(bus, 1, GOAL_CURRENT) == 100)  # and not 350, of the profile
    with pytest.raises(CommandRefused, match=r'the Current Limit of its motor allows 0\.574 N'):  # 0.1 A · 0.517 / 0.09
        hand.command(ArmCommand(force_n=1.0))
    until(lambda: fault_of(hand) == '')
    hand.close()
    bus.motors.write(THUMB, 38, (100).to_bytes(2, 'little'))
    with pytest.raises(CommandRefused, match='the force is 2 N, and the Current Limit'):
        arm_on(bus).connect()
    assert torque_is_off(bus)


def test_a_goal_that_a_motor_refuses_is_a_named_fault(bus, hand):
    hand.connect()
    bus.motors.tables[1][38:40] = (50).to_bytes(2, 'little')  # lowered behind the program's back

    def refused():
        with contextlib.suppress(DeviceError):  # of a hand that was released
            hand.command(ArmCommand(force_n=1.0))
        return "motor 1 ('press' of index) did not accept 'goal_current'" in fault_of(hand)

    until(refused)
    assert 'exceeds the limit' in fault_of(hand)
    until(lambda: torque_is_off(bus))


REFUSED = [
    ('xm430', {'model': 1030}, r'model 1030 \(XM430-W210\) makes 1\.30 N·m/A, and the profile says 1\.78 N·m/A'),
    ('xm430', {'model': 35074}, r'known are 1000 \(XH430-W350\)'),
    *[
        ('leap', {'fingers': {'thumb': {'press': {'id': 13, 'lever_m': lever_m}}}}, r'lever_m is .* 0\.001 to 0\.3')
        for lever_m in (-1.0, 0.0, 0.5)
    ],
    *[('leap', {'watchdog_s': time_s}, r'allowed are 0\.02 to 2\.54 s') for time_s in (-1.0, 0.001, 3.0, math.nan)],
]


@pytest.mark.parametrize(('name', 'changed', 'sentence'), REFUSED)
def test_a_profile_that_contradicts_its_motors_is_refused(name, changed, sentence):
    content = load_yaml(find_file(name, 'texture_exploration', 'config/hands', 'hand profile'), 'hand profile')
    merged = {key: {**content[key], **one} if isinstance(one, dict) else one for key, one in changed.items()}
    with pytest.raises(InvalidParameter, match=sentence):
        read_profile({**content, **merged}, 'mine')


@pytest.mark.parametrize('wrong', [math.nan, -1e9, pytest.param(10**400, id='400 digits')])
def test_every_number_of_a_profile_has_a_range(monkeypatch, wrong):
    content = load_yaml(find_file('leap', 'texture_exploration', 'config/hands', 'hand profile'), 'hand profile')
    monkeypatch.setattr(hands, 'load_yaml', lambda *_: content)

    def check(part):
        for key, right in list(part.items() if isinstance(part, dict) else enumerate(part)):
            if isinstance(right, (dict, list)):
                check(right)
            elif not isinstance(right, str):
                part[key] = wrong
                with pytest.raises(InvalidParameter, match="hand profile 'leap"):
                    load_profile('leap')
                part[key] = right

    check(content)
    assert load_profile('leap') == LEAP


@pytest.mark.parametrize('address', [WATCHDOG, GOAL_CURRENT, MODE])
def test_a_motor_that_does_not_keep_what_bounds_its_force_is_refused(bus, hand, monkeypatch, address):
    write = bus.motors.write
    monkeypatch.setattr(bus.motors, 'write', lambda motor, at, data: 0 if at == address else write(motor, at, data))
    with pytest.raises(DeviceError, match='what bounds its force is not armed'):
        hand.connect()
    assert torque_is_off(bus)


@pytest.mark.parametrize(
    'lost', [(TORQUE, WATCHDOG), (WATCHDOG,)], ids=['off', "drive mode 'torque on by goal update'"]
)
def test_a_motor_that_was_reset_is_named_and_driven_again_after_a_new_connection(bus, hand, lost):
    hand.connect()
    for address in lost:
        bus.motors.tables[5][address] = 0
    until(lambda: "motor 5 ('press' of middle) has lost its torque" in fault_of(hand))
    assert bus.motors.tables[1][TORQUE]
    hand.connect()
    assert fault_of(hand) == ''
    assert (bus.motors.tables[5][TORQUE], bus.motors.tables[5][WATCHDOG]) == (1, 15)


def test_a_second_program_is_refused_before_it_opens_the_line_and_empties_its_buffer(bus, hand, monkeypatch):
    hand.connect()
    second, opened = arm_on(bus), []
    monkeypatch.setattr('dynamixel_sdk.PortHandler.openPort', lambda port: opened.append(port) or True)
    for ask in (second.connect, second.recover):
        with pytest.raises(DeviceError, match='no other program has it open'):
            ask()
    assert not opened
    until(lambda: fault_of(hand) == '')
    assert all(table[TORQUE] for table in bus.motors.tables.values())


def test_a_late_answer_to_a_ping_is_not_taken_for_a_position(bus, hand, monkeypatch):
    answer, write, goals = bus._one, bus.motors.write, []

    def late(motor, instruction, params):
        pong = answer(motor, PING, b'') if motor == 1 and instruction == READ else b''
        return pong + answer(motor, instruction, params)

    def record(motor, address, data):
        if (motor, address) == (1, GOAL_POSITION):
            goals.append(int.from_bytes(data, 'little', signed=True))
        return write(motor, address, data)

    monkeypatch.setattr(bus, '_one', late)
    monkeypatch.setattr(bus.motors, 'write', record)
    hand.connect()
    assert goals[0] == 2048  # where the motor is; three bytes of a pong and one of its checksum are another number


def test_two_motors_with_one_id_are_named(bus, hand):
    bus.motors.twice = {5}
    hand.connect()
    assert re.search(r"motor 5 \('press' of middle\) answers with data that .* two motors have this id", fault_of(hand))


def test_firmware_whose_watchdog_is_known_not_to_stop_the_motor_is_refused(bus, hand):
    bus.motors.tables[5][6] = 51
    with pytest.raises(DeviceError, match=r"motor 5 \('press' of middle\) has the firmware 51, .*; update it with"):
        hand.connect()
    assert not any(table[64] for table in bus.motors.tables.values())  # the torque of all is off


def test_a_motor_with_a_latched_error_is_rebooted_by_a_recovery_and_one_that_keeps_it_is_named(bus, monkeypatch):
    bus.motors.fail(1, OVERLOAD)
    explorer = Explorer(arm_on(bus), TouchParams(), SafetyLimits(), lambda state: None)
    with pytest.raises(DeviceError, match='reports overload'):
        explorer.connect()
    explorer.recover()
    assert explorer.fault() == ''
    explorer.close()
    assert torque_is_off(bus)
    monkeypatch.setattr('texture_exploration.arms.dynamixel.RESTART_S', 0.2)
    monkeypatch.setattr(bus.motors, 'reboot', lambda _motor: None)
    bus.motors.fail(1, OVERLOAD)
    with pytest.raises(
        DeviceError, match=r'motor 1 .* still reports overload after a reboot; .*, switch its power off'
    ):
        Explorer(arm_on(bus), TouchParams(), SafetyLimits(), lambda state: None).recover()


def test_the_guard_sends_what_the_sdk_would_send(tmp_path):
    master, slave = os.openpty()
    with serial.Serial(os.ttyname(slave)):  # raw
        line = DynamixelBus(os.ttyname(slave), LEAP)
        line.torque_off(LEAP.ids)
        assert os.read(master, 1000) == line.torque_off_packet()
        line.close()
    os.close(slave)
    os.close(master)


def test_a_late_cycle_is_made_good_without_a_jerk(bus, hand, monkeypatch):
    """One cycle in twenty is 40 ms late; goals advance by at most 1.25 times the speed, and by the whole way."""
    hand.connect()
    read, write, cycles, goals = DynamixelBus.read, DynamixelBus.write_goals, itertools.count(), []
    along = LEAP.fingers['index']['along']

    def late(self):
        if next(cycles) % 20 == 0:
            time.sleep(0.04)
        return read(self)

    def noted(self, asked):
        goals.append(asked[along.id][1] * along.lever_m)
        write(self, asked)

    monkeypatch.setattr(DynamixelBus, 'read', late)
    monkeypatch.setattr(DynamixelBus, 'write_goals', noted)
    speed_m_s, begin_s = 0.01, time.monotonic()
    while time.monotonic() < begin_s + 1.0:
        hand.command(ArmCommand(tangential_m_s=(0.0, speed_m_s)))
        time.sleep(0.02)
    took_s = time.monotonic() - begin_s
    steps = np.diff(goals)
    assert steps.max() <= 1.25 * speed_m_s / LEAP.rate_hz * 1.001
    assert goals[-1] - goals[0] == pytest.approx(speed_m_s * took_s, abs=0.1 * speed_m_s)


def test_a_hand_refuses_what_exceeds_its_limits_and_goes_on(bus, hand):
    hand.connect()
    for force_n in (math.nan, math.inf, -1.0, 60.0):
        with pytest.raises(CommandRefused, match='was refused and the arm stopped: the force is'):
            hand.command(ArmCommand(force_n=force_n))
    for command in (ArmCommand(tangential_m_s=(math.nan, 0.0)), ArmCommand(normal_m_s=-5.0)):
        with pytest.raises(CommandRefused, match='was refused and the arm stopped: the speed'):
            hand.command(command)
    before = hand.state().time_ns
    until(lambda: hand.state().time_ns > before and hand.state().fault == '')


# --------------------
# Hold and slide.


def test_a_finger_that_loses_the_object_is_a_fault_that_names_it(bus):
    arm = arm_on(bus)
    arm.connect()
    bus.motors.stiffness_n_m = 0.0
    until(lambda: arm.state().fault.startswith('the grip is lost: thumb presses with'))
    arm.close()


def test_every_shipped_profile_can_be_read_and_a_broken_one_or_an_unknown_finger_set_is_reported(tmp_path):
    (tmp_path / 'mine.yaml').write_text('model: 1240\n')
    with pytest.raises(InvalidParameter, match="hand profile 'mine' cannot be read"):
        load_profile(str(tmp_path / 'mine.yaml'))
    with pytest.raises(UnknownName, match="did you mean 'kaboli-train'"):
        InHandArm(InHandParams(finger_set='kaboli-trane'))
    for name in ('leap', 'x330', 'xm430'):
        assert load_profile(name).ids
    assert len(LEAP.ids) == 16


def test_a_hand_holds_while_two_fingers_slide_and_lets_the_object_go_when_closed(bus, tmp_path):
    # A busy machine may hold the bus up; what the watchdog of the motors does then is tested above.
    patient = find_file('leap', 'texture_exploration', 'config/hands', 'hand profile').read_text()
    (tmp_path / 'patient.yaml').write_text(patient.replace('watchdog_s: 0.3', 'watchdog_s: 2.5'))
    arm, forces = arm_on(bus, profile=str(tmp_path / 'patient.yaml')), []

    def note(state):
        if state.phase is Phase.SLIDE:
            forces.append({name: bus.motors.forces_n[joints['press'].id] for name, joints in LEAP.fingers.items()})

    # The emulated bus makes up for up to 0.1 s that a busy machine lost: seen over 30 ms, up to 4.3 times as fast.
    touch = TouchParams(speed_tolerance=0.3, force_tolerance=0.2, peak_speed_fraction=3.4)
    explorer = Explorer(arm, touch, SafetyLimits(state_timeout_s=1.0), note)
    explorer.connect()
    exploration = explorer.begin('one', ExplorationRequest('in_hand_sliding', speed_m_s=0.02, duration_s=1.5))
    assert exploration.ended.wait(DEADLINE_S)
    explorer.close()
    assert exploration.outcome.success, exploration.outcome.message
    assert len(forces) > 20
    for name in ('thumb', 'ring'):
        assert np.mean([force[name] for force in forces]) == pytest.approx(2.0, rel=0.1)
    assert np.mean([force['index'] for force in forces]) == pytest.approx(1.0, rel=0.2)
    until(lambda: torque_is_off(bus))


def test_motors_that_do_not_answer_are_let_go_too(bus):
    line = DynamixelBus(str(bus.port.link), LEAP)
    line.start()
    line.missing = {5}
    line.torque_off(LEAP.ids)
    until(lambda: torque_is_off(bus))
    line.close()


def test_a_late_answer_to_an_earlier_question_is_not_taken_for_a_measurement(bus):
    line = DynamixelBus(str(bus.port.link), LEAP)
    line.start()
    late, receive = [bus._status(LEAP.ids[0], bytes(40))], bus.receive  # as of all from the torque to the goal
    bus.receive = lambda data: (late.pop() if late else b'') + receive(data)
    motors = line.read()
    assert line.missing == set()
    assert set(motors) == set(LEAP.ids)
    assert motors[LEAP.ids[0]].position_rad == pytest.approx(0.0, abs=0.01)  # zeros would be a turn of -180 degrees
    line.close()


def test_a_missing_motor_is_named_and_the_others_move_on(bus):
    hand = arm_on(bus)
    hand.connect()
    bus.motors.absent = {5}
    until(lambda: hand.state().fault == "motor 5 ('press' of middle) does not answer")
    before = hand.state().time_ns
    hand.command(ArmCommand(tangential_m_s=(0.02, 0.0)))
    until(lambda: hand.state().time_ns > before and hand.state().position[0] > 0.0005)
    bus.motors.absent = set()
    hand.connect()
    assert hand.state().fault == ''
    hand.close()


def test_a_motor_that_reports_an_error_is_named_and_the_others_hold(bus, hand):
    hand.connect()
    bus.motors.tables[1][70] = 1 << 5
    until(lambda: hand.state().fault == REBOOT_IT)
    assert all(table[TORQUE] for table in bus.motors.tables.values())


def test_a_hand_of_another_model_or_without_power_is_reported(bus, monkeypatch):
    monkeypatch.setattr('texture_exploration.arms.dynamixel.TRIES', 2)
    with pytest.raises(DeviceError, match=r"is of model 1240 .*; the profile 'xm430' is for"):
        arm_on(bus, profile='xm430').connect()
    assert torque_is_off(bus)
    bus.motors.absent = set(LEAP.ids)
    with pytest.raises(DeviceError, match='no motor answers'):
        arm_on(bus).connect()


def test_without_an_object_there_is_nothing_to_hold(tmp_path):
    with EmulatedDynamixelBus(tmp_path / 'bus', leap_hand(stiffness_n_m=0.0)) as bus:
        arm = InHandArm(InHandParams(device=str(bus.port.link), grip_timeout_s=1.0))
        with pytest.raises(DeviceError, match='there is nothing to hold: thumb presses with'):
            arm.connect()

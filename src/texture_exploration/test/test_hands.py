# SPDX-License-Identifier: Apache-2.0
"""Hands: simulated, and of Dynamixel motors through the unmodified dynamixel-sdk on an emulated bus."""

import importlib.util
import time
from pathlib import Path

import numpy as np
import pytest

from texture_core.config import markdown_table
from texture_core.errors import DeviceError, InvalidParameter, UnknownName
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.dynamixel import DynamixelBus, DynamixelHand, signed
from texture_exploration.arms.hand import SimulatedHand, load_profile
from texture_exploration.arms.in_hand import InHandArm, InHandParams
from texture_exploration.explorer import Explorer
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import TouchParams
from texture_simulation.devices.dynamixel import DynamixelMotors, EmulatedDynamixelBus, PressingMotor

pytestmark = pytest.mark.realtime

DEADLINE_S = 30.0
LEAP = load_profile('leap')
OVERLOAD = (
    "motor 1 ('press' of index) reports overload; when it has cooled and nothing blocks it, reboot it "
    "(service '~/reboot') or switch its power off and on"
)
needs_sdk = pytest.mark.skipif(importlib.util.find_spec('dynamixel_sdk') is None, reason='dynamixel-sdk is missing')


def until(condition):
    deadline = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


def motors_of(profile, stiffness=2000.0):
    presses = [joints['press'] for joints in profile.fingers.values()]
    pressing = {joint.id: PressingMotor(joint.lever_m, profile.start_height_m) for joint in presses}
    return DynamixelMotors(list(profile.ids), pressing, stiffness)


@pytest.fixture
def bus(tmp_path):
    with EmulatedDynamixelBus(tmp_path / 'bus', motors_of(LEAP)) as made:
        yield made


def arm_on(bus, **params):
    return InHandArm(InHandParams(hand='dynamixel', device=str(bus.port.link), grip_timeout_s=20.0, **params))


def rub(arm):
    """Return the outcome, and the forces of the hand while its fingers slide."""
    forces = []

    def note(state):
        if state.phase is Phase.SLIDE:
            forces.append({name: tip.force_n for name, tip in arm.hand.state().fingers.items()})

    explorer = Explorer(
        arm,
        TouchParams(speed_tolerance=0.3, force_tolerance=0.2, peak_speed_share=5.0),  # the machine may be busy
        SafetyLimits(state_timeout_s=1.0),
        note,
    )
    explorer.connect()
    request = ExplorationRequest('in_hand_sliding', speed_m_s=0.02, duration_s=1.5)
    exploration = explorer.begin('one', request)
    assert exploration.ended.wait(DEADLINE_S)
    explorer.close()
    return exploration.outcome, forces


def test_the_simulated_hand_holds_while_two_fingers_slide():
    arm = InHandArm()
    outcome, forces = rub(arm)
    assert outcome.success, outcome.message
    for name in ('thumb', 'ring', 'little'):
        assert np.ptp([force[name] for force in forces]) < 0.05
        assert forces[-1][name] == pytest.approx(2.0, rel=0.05)
    for name in ('index', 'middle'):
        assert np.mean([force[name] for force in forces]) == pytest.approx(1.0, rel=0.1)


def test_a_finger_that_loses_the_object_is_a_fault_that_names_it():
    hand = SimulatedHand()
    arm = InHandArm(InHandParams(finger_set='kaboli-test'), hand)
    arm.connect()
    hand.fingers['ring'].push(-1.9)
    until(lambda: arm.state().fault.startswith('the grip is lost: ring presses with'))
    arm.close()


def test_an_unknown_finger_set_is_reported_with_the_nearest():
    with pytest.raises(UnknownName, match="did you mean 'kaboli-train'"):
        InHandArm(InHandParams(finger_set='kaboli-trane'))


def test_every_shipped_profile_can_be_read():
    for name in ('leap', 'x330', 'xm430', 'rh_p12_rn'):
        assert load_profile(name).ids
    assert len(LEAP.ids) == 16
    assert LEAP.table['goal_position'] == (116, 4)


def test_a_broken_profile_is_reported(tmp_path):
    path = tmp_path / 'mine.yaml'
    path.write_text('models: [1]\n')
    with pytest.raises(InvalidParameter, match="hand profile 'mine' cannot be read"):
        load_profile(str(path))


def test_the_page_lists_the_parameters_as_they_are():
    page = Path(__file__).parents[3] / 'docs' / 'reference' / 'parameters.md'
    assert markdown_table(InHandParams) in page.read_text()


def test_registers_are_signed():
    assert (signed(0xFFFF, 2), signed(0x7FFF, 2), signed(0xFFFFFFFE, 4)) == (-1, 32767, -2)


@needs_sdk
def test_a_dynamixel_hand_holds_while_two_fingers_slide(bus):
    arm = arm_on(bus)
    outcome, forces = rub(arm)
    assert outcome.success, outcome.message
    assert len(forces) > 20
    for name in ('thumb', 'ring'):
        assert np.mean([force[name] for force in forces]) == pytest.approx(2.0, rel=0.1)
    assert np.mean([force['index'] for force in forces]) == pytest.approx(1.0, rel=0.2)


@needs_sdk
def test_closing_lets_the_object_go(bus):
    arm = arm_on(bus)
    arm.connect()
    thumb = LEAP.fingers['thumb']['press'].id
    assert bus.motors.forces_n[thumb] == pytest.approx(2.0, rel=0.5)
    arm.close()
    until(lambda: not any(table[64] for table in bus.motors.tables.values()))


@needs_sdk
def test_motors_that_do_not_answer_are_let_go_too(bus):
    line = DynamixelBus(str(bus.port.link), LEAP)
    line.start()
    line.missing = {5}
    line.torque_off(LEAP.ids)
    until(lambda: not any(table[64] for table in bus.motors.tables.values()))
    line.close()


@needs_sdk
def test_a_late_answer_to_an_earlier_question_is_not_taken_for_a_measurement(bus):
    line = DynamixelBus(str(bus.port.link), LEAP)
    line.start()
    late, receive = [bus._status(LEAP.ids[0], bytes(1))], bus.receive  # one byte, as of its register of errors
    bus.receive = lambda data: (late.pop() if late else b'') + receive(data)
    assert line.read() == {}
    assert line.missing == set()
    assert set(line.read()) == set(LEAP.ids)
    line.close()


@needs_sdk
def test_a_missing_motor_is_named_and_survived(bus):
    hand = DynamixelHand('leap', str(bus.port.link))
    hand.connect()
    bus.motors.absent = {5}
    until(lambda: hand.state().fault == "motor 5 ('press' of middle) does not answer")
    before = hand.state().time_ns
    hand.command(['index'], ArmCommand(tangential_m_s=(0.02, 0.0)))
    until(lambda: hand.state().time_ns > before and hand.state().fingers['index'].position[0] > 0.0005)
    bus.motors.absent = set()
    until(lambda: hand.state().fault == '')
    hand.close()


@needs_sdk
@pytest.mark.parametrize('torque_off', [False, True])
def test_a_motor_that_reports_an_error_is_named_and_may_let_go(bus, torque_off):
    hand = DynamixelHand('leap', str(bus.port.link), torque_off)
    hand.connect()
    bus.motors.tables[1][70] = 1 << 5
    until(lambda: hand.state().fault == OVERLOAD)
    if torque_off:
        until(lambda: not any(table[64] for table in bus.motors.tables.values()))
    else:
        assert all(table[64] for table in bus.motors.tables.values())
    hand.close()


@needs_sdk
def test_an_unplugged_hand_is_reported_and_can_be_connected_again(bus):
    hand = DynamixelHand('leap', str(bus.port.link))
    hand.connect()
    bus.unplug()
    with pytest.raises(DeviceError, match='cannot be reached'):
        until(lambda: not hand.state())
    with pytest.raises(DeviceError, match='check that it is plugged in'):
        hand.connect()
    bus.plug()
    hand.connect()
    assert hand.state().fault == ''
    hand.close()


@needs_sdk
def test_a_hand_of_another_model_or_without_power_is_reported(bus):
    with pytest.raises(DeviceError, match=r"is of model 1240 .*; the profile 'xm430' is for"):
        DynamixelHand('xm430', str(bus.port.link)).connect()
    bus.motors.absent = set(LEAP.ids)
    with pytest.raises(DeviceError, match='no motor answers'):
        DynamixelHand('leap', str(bus.port.link)).connect()


@needs_sdk
def test_without_an_object_there_is_nothing_to_hold(tmp_path):
    with EmulatedDynamixelBus(tmp_path / 'bus', motors_of(LEAP, stiffness=0.0)) as bus:
        arm = InHandArm(InHandParams(hand='dynamixel', device=str(bus.port.link), grip_timeout_s=1.0))
        with pytest.raises(DeviceError, match='there is nothing to hold: thumb presses with'):
            arm.connect()

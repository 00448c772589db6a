# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The emulated controller in virtual time: the register handshake, the watchdog, the safety."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from texture_simulation.devices.ur import (
    BANNER,
    DashboardSession,
    EmulatedController,
    RtdeMessage,
    RtdeSession,
    SafetyMode,
    ScriptCommand,
    UrControllerParams,
)

SCRIPT = 'def rtde_control():\nend\n'


@pytest.fixture
def served():
    return EmulatedController(UrControllerParams(force_noise_n=0.0), np.random.default_rng(0))


@pytest.fixture
def controller(served):
    """Return a controller on which the control script runs."""
    served.upload(SCRIPT)
    run(served, 0.1)
    return served


def run(controller, seconds):
    for _ in range(round(seconds / controller.step_s)):
        controller.tick()


def send(controller, command, doubles=(), ints=()):
    registers = controller.registers
    registers.double_in[: len(doubles)] = doubles
    registers.int_in[1 : 1 + len(ints)] = ints
    controller.write('int_in', 0, command)


def speed_l(controller, *velocity):
    send(controller, ScriptCommand.SPEED_L, [*velocity, 0.0, 0.0, 0.0, 1.0, 0.0])


def test_a_command_that_is_overwritten_within_a_cycle_is_lost(controller):
    speed_l(controller, 0.05, 0.0, 0.0)
    send(controller, ScriptCommand.NONE)
    run(controller, 0.2)
    assert not controller.robot.velocity.any()


def test_the_end_of_force_control_does_not_end_a_speed(controller):
    speed_l(controller, 0.05, 0.0, 0.0)
    run(controller, 0.1)
    send(controller, ScriptCommand.FORCE_MODE_STOP)
    run(controller, 0.2)
    assert controller.robot.velocity[0] == pytest.approx(0.05)


@pytest.mark.parametrize('frequency_hz', [4.0, 10.0])
def test_the_watchdog_stops_a_program_that_hears_nothing(controller, frequency_hz):
    send(controller, ScriptCommand.SET_WATCHDOG, [frequency_hz])
    run(controller, 0.01)
    speed_l(controller, 0.05, 0.0, 0.0)
    run(controller, 1 / frequency_hz - 0.01)
    assert controller.playing
    run(controller, 0.05)
    assert not controller.playing
    assert not controller.robot.velocity.any()


def test_a_controller_that_is_held_up_again_and_again_excuses_a_silent_client_for_100_ms(controller):
    send(controller, ScriptCommand.SET_WATCHDOG, [10.0])
    run(controller, 0.01)
    speed_l(controller, 0.05, 0.0, 0.0)
    begin_s = controller.time_s
    while controller.playing:
        controller.catch_up()
        assert controller.time_s < begin_s + 0.22
    assert controller.time_s > begin_s + 0.18


def test_a_protective_stop_cannot_be_unlocked_before_its_time(controller):
    speed_l(controller, 0.05, 0.0, 0.0)
    run(controller, 0.1)
    controller.protective_stop()
    run(controller, 4.9)
    assert (controller.playing, controller.safety) == (False, SafetyMode.PROTECTIVE_STOP)
    assert not controller.robot.velocity.any()
    controller.upload(SCRIPT)
    assert not controller.unlock()
    run(controller, 0.2)
    assert not controller.playing
    assert controller.unlock()
    controller.upload(SCRIPT)
    run(controller, 0.1)
    assert (controller.playing, controller.safety) == (True, SafetyMode.NORMAL)


def test_zeroing_under_load_hides_the_true_force(controller):
    controller.robot.pose[2] = controller.robot.origin[2] - 0.0015
    controller.tick()
    send(controller, ScriptCommand.ZERO_FT_SENSOR)
    run(controller, 0.01)
    assert controller.robot.pressing_n == pytest.approx(3.0)
    assert controller.robot.force[2] == pytest.approx(0.0, abs=1e-9)


@pytest.fixture
def session(served):
    return RtdeSession(served, set())


def message(kind, payload=b''):
    return struct.pack('>HB', 3 + len(payload), kind) + payload


def test_an_input_belongs_to_one_client_until_it_leaves(served):
    open_ = set()
    first, second = RtdeSession(served, open_), RtdeSession(served, open_)
    open_ |= {first, second}
    setup = message(RtdeMessage.SETUP_INPUTS, b'input_int_register_0,input_double_register_3,')
    assert first.receive(setup)[4:] == b'INT32,DOUBLE'
    assert b'IN_USE' in second.receive(setup)
    first.connection_lost(None)
    assert second.receive(setup)[4:] == b'INT32,DOUBLE'


@pytest.mark.parametrize('payload', [b'', b'\0', b'\7abc', b'\1', b'\1' + bytes(50)])
def test_data_of_no_recipe_or_another_length_change_nothing(session, served, payload):
    session.receive(message(RtdeMessage.SETUP_INPUTS, b'input_int_register_1'))
    served.registers.int_in[1] = 7
    session.receive(message(RtdeMessage.DATA, payload))
    assert served.registers.int_in[1] == 7


def test_messages_may_come_in_pieces(session):
    request = message(RtdeMessage.REQUEST_VERSION, b'\0\2') * 2
    answers = b''.join(session.receive(request[place : place + 1]) for place in range(len(request)))
    assert answers == message(RtdeMessage.REQUEST_VERSION, b'\1') * 2


def test_the_dashboard_answers_line_by_line(served):
    dashboard = DashboardSession(served, set())
    assert dashboard.greeting == BANNER
    assert dashboard.receive(b'PolyscopeVersion\nrobot') == b'URSoftware 5.12.0.0 (emulated)\n'
    assert dashboard.receive(b'mode\n') == b'Robotmode: RUNNING\n'
    assert dashboard.receive(b'make coffee\n') == b'could not understand: make coffee\n'
    assert dashboard.receive(b'emulate protective stop\nsafetymode\n').endswith(b'Safetymode: PROTECTIVE_STOP\n')
    assert dashboard.receive(b'unlock protective stop\n').startswith(b'Cannot unlock')
    dashboard.receive(b'emulate silence 0.5\n')
    assert served.silent_s == 0.5
    run(served, 0.6)
    assert served.silent_s == 0.0
    assert dashboard.receive(b'emulate speed much\n') == b"came 'much'; a number of times full speed is needed\n"

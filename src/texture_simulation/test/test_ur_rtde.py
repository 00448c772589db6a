# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import struct

import numpy as np
import pytest

from texture_simulation.devices.ur import (
    BANNER,
    DashboardSession,
    EmulatedController,
    InputClaims,
    RtdeMessage,
    RtdeSession,
    ScriptSession,
    UrControllerParams,
)


@pytest.fixture
def controller():
    return EmulatedController(UrControllerParams(force_noise_n=0.0), np.random.default_rng(0))


@pytest.fixture
def session(controller):
    return RtdeSession(controller, InputClaims())


def message(kind, payload=b''):
    return struct.pack('>HB', 3 + len(payload), kind) + payload


def outputs(names, frequency_hz=500.0):
    return message(RtdeMessage.SETUP_OUTPUTS, struct.pack('>d', frequency_hz) + names.encode())


def test_the_protocol_version_is_accepted_and_another_one_refused(session):
    assert session.receive(message(RtdeMessage.REQUEST_VERSION, b'\0\2')) == message(RtdeMessage.REQUEST_VERSION, b'\1')
    assert session.receive(message(RtdeMessage.REQUEST_VERSION, b'\0\1')) == message(RtdeMessage.REQUEST_VERSION, b'\0')


def test_an_unknown_variable_is_not_found(session):
    answer = session.receive(outputs('timestamp,nonsense,safety_mode,'))
    assert answer[4:] == b'DOUBLE,NOT_FOUND,INT32'


def test_data_come_once_started_and_say_what_was_asked(session, controller):
    session.receive(outputs('actual_TCP_pose,runtime_state,'))
    assert session.package() == b''
    session.receive(message(RtdeMessage.START))
    controller.tick()
    size, kind, recipe, *pose, runtime = struct.unpack('>HBB6dI', session.package())
    assert (size, kind, recipe, runtime) == (56, RtdeMessage.DATA, 1, 1)
    assert pose == pytest.approx([0.4, 0.0, 0.11, 0.0, 0.0, 0.0])


def test_data_come_at_the_wanted_rate(session, controller):
    session.receive(outputs('timestamp', 125.0) + message(RtdeMessage.START))
    packages = 0
    for _ in range(500):
        controller.tick()
        packages += session.package() != b''
    assert packages == pytest.approx(125, abs=1)


def test_an_input_belongs_to_one_client_until_it_leaves(controller):
    claims = InputClaims()
    first, second = RtdeSession(controller, claims), RtdeSession(controller, claims)
    setup = message(RtdeMessage.SETUP_INPUTS, b'input_int_register_0,input_double_register_3,')
    assert first.receive(setup)[4:] == b'INT32,DOUBLE'
    assert b'IN_USE' in second.receive(setup)
    first.close()
    assert second.receive(setup)[4:] == b'INT32,DOUBLE'


def test_data_go_to_the_registers_of_their_recipe(session, controller):
    session.receive(message(RtdeMessage.SETUP_INPUTS, b'input_int_register_1'))
    session.receive(message(RtdeMessage.SETUP_INPUTS, b'input_int_register_0,input_double_register_3'))
    session.receive(message(RtdeMessage.DATA, struct.pack('>Bid', 2, 10, 0.5)))
    assert (controller.registers.int_in[0], controller.registers.double_in[3]) == (10, 0.5)


@pytest.mark.parametrize('payload', [b'', b'\0', b'\7abc', b'\1', b'\1' + bytes(50)])
def test_data_of_no_recipe_or_another_length_change_nothing(session, controller, payload):
    session.receive(message(RtdeMessage.SETUP_INPUTS, b'input_int_register_1'))
    controller.registers.int_in[1] = 7
    session.receive(message(RtdeMessage.DATA, payload))
    assert controller.registers.int_in[1] == 7


def test_messages_may_come_in_pieces(session):
    request = message(RtdeMessage.REQUEST_VERSION, b'\0\2') * 2
    answers = b''.join(session.receive(request[place : place + 1]) for place in range(len(request)))
    assert answers == message(RtdeMessage.REQUEST_VERSION, b'\1') * 2


def test_the_dashboard_answers_line_by_line(controller):
    offline, silent = [], []
    dashboard = DashboardSession(controller, offline.append, silent.append)
    assert dashboard.greeting() == BANNER
    assert dashboard.receive(b'PolyscopeVersion\nget serial') == b'URSoftware 5.12.0.0 (emulated)\n'
    assert dashboard.receive(b' number\n').strip().isdigit()
    assert dashboard.receive(b'make coffee\n') == b'could not understand: make coffee\n'
    assert dashboard.receive(b'emulate protective stop\nsafetymode\n').endswith(b'Safetymode: PROTECTIVE_STOP\n')
    assert dashboard.receive(b'unlock protective stop\n').startswith(b'Cannot unlock')
    assert dashboard.receive(b'emulate offline soon\n').startswith(b"came 'soon'")
    dashboard.receive(b'emulate offline 1.5\n')
    assert offline == [1.5]
    dashboard.receive(b'emulate silence 0.5\n')
    assert silent == [0.5]
    assert dashboard.receive(b'emulate drop deep\n') == b"came 'deep'; a number of metres is needed\n"


def test_a_surface_that_drops_is_not_touched_any_more_until_it_is_back(controller):
    dashboard = DashboardSession(controller, lambda _seconds: None, lambda _seconds: None)
    plane = controller.robot.surface
    pressed = plane.origin - (0.0, 0.0, 0.001)
    forces = []
    for drop in (b'0', b'0.012', b'0'):
        dashboard.receive(b'emulate drop ' + drop + b'\n')
        forces.append(float(plane.force_n(pressed, np.zeros(3))[2]))
    assert forces == [pytest.approx(2.0), 0.0, pytest.approx(2.0)]


def test_a_script_starts_when_its_last_line_is_there(controller):
    script = ScriptSession(controller)
    script.receive(b'def rtde_control():\n  if True:\n')
    script.receive(b'  end\nend\n')
    for _ in range(50):
        controller.tick()
    assert controller.playing

# SPDX-License-Identifier: Apache-2.0
"""The emulated controller in its own time: the register handshake, the watchdog, the safety."""

from __future__ import annotations

import numpy as np
import pytest

from texture_simulation.devices.ur import (
    DONE,
    READY,
    DashboardSession,
    EmulatedController,
    SafetyMode,
    ScriptCommand,
    UrControllerParams,
)

pytestmark = pytest.mark.realtime

SCRIPT = 'def rtde_control():\nend\n'


@pytest.fixture
def controller():
    controller = EmulatedController(UrControllerParams(force_noise_n=0.0), np.random.default_rng(0))
    controller.upload(SCRIPT)
    run(controller, 0.1)
    return controller


def run(controller, seconds):
    for _ in range(round(seconds / controller.step_s)):
        controller.tick()


def send(controller, command, doubles=(), ints=()):
    registers = controller.registers
    registers.double_in[: len(doubles)] = doubles
    registers.int_in[1 : 1 + len(ints)] = ints
    registers.int_in[0] = command
    registers.last_command_s = controller.time_s


def state(controller):
    return controller.registers.int_out[0]


def speed_l(controller, *velocity):
    send(controller, ScriptCommand.SPEED_L, [*velocity, 0.0, 0.0, 0.0, 1.0, 0.0])


def test_a_program_starts_shortly_after_its_upload():
    controller = EmulatedController(UrControllerParams(), np.random.default_rng(0))
    controller.upload(SCRIPT)
    controller.tick()
    assert not controller.playing
    run(controller, 0.1)
    assert controller.playing
    assert state(controller) == READY


def test_a_command_is_done_once_and_then_waits_for_0(controller):
    x = controller.robot.pose[0]
    send(controller, ScriptCommand.MOVE_L, [x + 0.01, *controller.robot.pose[1:], 0.1, 1.0], [0])
    controller.tick()
    assert state(controller) == READY
    run(controller, 1.0)
    assert state(controller) == DONE
    assert controller.robot.pose[0] == pytest.approx(x + 0.01)
    send(controller, ScriptCommand.NONE)
    controller.tick()
    assert state(controller) == READY


def test_realtime_commands_leave_the_script_ready(controller):
    speed_l(controller, 0.05, 0.0, 0.0)
    run(controller, 0.2)
    assert state(controller) == READY
    assert controller.robot.velocity[0] == pytest.approx(0.05)


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


def test_a_stop_of_the_script_stops_the_arm(controller):
    speed_l(controller, 0.05, 0.0, 0.0)
    run(controller, 0.1)
    send(controller, ScriptCommand.STOP_SCRIPT)
    run(controller, 0.1)
    assert not controller.playing
    assert not controller.robot.velocity.any()


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


def test_a_stop_is_acknowledged_late_if_it_is_reported_so_but_done_at_once(controller):
    controller.acknowledge_s = 0.3
    speed_l(controller, 0.05, 0.0, 0.0)
    run(controller, 0.2)
    send(controller, ScriptCommand.SPEED_STOP, [10.0])
    run(controller, 0.25)
    assert not controller.robot.velocity.any()
    assert state(controller) == READY
    run(controller, 0.1)
    assert state(controller) == DONE


def test_a_late_acknowledgement_trips_a_watchdog_that_does_not_wait_for_it(controller):
    controller.acknowledge_s = 0.15
    send(controller, ScriptCommand.SET_WATCHDOG, [10.0])
    run(controller, 0.01)
    send(controller, ScriptCommand.NONE)
    run(controller, 0.01)
    send(controller, ScriptCommand.ZERO_FT_SENSOR)
    run(controller, 0.2)
    assert not controller.playing


def test_zeroing_under_load_hides_the_true_force(controller):
    controller.robot.pose[2] = controller.robot.surface.origin[2] - 0.0015
    controller.tick()
    send(controller, ScriptCommand.ZERO_FT_SENSOR)
    run(controller, 0.01)
    assert controller.robot.pressing_n == pytest.approx(3.0)
    assert controller.robot.force[2] == pytest.approx(0.0, abs=1e-9)


def test_a_program_of_somebody_else_takes_no_commands_and_can_be_paused(controller):
    dashboard = DashboardSession(controller, lambda seconds: None, lambda seconds: None)

    def ask(line):
        return dashboard.receive(line.encode() + b'\n').decode().strip()

    assert ask('programState') == 'PLAYING rtde_control'
    assert [ask('load other.urp'), ask('play')] == ['Loading program: other.urp', 'Starting program']
    speed_l(controller, 0.05, 0.0, 0.0)
    run(controller, 0.2)
    assert not controller.robot.velocity.any()
    assert [ask('running'), ask('programState')] == ['Program running: true', 'PLAYING other.urp']
    ask('pause')
    assert [ask('running'), ask('programState')] == ['Program running: false', 'PAUSED other.urp']
    ask('stop')
    assert ask('programState') == 'STOPPED other.urp'

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math
from contextlib import closing

import pytest

from texture_core.types import FingerReceiver
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.simulated import SimulatedArm, SimulatedArmParams


class Clock:
    now_ns = 0

    def __call__(self):
        return self.now_ns


@pytest.fixture
def clock():
    return Clock()


def make(clock, **parameters):
    arm = SimulatedArm(SimulatedArmParams(**parameters), clock, own_thread=False)
    arm.connect()
    return arm


def run(arm, clock, command, seconds, dt=0.004):
    for _ in range(round(seconds / dt)):
        arm.command(command)
        clock.now_ns += round(dt * 1e9)
        arm.step(dt)


def test_the_force_is_stiffness_times_depth(clock):
    arm = make(clock, stiffness_n_m=1500.0, start_height_m=0.0)
    run(arm, clock, ArmCommand(normal_m_s=-0.001), 1.0)
    assert arm.state().force_n == pytest.approx(1.5)


def test_the_force_error_decays_with_the_time_constant_of_the_admittance(clock):
    arm = make(clock, stiffness_n_m=2000.0, start_height_m=0.0)
    run(arm, clock, ArmCommand(force_n=1.0), 0.1)  # two time constants of 1 / (2000 · 0.01) s
    assert arm.state().force_n == pytest.approx(1 - math.exp(-2), rel=1e-3)


def test_force_control_is_stable_however_stiff_the_surface_and_long_the_step(clock):
    arm = make(clock, stiffness_n_m=1e5, start_height_m=0.0)
    run(arm, clock, ArmCommand(force_n=1.0), 5.0, dt=0.1)
    assert arm.state().force_n == pytest.approx(1.0)


def test_above_the_surface_force_control_comes_down(clock):
    arm = make(clock, start_height_m=0.002)
    run(arm, clock, ArmCommand(force_n=1.0), 1.0)
    assert arm.state().force_n == pytest.approx(1.0, rel=1e-3)


def test_a_command_moves_the_arm_no_longer_than_it_holds_however_late_the_step(clock):
    arm = make(clock)
    arm.command(ArmCommand(normal_m_s=0.02))
    clock.now_ns += 1_000_000_000
    arm.step(1.0)
    assert arm.state().position[2] == pytest.approx(0.01 + 0.02 * 0.1)
    assert arm.state().velocity == (0.0, 0.0, 0.0)


def test_the_emulator_is_told_where_the_finger_is(clock, tmp_path):
    with closing(FingerReceiver(str(tmp_path / 'finger'))) as emulator:
        arm = make(clock, finger_pipe=str(tmp_path / 'finger'), start_height_m=0.0)
        run(arm, clock, ArmCommand(tangential_m_s=(0.1, 0.0), normal_m_s=-0.1), 0.004)
        sent = emulator.states()[-1]
        arm.close()
    assert (sent.time_ns, sent.vx_m_s, sent.x_m) == (4_000_000, 0.1, pytest.approx(0.0004))
    assert sent.force_n == pytest.approx(0.8)

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The way back from an obstacle, state by state: limit 10 N, 1 N allowed along the surface beyond friction."""

import pytest

from texture_core.types import Phase
from texture_exploration.arms.arm import ArmCommand, ArmState
from texture_exploration.guards import ForceGuard
from texture_exploration.safety import SafetyLimits

DOWN, STOP, BACK = ArmCommand(normal_m_s=-0.01), ArmCommand(), ArmCommand(normal_m_s=0.02)
STEP_S = 0.01


def answers(before_n, after_n, way=DOWN):
    """Go a way with forces of `before_n`, abort, and return the commands at those of `after_n`, one each 10 ms."""
    guard = ForceGuard(SafetyLimits(force_limit_n=10.0, tangential_floor_n=1.0))
    commands = []
    for number, force_n in enumerate([*before_n, *after_n]):
        arm = ArmState(round(number * STEP_S * 1e9), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), force_n)
        aborted = number >= len(before_n)
        commands.append(guard.yielding(arm, STOP if aborted else way, aborted))
    return commands[len(before_n) :]


@pytest.mark.parametrize(
    ('before_n', 'after_n', 'steps_back'),
    [
        ([0.0] * 10, [11.0, 6.0, 2.0, 0.6, 0.4, 0.4], 4),  # until half of the floor
        ([0.0] * 10, [11.0] * 30, 9),  # a force that has not begun to fall after 90 ms never will
        ([0.0] * 10, [11.0] + [9.0] * 40, 30),  # no way back takes longer than 0.3 s
        ([10.5] * 10, [11.0] * 5, 0),  # it did not grow on the way, as that of a broken sensor
        ([0.0] * 10 + [10.5] * 20, [11.0] * 5, 0),  # nor in the last 150 ms
        ([0.0] * 10 + [10.5] * 14, [11.0] * 5, 5),
        ([0.0] * 10, [9.0] * 5, 0),  # within the limit
    ],
)
def test_the_way_back_is_as_long_as_it_helps(before_n, after_n, steps_back):
    assert answers(before_n, after_n) == [BACK] * steps_back + [STOP] * (len(after_n) - steps_back)


@pytest.mark.parametrize(('there_m_s', 'back_m_s'), [(0.01, 0.02), (0.05, 0.05), (0.5, 0.1)])
def test_the_way_back_is_as_fast_as_the_way_there_within_bounds(there_m_s, back_m_s):
    [command] = answers([0.0] * 10, [11.0], ArmCommand(normal_m_s=-there_m_s))
    assert command.normal_m_s == pytest.approx(back_m_s)


# With friction up to twice the normal force and 1 N beyond it: under 3 N up to 7 N, in free air up to 1 N.
@pytest.mark.parametrize(
    ('along_n', 'normal_n', 'violated'),
    [
        ((6.99, 0.0), 3.0, False),
        ((7.01, 0.0), 3.0, True),
        ((0.0, -7.01), 3.0, True),
        ((4.96, -4.96), 3.0, True),  # 7.01 N
        ((7.01, 0.0), -3.0, True),  # it pulls
        ((0.99, 0.0), 0.0, False),
        ((1.01, 0.0), 0.0, True),
    ],
)
def test_a_force_along_the_surface_beyond_friction_is_a_violation_except_in_the_lift(along_n, normal_n, violated):
    guard = ForceGuard(SafetyLimits(force_limit_n=10.0, friction_limit=2.0, tangential_floor_n=1.0))
    arm = ArmState(1, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), normal_n, along_n=along_n)
    for phase in (Phase.APPROACH, Phase.CONTACT, Phase.SLIDE):
        assert guard.violation(arm, phase).startswith('the force along the surface of ') == violated
    assert guard.violation(arm, Phase.LIFT) == ''

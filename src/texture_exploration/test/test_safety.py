# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from texture_core.errors import InvalidParameter
from texture_exploration.arms.arm import ArmState
from texture_exploration.safety import SafetyLimits

REST = (0.0, 0.0, 0.0)


def test_a_workspace_turned_inside_out_is_refused():
    with pytest.raises(InvalidParameter, match=r"'x_low_m' is 0\.3; it must be below 'x_high_m'"):
        SafetyLimits(x_low_m=0.3)


@pytest.mark.parametrize(
    ('values', 'sentence'),
    [
        ({'min_force_n': 9.0, 'max_force_n': 8.0}, "'min_force_n' is 9; it must be below 'max_force_n', 8 N"),
        ({'z_low_m': 0.03}, "'z_low_m' is 0.03; it must be below 'surface_tolerance_m', 0.02 m"),
        ({'force_limit_n': 5.0}, "'max_force_n' is 6; it must be below 'force_limit_n', 5 N"),
    ],
)
def test_a_lowest_value_above_the_highest_is_refused_with_both_names(values, sentence):
    with pytest.raises(InvalidParameter, match=sentence):
        SafetyLimits(**values)
    assert SafetyLimits(min_force_n=2.0, max_force_n=2.0).range('force_n') == (2.0, 2.0, 'N')


def test_a_finger_within_all_limits_violates_nothing():
    arm = ArmState(0, (0.0, 0.1, -0.001), REST, 9.9)
    assert SafetyLimits().force_violation(arm) == SafetyLimits().outside(arm.position) == ''


@pytest.mark.parametrize('force', [10.1, math.nan, math.inf])
def test_a_force_that_is_too_high_or_unknown_is_a_violation(force):
    assert 'above the limit' in SafetyLimits().force_violation(ArmState(0, REST, REST, force))


@pytest.mark.parametrize(('force_n', 'pulls'), [(-9.9, False), (-10.1, True)])
def test_a_force_that_pulls_by_more_than_the_limit_is_a_violation(force_n, pulls):
    arm = ArmState(0, REST, REST, force_n)
    assert ('pulls by more than the limit' in SafetyLimits(force_limit_n=10.0).force_violation(arm)) is pulls


def test_a_position_outside_is_named_by_its_axis():
    assert SafetyLimits().outside((0.0, 0.3, 0.0)) == 'y is 0.3000 m, allowed is -0.2 to 0.2 m'


def test_the_room_is_the_way_to_the_nearest_wall():
    limits = SafetyLimits()
    assert limits.free_distance_m((0.1, 0.0, 0.0), 0.0) == pytest.approx(0.1)
    assert limits.free_distance_m((0.1, 0.0, 0.0), math.pi) == pytest.approx(0.3)
    assert limits.free_distance_m((0.0, 0.0, 0.0), math.pi / 4) == pytest.approx(0.2 * math.sqrt(2))


@pytest.mark.parametrize(('along_n', 'normal_n', 'allowed'), [(2.9, 1.0, True), (3.1, 1.0, False), (1.1, 0.0, False)])
def test_a_force_along_the_surface_is_bounded_by_friction_and_a_small_floor(along_n, normal_n, allowed):
    limits = SafetyLimits(friction_limit=2.0, tangential_floor_n=1.0)
    arm = ArmState(0, REST, REST, normal_n, along_n=(0.0, -along_n))
    assert (limits.friction_violation(arm) == '') is allowed


def test_the_limit_is_of_the_whole_force_and_of_the_normal_one_where_only_that_is_measured():
    limits = SafetyLimits(force_limit_n=10.0)
    assert 'above the limit' in limits.force_violation(ArmState(0, REST, REST, 6.0, along_n=(6.0, 6.0)))
    assert limits.force_violation(ArmState(0, REST, REST, 6.0)) == limits.friction_violation(
        ArmState(0, REST, REST, 6.0)
    )

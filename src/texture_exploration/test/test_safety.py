# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from texture_core.errors import InvalidParameter
from texture_exploration.arms.arm import ArmState
from texture_exploration.safety import SafetyLimits, SurfacePatch

REST = (0.0, 0.0, 0.0)


def test_a_workspace_turned_inside_out_is_refused():
    with pytest.raises(InvalidParameter, match=r"'x_low_m' is 0\.3; it must be below 'x_high_m'"):
        SafetyLimits(x_low_m=0.3)


def test_a_limit_below_what_may_be_asked_for_is_refused():
    with pytest.raises(InvalidParameter, match="'force_limit_n' is 5"):
        SafetyLimits(force_limit_n=5.0)


@pytest.mark.parametrize(
    ('cls', 'values', 'sentence'),
    [
        (SafetyLimits, {'min_force_n': 9.0, 'max_force_n': 8.0}, r"'max_force_n' is 8; .* 'min_force_n', which is 9 N"),
        (SafetyLimits, {'max_speed_m_s': 0.001}, r"'max_speed_m_s' is 0\.001; it must be at least 0\.002 m/s"),
        (SurfacePatch, {'patch_x_low_m': 0.1}, r"'patch_x_low_m' is 0\.1; .* above 'patch_x_high_m', which is 0 m"),
        (SurfacePatch, {'patch_y_high_m': -0.1}, r"'patch_y_low_m' is 0; .* above 'patch_y_high_m', which is -0\.1 m"),
    ],
)
def test_a_lowest_value_above_the_highest_is_refused_with_both_names(cls, values, sentence):
    with pytest.raises(InvalidParameter, match=sentence):
        cls(**values)


def test_a_finger_within_all_limits_violates_nothing():
    arm = ArmState(0, (0.0, 0.1, -0.001), REST, 9.9)
    assert SafetyLimits().force_violation(arm) == SafetyLimits().outside(arm.position) == ''


@pytest.mark.parametrize('force', [10.1, math.nan, math.inf])
def test_a_force_that_is_too_high_or_unknown_is_a_violation(force):
    assert 'above the limit' in SafetyLimits().force_violation(ArmState(0, REST, REST, force))


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

# SPDX-License-Identifier: Apache-2.0
import math
from itertools import pairwise

import pytest

from texture_exploration.arms.arm import ArmState
from texture_exploration.motions import CircularPath, StraightPath
from texture_exploration.stages import PathFollower, ramp_s, ramps_m, smooth


def follow(path, places):
    follower = PathFollower(path)
    for x, y in places:
        follower.update(0, ArmState(0, (x, y, 0.0), (0.0, 0.0, 0.0), 0.0))
    return follower


def test_the_way_along_a_circle_is_its_arc():
    angles = [2 * math.pi * k / 500 for k in range(501)]
    follower = follow(CircularPath(0.02, 8.0, 0.0), [(0.02 * math.cos(a), 0.02 * math.sin(a)) for a in angles])
    assert follower.travelled_m == pytest.approx(2 * math.pi * 0.02, rel=1e-3)
    assert follower.velocity(1e-4) == pytest.approx((0.0, 1e-4), abs=1e-6)


def test_a_finger_that_trembles_across_its_path_does_not_get_ahead():
    trembling = [(0.0, 0.0), (0.01, 0.0), (-0.01, 0.0)] * 100 + [(0.0, 0.005)]
    assert follow(StraightPath(1.0, math.pi / 2), trembling).travelled_m == pytest.approx(0.005, rel=1e-3)


def test_a_ramp_keeps_to_the_acceleration_and_takes_half_the_speed_in_the_mean():
    speed, acceleration = 0.2, 1.0
    duration = ramp_s(speed, acceleration)
    shares = [k / 1000 for k in range(1001)]
    steepest = max(smooth(b) - smooth(a) for a, b in pairwise(shares)) * 1000
    assert steepest * speed / duration == pytest.approx(acceleration, rel=1e-3)
    mean = sum(map(smooth, shares)) / len(shares)
    assert 2 * mean * speed * duration == pytest.approx(ramps_m(speed, duration) - 0.05 * speed)


def test_a_ramp_is_flat_outside():
    assert [smooth(-1.0), smooth(0.0), smooth(0.5), smooth(1.0), smooth(7.0)] == pytest.approx([0, 0, 0.5, 1, 1])


def test_a_finger_beside_its_path_is_led_back_at_the_same_speed():
    follower = follow(StraightPath(1.0, 0.0), [(0.0, 0.0), (0.01, 0.001)])
    vx, vy = follower.velocity(0.1)
    assert vy == pytest.approx(-0.015)  # 15 /s of 1 mm
    assert math.hypot(vx, vy) == pytest.approx(0.1)


@pytest.mark.parametrize('speed', [0.01, 0.05, 0.25])
def test_no_ramp_exceeds_the_acceleration_or_the_jerk(speed):
    duration, dt = ramp_s(speed, 1.0, 20.0), 1e-4
    speeds = [speed * smooth((k * dt) / duration) for k in range(-2, round(duration / dt) + 3)]
    accelerations = [(b - a) / dt for a, b in pairwise(speeds)]
    jerks = [(b - a) / dt for a, b in pairwise(accelerations)]
    assert max(map(abs, accelerations)) <= 1.0 * 1.001
    assert max(map(abs, jerks)) <= 20.0 * 1.001

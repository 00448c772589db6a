# SPDX-License-Identifier: Apache-2.0
"""Whether an arm follows what is commanded: an arm that is late, and one that stands still, in simulated time."""

import numpy as np
import pytest

from texture_exploration.arms.ros_controllers import FollowWatch

PERIOD_S = 0.004
FOLLOW_M = 0.002
DESCENT_M_S, LIFT_M_S = -0.0013, 0.05


def complaints(velocities_m_s, lag_s, gain=1.0):
    """Return what the watch says of an arm that does `gain` times what was commanded `lag_s` ago, (n, 3) m/s."""
    watch, late = FollowWatch(FOLLOW_M), round(lag_s / PERIOD_S)
    delayed = np.concatenate([np.zeros((late, 3)), velocities_m_s])[: len(velocities_m_s)]
    positions = np.cumsum(gain * delayed * PERIOD_S, axis=0)
    held_s = np.concatenate([[0.0], np.full(len(positions) - 1, PERIOD_S)])
    commanded = np.concatenate([velocities_m_s[:1], velocities_m_s[:-1]])  # until now
    steps = zip(positions, commanded, held_s, strict=True)
    said = [
        watch.update(round(number * PERIOD_S * 1e9), tuple(position), tuple(velocity), held)
        for number, (position, velocity, held) in enumerate(steps)
    ]
    return [sentence for sentence in said if sentence]


def along_normal(*parts):
    """Return velocities (n, 3) along the normal of parts (speed in m/s, duration in s)."""
    normal = np.concatenate([np.full(round(duration_s / PERIOD_S), speed_m_s) for speed_m_s, duration_s in parts])
    return np.column_stack([np.zeros((len(normal), 2)), normal])


@pytest.mark.parametrize('lag_s', [0.0, 0.04, 0.1])
def test_an_arm_that_is_lifted_out_of_its_slow_descent_follows_wherever_the_descent_ended(lag_s):
    for descent_s in np.arange(0.1, 3.2, 0.05):
        assert complaints(along_normal((DESCENT_M_S, descent_s), (LIFT_M_S, 0.6)), lag_s) == [], descent_s


def test_an_arm_that_goes_to_and_fro_follows():
    assert complaints(along_normal(*[(speed, 0.5) for speed in (0.05, -0.05)] * 4), 0.1) == []


@pytest.mark.parametrize('speed_m_s', [LIFT_M_S, -LIFT_M_S])
def test_an_arm_that_stands_still_after_the_reversal_is_noticed_within_half_a_second(speed_m_s):
    moving, blocked = along_normal((-speed_m_s, 0.4)), along_normal((speed_m_s, 0.5))
    watch = FollowWatch(FOLLOW_M)
    place, said = 0.0, []
    for number, velocity in enumerate(np.concatenate([moving, blocked])):
        place += velocity[2] * PERIOD_S if number < len(moving) else 0.0
        said.append(watch.update(round(number * PERIOD_S * 1e9), (0.0, 0.0, place), tuple(velocity), PERIOD_S))
    assert not any(said[: len(moving)])
    assert any('mm commanded in 0.3 s' in sentence for sentence in said[len(moving) :])


def test_an_arm_that_stands_still_on_a_small_circle_is_noticed():
    angles = np.arange(0.0, 1.0, PERIOD_S) * 0.05 / 0.01  # rad: 50 mm/s on a radius of 10 mm
    circle = 0.05 * np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    assert complaints(circle, 0.1) == []
    assert complaints(circle, 0.0, gain=0.0)

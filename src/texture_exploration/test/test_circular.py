# SPDX-License-Identifier: Apache-2.0
import math

import pytest

from texture_core.errors import MotionRefused
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.simulated import SimulatedArm, SimulatedArmParams
from texture_exploration.motions import CircularPath, circular
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import TouchParams

LIMITS = SafetyLimits()


class LateArm(SimulatedArm):
    """An arm that takes two more steps of 5 ms to follow."""

    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self._coming = []

    def step(self, dt_s):
        self._coming.append(self._last_command)
        newest = self._last_command
        self._last_command = self._coming.pop(0) if len(self._coming) > 2 else self._coming[0]
        super().step(dt_s)
        self._last_command = newest


def sliding(table):
    return [(s, p) for s, p in zip(table.states, table.places, strict=True) if s.phase is Phase.SLIDE]


@pytest.mark.parametrize('arm_class', [SimulatedArm, LateArm])
@pytest.mark.parametrize('speed', [0.05, 0.1, 0.15])
def test_the_radius_is_kept_within_a_millimetre(table, speed, arm_class):
    table.arm = arm_class(SimulatedArmParams(), clock=lambda: table.now_ns, own_thread=False)
    assert table.explore(ExplorationRequest('circular', speed_m_s=speed, turns=3.0)).success
    radii = [math.hypot(x, y) for _, (x, y, _) in sliding(table)]
    assert max(abs(radius - 0.02) for radius in radii) < 0.001
    states = [state for state, _ in sliding(table)]
    assert [state.speed_m_s for state in states] == pytest.approx([speed] * len(states), rel=0.02)
    assert [state.force_n for state in states] == pytest.approx([1.0] * len(states), rel=0.1)


@pytest.mark.parametrize('degrees', [0, 30, 45, 90])
def test_the_slide_begins_at_the_start_angle_and_makes_its_turns(table, degrees):
    table.explore(ExplorationRequest('circular', turns=1.5, direction_rad=math.radians(degrees)))
    (first, (x, y, _)), (last, _) = sliding(table)[0], sliding(table)[-1]
    assert math.remainder(math.atan2(y, x) - math.radians(degrees), 2 * math.pi) == pytest.approx(0.0, abs=0.1)
    assert (last.stamp_ns - first.stamp_ns) * 1e-9 == pytest.approx(1.5 * 2 * math.pi * 0.02 / 0.1, abs=0.03)


def test_the_path_is_a_circle_and_its_direction_the_tangent():
    circle = CircularPath(0.02, 1.0, 0.0)
    assert circle.length_m == pytest.approx(0.04 * math.pi)
    assert circle.place(circle.length_m / 4) == pytest.approx((-0.02, 0.02))
    assert math.cos(circle.direction_rad(circle.length_m / 4)) == pytest.approx(-1.0)


def refusal(limits=LIMITS, **numbers):
    with pytest.raises(MotionRefused) as refused:
        circular(ExplorationRequest('circular', **numbers), (0.0, 0.0, 0.01), TouchParams(), limits)
    return str(refused.value)


def test_what_cannot_be_done_is_refused_with_what_can():
    assert refusal(radius_m=0.5) == 'circular: radius_m is 0.5; allowed is 0.005 to 0.1 m'
    assert refusal(distance_m=0.1) == 'circular knows no distance_m; leave it at 0'
    assert 'at most 0.158 m/s' in refusal(radius_m=0.005, speed_m_s=0.2)
    assert 'at most 0.05 m' in refusal(SafetyLimits(x_low_m=-0.05), radius_m=0.08)


def test_an_offset_of_the_force_before_it_is_zeroed_is_no_touch(table):
    table.arm.push(1.3)
    table.pace()
    table.when[Phase.APPROACH] = lambda: table.arm.push(0.0)
    assert table.explore(ExplorationRequest('circular')).success


def test_something_in_the_way_to_the_start_is_met(table):
    table.when[Phase.APPROACH] = lambda: table.arm.push(1.3)
    assert 'met something on the way' in table.explore(ExplorationRequest('circular')).message

# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What every motion of the catalogue keeps to, then what each of them is."""

import contextlib
import math
from itertools import pairwise

import pytest
from table_arm import TableArm, TableArmParams

from texture_core.errors import ExplorationError, MotionRefused
from texture_core.types import ExplorationRequest, Phase
from texture_exploration.arms.arm import ArmState
from texture_exploration.motions import DEFAULTS, MOTIONS
from texture_exploration.paths import CircularPath, PathFollower, StraightPath, ramp_s, ramps_m, smooth
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams

LIMITS = SafetyLimits()
ORDER = [Phase.APPROACH, Phase.CONTACT, Phase.SLIDE, Phase.LIFT, Phase.DONE]


def sliding(table):
    return [(s, p) for s, p in zip(table.states, table.places, strict=True) if s.phase is Phase.SLIDE]


def test_every_motion_says_which_numbers_it_takes():
    unlisted = set(MOTIONS) ^ set(DEFAULTS)
    assert not unlisted, f'{sorted(unlisted)}: list each motion in both MOTIONS and DEFAULTS of motions.py'


@pytest.mark.parametrize('name', MOTIONS)
def test_a_motion_that_leaves_the_workspace_is_refused_with_what_is_allowed(name):
    tight = SafetyLimits(x_low_m=-0.001, x_high_m=0.001, y_low_m=-0.001, y_high_m=0.001)
    with pytest.raises(MotionRefused) as refused:
        MOTIONS[name](ExplorationRequest(name), (0.0, 0.0, 0.01), TouchParams(), tight)
    parts = {
        "its error, 'OUTSIDE_WORKSPACE'": refused.value.error == ExplorationError.OUTSIDE_WORKSPACE,
        'the field, one of its DEFAULTS': refused.value.field in DEFAULTS[name],
        'what is allowed': 'allowed' in str(refused.value),
    }
    lacking = ' and '.join(part for part, there in parts.items() if not there)
    assert not lacking, f"the refusal of {name} beyond the workspace, '{refused.value}', lacks {lacking}"


@pytest.mark.parametrize(('name', 'number'), [(name, number) for name in DEFAULTS for number in DEFAULTS[name]])
def test_each_number_that_a_motion_takes_changes_what_the_finger_does(make_table, name, number):
    def pressed(**numbers):
        table = make_table()
        assert table.explore(ExplorationRequest(name, **{**DEFAULTS[name], **numbers})).success
        return table.places, table.pressed

    assert pressed() == pressed()
    changed = pressed(**{number: 0.9 * DEFAULTS[name][number]})
    assert changed != pressed(), f'{name} ignores {number}: plan with it, or take it out of its DEFAULTS in motions.py'


@pytest.mark.parametrize('name', MOTIONS)
def test_a_motion_with_all_defaults_keeps_its_speed_goes_in_its_direction_and_ends_lifted(table, name):
    assert table.explore(ExplorationRequest(name)).success
    assert table.phases == ORDER
    assert table.arm.state().force_n == 0
    steps = [(a, b, (b[0].stamp_ns - a[0].stamp_ns) * 1e-9) for a, b in pairwise(sliding(table))]
    guaranteed = [step for step in steps if step[2] <= step[0][0].steady_s]
    assert len(guaranteed) > 0.7 * len(steps)
    for (state, place), (_, next_place), seconds in guaranteed:
        way = math.dist(place[:2], next_place[:2])
        assert way / seconds == pytest.approx(state.speed_m_s, rel=0.02)
        heading = math.atan2(next_place[1] - place[1], next_place[0] - place[0])
        assert abs(math.remainder(heading - state.direction_rad, 2 * math.pi)) < 0.1


@pytest.mark.parametrize('name', MOTIONS)
@pytest.mark.parametrize('size', [1.0, 0.25])
def test_no_motion_exceeds_an_acceleration_along_or_sideways_at_its_highest_speed(make_table, name, size):
    numbers = {number: size * value for number, value in DEFAULTS[name].items() if number in ('radius_m', 'distance_m')}
    for step in range(50):
        table, speed_m_s = make_table(), LIMITS.max_speed_m_s * 0.9**step
        with contextlib.suppress(MotionRefused):
            assert table.explore(ExplorationRequest(name, speed_m_s=speed_m_s, **numbers)).success
            break
    else:
        pytest.fail(f'{name} refuses every speed with {numbers}: a quarter of its DEFAULTS must be within RANGES, too')
    along, sideways = [], []
    points = [(state.stamp_ns * 1e-9, complex(x, y)) for state, (x, y, _) in sliding(table)]
    for (begin_s, a), (middle_s, b), (end_s, c) in zip(points, points[1:], points[2:], strict=False):
        change = (c - b) / (end_s - middle_s) - (b - a) / (middle_s - begin_s)
        acceleration = 2 * change / (end_s - begin_s) / ((c - a) / abs(c - a))
        along.append(abs(acceleration.real))
        sideways.append(abs(acceleration.imag))
    assert max(along) < 1.1 * TouchParams().acceleration_m_s2
    assert max(sideways) < 1.1 * LIMITS.max_turning_m_s2


@pytest.mark.parametrize('name', MOTIONS)
def test_a_motion_that_is_aborted_in_the_approach_only_lifts(table, name):
    table.when[Phase.APPROACH] = lambda: table.exploration.stop('no')
    assert not table.explore(ExplorationRequest(name)).success
    assert [phase for phase in table.phases if phase is not Phase.LIFT] == [Phase.APPROACH, Phase.ABORTED]
    assert table.arm.state().position[2] >= table.home[2] - 0.001


# --------------------
# Linear slides.


@pytest.mark.parametrize(
    ('speed', 'force', 'distance'), [(0.02, 1.0, 0.02), (0.05, 0.5, 0.1), (0.1, 1.0, 0.08), (0.1, 2.5, 0.1)]
)
def test_the_slide_has_the_length_the_speed_and_the_force_that_were_asked(table, speed, force, distance):
    table.explore(ExplorationRequest('linear_slide', speed_m_s=speed, force_n=force, distance_m=distance))
    (begin, start), (end, stop) = table.first(Phase.SLIDE), table.first(Phase.LIFT)
    length, duration = math.dist(start[:2], stop[:2]), (end.stamp_ns - begin.stamp_ns) * 1e-9
    assert length == pytest.approx(distance, abs=0.001)
    assert length / duration == pytest.approx(speed, rel=0.02)
    states = [state for state, _ in sliding(table)]
    assert [state.speed_m_s for state in states] == pytest.approx([speed] * len(states), rel=0.02)
    assert [state.force_n for state in states] == pytest.approx([force] * len(states), rel=0.1)


def test_the_finger_goes_where_it_was_pointed(table):
    table.explore(ExplorationRequest('linear_slide', direction_rad=math.pi / 2))
    x, y, _ = table.arm.state().position
    assert abs(x) < 1e-9
    assert y > 0.1
    assert table.first(Phase.SLIDE)[0].direction_rad == math.pi / 2


def test_what_a_slide_guarantees_it_keeps(table):
    table.explore()
    end_ns = table.first(Phase.LIFT)[0].stamp_ns
    sliding = [state for state in table.states if state.phase is Phase.SLIDE]
    guaranteed = [state.stamp_ns + int(state.steady_s * 1e9) for state in sliding]
    assert max(guaranteed) <= end_ns
    assert sliding[0].steady_s == pytest.approx(0.1)
    assert not any(state.steady_s for state in table.states if state.phase is not Phase.SLIDE)


def test_the_second_slide_begins_where_the_first_began(table):
    table.explore()
    first = table.first(Phase.SLIDE)[1]
    table.states, table.places = [], []
    assert table.explore().success
    assert math.dist(first, table.first(Phase.SLIDE)[1]) < 0.002


def test_speed_is_gained_smoothly_and_within_the_acceleration_limit(make_table):
    table = make_table(touch=TouchParams(acceleration_m_s2=0.5))
    table.explore(ExplorationRequest('linear_slide', speed_m_s=0.1))
    pushing = [state for state in table.states if state.phase is Phase.CONTACT and state.speed_m_s > 0]
    gained = [b.speed_m_s - a.speed_m_s for a, b in pairwise(pushing)]
    took = [(b.stamp_ns - a.stamp_ns) * 1e-9 for a, b in pairwise(pushing)]
    assert max(dv / dt for dv, dt in zip(gained, took, strict=True)) < 0.5 * 1.05
    assert gained[0] < 0.5 * max(gained)


INVALID, UNUSED, OUTSIDE = (
    ExplorationError.INVALID_REQUEST,
    ExplorationError.UNUSED_FIELD,
    ExplorationError.OUTSIDE_WORKSPACE,
)
REFUSED = [
    ('linear_slide', {'speed_m_s': 2.0}, INVALID, 'linear_slide: speed_m_s is 2; allowed is 0.002 to 0.25 m/s'),
    ('linear_slide', {'force_n': -1.0}, INVALID, 'linear_slide: force_n is -1; allowed is 0.1 to 6 N'),
    ('linear_slide', {'direction_rad': 1e3}, INVALID, 'the direction is 57295.8°; allowed is -5730° to 5730°'),
    ('linear_slide', {'direction_rad': math.inf}, INVALID, 'the direction is inf°'),
    ('linear_slide', {'distance_m': math.nan}, INVALID, 'distance_m is nan'),
    ('linear_slide', {'radius_m': 0.02, 'turns': 2.0}, UNUSED, 'does not use radius_m and turns; leave it at 0'),
    ('linear_slide', {'distance_m': 2.0}, INVALID, 'distance_m is 2; allowed is 0.002 to 1 m'),
    # 0.2 m of room, less the ramp of 0.1 s and the steady 0.05 s at 0.05 m/s.
    ('linear_slide', {'distance_m': 0.9, 'speed_m_s': 0.05}, OUTSIDE, "0.192 m from x 0.000 and y 0.000 m, as 'x_high"),
    ('linear_slide', {'distance_m': 0.195, 'speed_m_s': 0.05, 'direction_rad': math.pi}, OUTSIDE, 'at most 0.192 m'),
    ('circular', {'radius_m': 0.5}, INVALID, 'circular: radius_m is 0.5; allowed is 0.005 to 0.1 m'),
    ('circular', {'distance_m': 0.1}, UNUSED, 'circular does not use distance_m; leave it at 0'),
    ('circular', {'radius_m': 0.005, 'speed_m_s': 0.2}, INVALID, 'at most 0.158 m/s'),
    ('circular', {'radius_m': 0.1}, OUTSIDE, 'at most 0.05 m'),
    ('in_hand_sliding', {'speed_m_s': 0.1, 'distance_m': 0.01}, INVALID, 'of a stroke, is 0.01; allowed is 0.0'),
]


@pytest.mark.parametrize(('motion', 'numbers', 'error', 'sentence'), REFUSED)
def test_what_cannot_be_done_is_refused_with_what_can_and_names_the_field(motion, numbers, error, sentence):
    limits = SafetyLimits(x_low_m=-0.05) if numbers == {'radius_m': 0.1} else LIMITS
    with pytest.raises(MotionRefused) as refused:
        MOTIONS[motion](ExplorationRequest(motion, **numbers), (0.0, 0.0, 0.01), TouchParams(), limits)
    assert sentence in str(refused.value)
    assert refused.value.error == error
    assert refused.value.field in numbers, (
        f'the refusal of {motion} names no field of the request: give MotionRefused one'
    )


def test_a_default_beyond_a_limit_is_the_limit():
    hard = SafetyLimits(min_force_n=3.0, max_force_n=8.0, max_speed_m_s=0.02)
    request = hard.complete(ExplorationRequest('linear_slide'), {'speed_m_s': 0.05, 'force_n': 1.0, 'distance_m': 0.1})
    assert (request.speed_m_s, request.force_n, request.distance_m) == (0.02, 3.0, 0.1)


# --------------------
# Circles.


class LateArm(TableArm):
    """An arm that takes two more steps of 5 ms to follow."""

    def __init__(self, *args):
        super().__init__(*args)
        self._commands = []

    def step(self, dt_s):
        self._commands.append(self._last_command)
        newest = self._last_command
        self._last_command = self._commands.pop(0) if len(self._commands) > 2 else self._commands[0]
        super().step(dt_s)
        self._last_command = newest


@pytest.mark.parametrize('arm_class', [TableArm, LateArm])
@pytest.mark.parametrize('speed', [0.05, 0.1, 0.15])
def test_the_radius_is_kept_within_a_millimetre(table, speed, arm_class):
    table.arm = arm_class(TableArmParams(), lambda: table.now_ns)
    table.arm.connect()
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


def test_an_offset_of_the_force_before_it_is_zeroed_is_no_touch(table):
    table.arm.push(1.3)
    table.pace()
    table.when[Phase.APPROACH] = lambda: table.arm.push(0.0)
    assert table.explore(ExplorationRequest('circular')).success


def test_something_in_the_way_to_the_start_is_met(table):
    table.when[Phase.APPROACH] = lambda: table.arm.push(1.3)
    assert 'met something on the way' in table.explore(ExplorationRequest('circular')).message


# --------------------
# Cross slides.


CROSS = ExplorationRequest('cross_slide')
CROSS_DEFAULTS = DEFAULTS['cross_slide']
LEG_S = CROSS_DEFAULTS['distance_m'] / CROSS_DEFAULTS['speed_m_s']


def guaranteed(table, direction_rad):
    """Return for how long a direction was guaranteed, s, and the states that did so."""
    states = [
        s for s, _ in sliding(table) if s.steady_s > 0 and math.isclose(s.direction_rad, direction_rad, abs_tol=1e-6)
    ]
    return (states[-1].stamp_ns - states[0].stamp_ns) * 1e-9 + states[-1].steady_s, states


@pytest.mark.parametrize('heading', [0.0, 0.5 * math.pi])
def test_each_leg_is_guaranteed_for_its_whole_length(table, heading):
    assert table.explore(ExplorationRequest('cross_slide', direction_rad=heading)).success
    for direction in (heading, math.remainder(heading + 0.5 * math.pi, 2 * math.pi)):
        lasted_s, states = guaranteed(table, direction)
        assert lasted_s == pytest.approx(LEG_S, abs=0.05)
        assert max(b.stamp_ns - a.stamp_ns for a, b in pairwise(states)) < 50_000_000


def test_nothing_is_guaranteed_between_the_legs(table):
    table.explore(CROSS)
    between = [s for s, _ in sliding(table) if 0.01 < s.direction_rad < 0.5 * math.pi - 0.01]
    assert len(between) >= 3
    assert all(state.steady_s == 0 for state in between)
    spans = [(s.stamp_ns, s.stamp_ns + s.steady_s * 1e9) for s, _ in sliding(table) if s.steady_s > 0]
    assert not any(begin <= state.stamp_ns < end for state in between for begin, end in spans)


def test_the_second_leg_is_straight_and_at_right_angles_to_the_first(table):
    table.explore(CROSS)
    first = [p for s, p in sliding(table) if s.steady_s > 0 and s.direction_rad == 0.0]
    second = [p for s, p in sliding(table) if s.steady_s > 0 and s.direction_rad > 1.0]
    assert max(abs(y - table.home[1]) for _, y, _ in first) < 2e-4
    assert max(x for x, _, _ in second) - min(x for x, _, _ in second) < 2e-4
    assert second[-1][1] - second[0][1] == pytest.approx(CROSS_DEFAULTS['distance_m'], abs=0.003)


def test_the_corner_exceeds_no_acceleration_and_keeps_the_speed(table):
    table.explore(ExplorationRequest('cross_slide', speed_m_s=0.1, distance_m=0.05))
    states = [s for s, _ in sliding(table)]
    velocities = [(s.stamp_ns, s.speed_m_s, s.direction_rad) for s in states]
    assert min(speed for _, speed, _ in velocities) > 0.09
    vectors = [(t, v * math.cos(a), v * math.sin(a)) for t, v, a in velocities]
    steps = [math.hypot(b[1] - a[1], b[2] - a[2]) / ((b[0] - a[0]) * 1e-9) for a, b in pairwise(vectors)]
    assert max(steps) < 1.2 * TouchParams().acceleration_m_s2


@pytest.mark.parametrize('heading', [0.0, 0.5, math.pi])
def test_legs_that_leave_the_workspace_are_refused_with_the_longest_that_do_not(make_table, heading):
    table = make_table(limits=SafetyLimits(x_low_m=-0.07, x_high_m=0.06, y_low_m=-0.05, y_high_m=0.08))
    with pytest.raises(MotionRefused, match='the length of each of two legs') as refused:
        table.explore(ExplorationRequest('cross_slide', distance_m=0.4, direction_rad=heading))
    allowed = float(str(refused.value).partition('is at most ')[2].split()[0])
    assert table.explore(ExplorationRequest('cross_slide', distance_m=allowed, direction_rad=heading)).success
    with pytest.raises(MotionRefused):
        table.explore(ExplorationRequest('cross_slide', distance_m=allowed + 0.001, direction_rad=heading))


# --------------------
# Strokes in a hand.


RUB = ExplorationRequest('in_hand_sliding')


def test_two_seconds_of_sliding_stay_within_the_stroke(table):
    assert table.explore(RUB).success
    states = [state for state, _ in sliding(table)]
    assert (states[-1].stamp_ns - states[0].stamp_ns) * 1e-9 == pytest.approx(2.0, abs=0.05)
    along = [place[0] for place in table.places]
    assert min(along) == pytest.approx(0.0, abs=0.0005)
    assert max(along) == pytest.approx(0.02, abs=0.0005)


def test_nothing_is_guaranteed_for_a_turn(table):
    table.explore(RUB)
    guaranteed = [(s.stamp_ns, s.stamp_ns + s.steady_s * 1e9) for s, _ in sliding(table)]
    slow = [s.stamp_ns for s, _ in sliding(table) if abs(s.speed_m_s - 0.02) > 0.0005]
    assert len(slow) >= 5
    assert not any(begin <= stamp < end for stamp in slow for begin, end in guaranteed if end > begin)


def guaranteed_speeds(table, request):
    """Explore, and return the true speeds at all times for which a steady one was guaranteed, m/s."""
    speeds = []
    table.at_each_step = lambda: speeds.append((table.now_ns, math.hypot(*table.arm.state().velocity[:2])))
    assert table.explore(request).success
    guaranteed = [(s.stamp_ns, s.stamp_ns + s.steady_s * 1e9) for s, _ in sliding(table)]
    return [speed for stamp, speed in speeds if any(begin <= stamp < end for begin, end in guaranteed)]


@pytest.mark.parametrize('lag_s', [0.008, 0.02, 0.05])
def test_after_a_turn_a_late_arm_is_steady_only_when_it_has_turned(make_table, lag_s):
    table = make_table(TableArmParams(force_mode=False, loop_delay_s=lag_s, start_height_m=0.002))
    speeds = guaranteed_speeds(table, RUB)
    assert len(speeds) > 100
    begun_within = abs(speeds[0] / 0.02 - 1)
    assert begun_within <= table.touch.speed_tolerance
    assert max(abs(speed / 0.02 - 1) for speed in speeds[1:]) <= 0.02


# --------------------
# Paths and ramps.


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


def test_a_finger_beside_its_path_is_led_back_at_the_same_speed():
    follower = follow(StraightPath(1.0, 0.0), [(0.0, 0.0), (0.01, 0.001)])
    vx, vy = follower.velocity(0.1)
    assert vy == pytest.approx(-0.015)  # 15 /s of 1 mm
    assert math.hypot(vx, vy) == pytest.approx(0.1)


@pytest.mark.parametrize('speed', [0.01, 0.05, 0.25])
def test_a_ramp_takes_half_the_speed_in_the_mean_and_exceeds_neither_acceleration_nor_jerk(speed):
    duration, dt = ramp_s(speed, 1.0, 20.0), 1e-4
    assert [smooth(-1.0), smooth(0.0), smooth(0.5), smooth(1.0), smooth(7.0)] == pytest.approx([0, 0, 0.5, 1, 1])
    speeds = [speed * smooth((k * dt) / duration) for k in range(-2, round(duration / dt) + 3)]
    assert 2 * sum(speeds) * dt == pytest.approx(ramps_m(speed, duration) - 0.05 * speed, rel=0.02)
    accelerations = [(b - a) / dt for a, b in pairwise(speeds)]
    jerks = [(b - a) / dt for a, b in pairwise(accelerations)]
    assert max(map(abs, accelerations)) <= 1.0 * 1.001
    assert max(map(abs, jerks)) <= 20.0 * 1.001

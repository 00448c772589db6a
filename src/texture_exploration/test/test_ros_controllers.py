# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The arm behind ROS controllers without ROS: an emulated arm at the other end of its topics, in simulated time."""

import math
import re
import threading
from dataclasses import replace

import numpy as np
import pytest
from twist_robot import LIMITS, NO_NOISE, PERIOD_NS, Robot

from texture_core.errors import CommandRefused, DeviceError, ExplorationError, InvalidParameter, MotionRefused
from texture_core.types import ExplorationRequest, rotation_matrix
from texture_exploration import explorer as explorer_module
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.tool_state import FollowWatch
from texture_exploration.arms.tool_state import RosControllersParams as Params
from texture_exploration.motions import DEFAULTS, MOTIONS
from texture_exploration.touch import TouchParams
from texture_simulation.devices.twist_controller import TwistControllerParams


@pytest.fixture
def robot():
    return Robot().connect()


def test_the_velocity_is_commanded_in_the_base_frame_and_measured_in_that_of_the_surface():
    turned = {'surface_rx_rad': 0.0, 'surface_ry_rad': 0.3}
    robot = Robot(TwistControllerParams(jitter_s=0.0, force_noise_n=0.0, **turned), **turned).connect()
    robot.pass_time(0.5, ArmCommand(tangential_m_s=(0.02, -0.01)))
    expected = rotation_matrix((0.0, 0.3, 0.0)) @ [0.02, -0.01, 0.0]
    assert robot.sent[-1][1] == pytest.approx(expected)
    assert robot.arm.state().velocity == pytest.approx((0.02, -0.01, 0.0), abs=1e-6)
    assert robot.arm.state().position[2] == pytest.approx(0.01, abs=1e-6)


def test_a_controller_in_the_frame_of_the_tool_is_commanded_in_that_frame():
    robot = Robot(twist_frame_id='tool0_controller').connect()
    robot.pass_time(0.02, ArmCommand(tangential_m_s=(0.02, 0.01), normal_m_s=0.03))
    assert robot.sent[-1][1] == pytest.approx((0.02, -0.01, -0.03))  # the tool looks down


def test_offset_and_weight_of_the_tool_are_removed_in_free_air_and_the_force_is_that_of_the_surface(robot):
    assert abs(robot.arm.state().force_n) > 1.0
    robot.zero_force()
    robot.pass_time(0.1)
    assert robot.arm.state().force_n == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('friction', [0.15, 0.6])
def test_the_tangential_force_is_friction_times_the_normal_force_and_unknown_at_rest(friction):
    robot = Robot(replace(NO_NOISE, friction=friction)).connect()
    robot.zero_force()
    assert math.isnan(robot.arm.state().tangential_force_n)
    while robot.arm.state().position[2] > 0.001:
        robot.pass_time(0.1, ArmCommand(normal_m_s=-0.01))
    robot.pass_time(3.0, ArmCommand(force_n=3.0))
    robot.pass_time(0.8, ArmCommand(tangential_m_s=(0.016, -0.012), force_n=3.0))
    state = robot.arm.state()
    assert state.force_n > 2.0
    assert state.tangential_force_n == pytest.approx(friction * state.force_n, rel=0.05)


def test_the_sensor_is_not_zeroed_in_contact(robot):
    robot.zero_force()
    robot.connect()
    assert not robot.arm.zeroed
    robot.machine.position = robot.machine._origin - [0.0, 0.0, 0.02]  # 40 N
    robot.pass_time(0.3, ArmCommand(normal_m_s=0.01))
    robot.pass_time(0.5, ArmCommand())
    assert robot.machine.finger().force_n > 5.0
    assert not robot.arm.zeroed


def test_a_force_is_refused_until_the_sensor_is_zeroed():
    robot = Robot(TwistControllerParams(start_height_m=0.002)).connect()
    with pytest.raises(CommandRefused, match=r'the force sensor is not zeroed; rise by 3 mm in free air'):
        robot.arm.command(ArmCommand(force_n=1.0))
    robot.zero_force()
    robot.pass_time(12.0, ArmCommand(force_n=1.0))
    assert robot.machine.finger().force_n == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize('what', ['pose', 'force'])
def test_a_stale_pose_or_force_commands_zero_velocity_within_100_ms(robot, what):
    robot.pass_time(0.2, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert not robot.is_commanded_to_rest
    setattr(robot, f'{what}_comes', False)
    begin_ns = robot.now_ns
    robot.pass_time(0.2, ArmCommand(tangential_m_s=(0.02, 0.0)))
    first_ns = next(time_ns for time_ns, velocity in robot.sent if time_ns > begin_ns and not any(velocity))
    assert (first_ns - begin_ns) * 1e-9 <= 0.1
    assert f'no {what} has arrived on' in robot.arm.state().fault
    assert not any(velocity != (0.0, 0.0, 0.0) for time_ns, velocity in robot.sent if time_ns >= first_ns)


def test_a_broadcaster_that_repeats_an_old_pose_counts_as_stale(robot):
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    frozen = robot.newest_pose()
    robot.newest_pose = lambda: frozen
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert 'no pose has arrived' in robot.arm.state().fault


def test_a_command_that_is_not_repeated_ends_in_zero_velocity(robot):
    robot.arm.command(ArmCommand(tangential_m_s=(0.02, 0.0)))
    robot.pass_time(0.05)
    assert not robot.is_commanded_to_rest
    robot.pass_time(0.1)
    assert robot.is_commanded_to_rest


def test_at_rest_nothing_is_sent_after_a_while_so_that_others_may_command(robot):
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    robot.arm.stop()
    robot.pass_time(1.0)
    number = len(robot.sent)
    robot.pass_time(1.0)
    assert len(robot.sent) == number


def test_closing_commands_zero_velocity_and_leaves_the_topics(robot):
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    robot.arm.close()
    assert robot.is_commanded_to_rest
    assert robot.closed
    with pytest.raises(DeviceError, match='not connected'):
        robot.arm.state()


def test_a_controller_that_ends_is_named(robot):
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    robot.heard_by = 0
    robot.pass_time(0.01, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert "no node subscribed to 'twist_controller/twist'" in robot.arm.state().unsafe
    assert robot.is_commanded_to_rest
    robot.pass_time(0.3, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert "no node subscribes to 'twist_controller/twist' any more" in robot.arm.state().fault
    robot.heard_by = 1
    robot.connect()
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert robot.arm.state().fault == ''


class BrokenLink(Robot):
    """A controller that keeps executing the last velocity, and a link to it that breaks."""

    commands_arrive = True

    def __init__(self):
        super().__init__(replace(NO_NOISE, command_timeout_s=0.0))

    def send_velocity(self, velocity_m_s):
        self.sent.append((self.now_ns, velocity_m_s))
        if self.commands_arrive:
            self.machine.command(self.now_ns, np.array(velocity_m_s))

    def break_link(self, time_s, measured=False):
        self.commands_arrive, self.pose_comes, self.force_comes = False, measured, measured
        self.pass_time(time_s)
        self.commands_arrive = self.pose_comes = self.force_comes = True


@pytest.mark.parametrize('measured', [False, True], ids=['link', 'controller'])
@pytest.mark.parametrize('time_s', [0.1, 0.5, 0.7, 2.0, 5.0])
def test_an_arm_whose_link_or_controller_was_away_rests_0_3_s_after_it_returns(time_s, measured):
    """A controller that was paused shows poses all the while, but takes no command."""
    robot = BrokenLink()
    robot.connect()
    robot.pass_time(0.3, ArmCommand(tangential_m_s=(0.03, 0.0)))
    robot.break_link(time_s, measured)
    assert np.linalg.norm(robot.machine.velocity) == pytest.approx(0.03)
    robot.pass_time(0.3)
    assert np.linalg.norm(robot.machine.velocity) == 0.0
    robot.pass_time(1.0)
    robot.connect()
    robot.pass_time(0.6, ArmCommand(tangential_m_s=(0.03, 0.0)))
    assert robot.arm.state().fault == ''
    assert np.linalg.norm(robot.machine.velocity) == pytest.approx(0.03)


def test_an_arm_that_moves_when_it_is_connected_rests_before_it_follows_a_command():
    robot = BrokenLink()
    robot.machine.command(robot.now_ns, np.array([0.0, 0.03, 0.0]))
    robot.machine.advance(robot.now_ns + 100_000_000)
    robot.now_ns += 100_000_000
    robot.arm.connect()
    robot.pass_time(0.3, ArmCommand(tangential_m_s=(0.02, 0.0)))
    robot.pass_time(0.3, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert robot.machine.velocity == pytest.approx([0.02, 0.0, 0.0])
    first = next(number for number, (_, velocity) in enumerate(robot.sent) if any(velocity))
    assert (robot.sent[first][0] - robot.sent[0][0]) * 1e-9 >= 0.2
    assert not any(any(velocity) for _, velocity in robot.sent[:first])


def test_an_arm_that_somebody_else_moves_is_a_fault_and_zero_velocity_is_all_it_is_told():
    robot = BrokenLink()
    robot.commands_arrive = False
    robot.machine.command(robot.now_ns, np.array([0.0, 0.03, 0.0]))
    robot.arm.connect()
    robot.pass_time(2.2, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert 'the arm moves although zero velocity is commanded' in robot.arm.state().fault
    assert not any(any(velocity) for _, velocity in robot.sent)


def test_a_controller_that_gets_no_computing_time_is_not_one_that_does_not_follow():
    """It neither moves the arm nor shows a pose meanwhile."""
    robot = Robot(deadman_s=1.0).connect()
    robot.pass_time(0.2, ArmCommand(tangential_m_s=(0.03, 0.0)))
    robot.pose_comes, robot.machine.advance = False, lambda _now_ns: None
    robot.pass_time(0.6, ArmCommand(tangential_m_s=(0.03, 0.0)))
    robot.pose_comes = True
    del robot.machine.advance
    robot.pass_time(0.2, ArmCommand(tangential_m_s=(0.03, 0.0)))
    assert (robot.arm.state().unsafe, robot.arm.state().fault) == ('', '')


def test_stamps_from_the_future_are_named_as_clocks_that_do_not_agree(robot):
    assert robot.arm.warning() == ''
    robot.clock_ahead_s = -0.05
    robot.pass_time(0.1)
    assert re.search(r"the clock that stamps the force on '.*' is 50 ms ahead", robot.arm.warning())
    assert robot.arm.state().fault == ''


SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=1.0, distance_m=0.05)


def test_a_controller_that_is_gone_for_6_ms_in_the_slide_ends_it_with_the_finger_lifted():
    robot = Robot(replace(NO_NOISE, start_height_m=0.003, force_noise_n=0.002)).connect()
    gone_ns = []

    def listeners():
        return 0 if gone_ns and robot.now_ns - gone_ns[0] <= 6_000_000 else 1

    robot.listeners = listeners
    outcome = robot.explore(SLIDE, on_slide=lambda: gone_ns.append(robot.now_ns))
    assert gone_ns
    assert not outcome.success
    assert 'no node subscribed' in outcome.message
    assert outcome.lifted
    assert robot.machine.finger().force_n == 0.0
    assert robot.machine.finger().z_m > 0.001


@pytest.mark.parametrize('why', ["'/other' also commands the arm", 'the guard process has ended'])
def test_what_makes_the_arm_unsafe_while_it_obeys_ends_the_slide_with_the_finger_lifted(why):
    robot = Robot(replace(NO_NOISE, start_height_m=0.003, force_noise_n=0.002), connect_timeout_s=0.1).connect()
    outcome = robot.explore(SLIDE, on_slide=lambda: setattr(robot, 'unsafe_because', why))
    assert not outcome.success
    assert why in outcome.message
    assert outcome.lifted
    assert robot.machine.finger().z_m > 0.001
    robot.pass_time(0.3, ArmCommand(normal_m_s=-0.01))
    assert robot.is_commanded_to_rest
    explorer = robot.explorer()
    assert why in explorer.fault()
    with pytest.raises(DeviceError, match=why):
        explorer.recover()


def test_a_process_that_was_told_to_end_waits_for_no_controller_and_commands_nothing(monkeypatch):
    robot = Robot(connect_timeout_s=30.0)
    ending = threading.Event()
    ending.set()
    monkeypatch.setattr('texture_exploration.arms.arm.ENDING', ending)
    with pytest.raises(DeviceError, match='aborted, as this process was asked to end'):
        robot.arm.connect()
    assert not any(any(velocity) for _, velocity in robot.sent)


def test_a_controller_that_listens_without_moving_the_arm_is_named_and_recovers():
    robot = Robot(TwistControllerParams(active=False)).connect()
    robot.pass_time(0.5, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert 'mm commanded' in robot.arm.state().unsafe
    assert 'is not active' in robot.arm.state().unsafe
    assert robot.is_commanded_to_rest
    robot.pass_time(0.5, ArmCommand(normal_m_s=0.02))  # nor does it follow a lift
    assert 'mm commanded' in robot.arm.state().fault
    assert robot.is_commanded_to_rest


@pytest.mark.parametrize('held_up_s', [0.5, 60.0])
def test_an_arm_that_is_held_up_in_the_slide_lifts_the_finger_if_it_can(noisy, held_up_s, monkeypatch):
    """As by a controller that gets no computing time: it stands, and may obey again."""
    until_ns, follow = [], noisy.machine.command

    def stand(now_ns, velocity_m_s):
        follow(now_ns, velocity_m_s if now_ns > until_ns[0] else np.zeros(3))

    def hold_up():
        if not until_ns:
            until_ns.append(noisy.now_ns + round(held_up_s * 1e9))
            noisy.machine.command = stand

    monkeypatch.setattr(TouchParams, 'stall_s', 5.0)
    patient = TouchParams(lost_contact_s=5.0)
    outcome = noisy.explore(replace(PRESS, speed_m_s=0.05), touch=patient, on_slide=hold_up)
    assert 'mm commanded' in outcome.message
    assert outcome.lifted is (held_up_s < 1.0)
    assert (noisy.machine.finger().force_n == 0.0) is outcome.lifted


def test_a_finger_that_stalls_in_mid_slide_aborts_within_half_a_second(monkeypatch):
    robot = Robot(TwistControllerParams(start_height_m=0.003, jitter_s=0.0)).connect()
    follow, stalled_ns = robot.machine.command, []

    def follow_along_the_normal_only(now_ns, velocity_m_s):
        if robot.machine.finger().x_m > 0.01:
            stalled_ns.append(now_ns)
            normal = robot.machine._axes[:, 2]
            velocity_m_s = normal * (normal @ velocity_m_s)
        follow(now_ns, velocity_m_s)

    monkeypatch.setattr(robot.machine, 'command', follow_along_the_normal_only)
    request = ExplorationRequest('linear_slide', speed_m_s=0.05, distance_m=0.04)
    outcome = robot.explore(request)
    assert (outcome.success, outcome.slid) == (False, True)
    assert 'the finger stalled' in outcome.message or 'mm commanded' in outcome.message
    still_sliding = [at_ns for at_ns, velocity in robot.sent if abs(velocity[0]) + abs(velocity[1]) > 0.04]
    assert 0.1 < (still_sliding[-1] - stalled_ns[0]) * 1e-9 < 0.5


def test_a_late_arm_that_limits_its_speed_still_follows():
    robot = Robot(TwistControllerParams(lag_s=0.08, max_speed_m_s=0.1, max_acceleration_m_s2=1.0)).connect()
    robot.pass_time(1.0, ArmCommand(tangential_m_s=(0.2, 0.0)))
    assert robot.arm.state().fault == ''


@pytest.mark.parametrize(
    ('found', 'said'),
    [
        ({'frames': ('world', 'tool0_controller')}, 'the pose on .* is given in the frame'),
        ({'frames': ('base', 'wrist')}, 'the force on .* is given in the frame'),
        ({'force_comes': False, 'heard_by': 0}, r"no force arrives on .*; no node subscribes to 'twist_controller"),
        ({'unsafe_because': "'/other' also commands the arm"}, 'also commands the arm'),
    ],
)
def test_a_connection_that_may_not_be_is_refused_by_name_and_commands_nothing(found, said):
    robot = Robot(connect_timeout_s=0.1)
    for name, value in found.items():
        setattr(robot, name, value)
    with pytest.raises(DeviceError, match=said):
        robot.arm.connect()
    assert robot.closed
    assert not any(any(velocity) for _, velocity in robot.sent)


def test_a_frame_for_velocities_that_is_neither_base_nor_tool_is_refused():
    with pytest.raises(InvalidParameter, match="it must be the base frame 'base'"):
        Params(twist_frame_id='world')


@pytest.mark.parametrize(
    ('stiffness_n_m', 'lag_s', 'noise_n'),
    [(600.0, 0.02, 0.003), (600.0, 0.05, 0.02), (2000.0, 0.05, 0.003), (20000.0, 0.02, 0.02), (20000.0, 0.05, 0.003)],
)
def test_the_force_is_kept_from_a_thirtieth_of_the_declared_stiffness_on(stiffness_n_m, lag_s, noise_n):
    emulated = {'lag_s': lag_s, 'stiffness_n_m': stiffness_n_m, 'start_height_m': 0.002, 'force_noise_n': noise_n}
    declared = {'max_stiffness_n_m': 20000.0, 'loop_delay_s': lag_s, 'touching_n': max(0.03, 6.0 * noise_n)}
    robot = Robot(TwistControllerParams(**emulated, jitter_s=0.002), **declared, max_impact_n=0.5).connect()
    request = ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=1.0, distance_m=0.03)
    outcome = robot.explore(request, touch=TouchParams(approach_stiffness_n_m=20000.0))
    assert outcome.success, outcome.message
    assert max(map(max, robot.forces.values())) < 1.2
    slide_n = np.array(robot.forces['slide'])
    assert np.sqrt(np.mean((slide_n - 1.0) ** 2)) < 0.1  # the tolerance with which a slide begins


@pytest.mark.parametrize('motion', MOTIONS)
def test_every_motion_succeeds_behind_a_late_controller(motion):
    robot = Robot(TwistControllerParams(start_height_m=0.003)).connect()
    short = {'distance_m': 0.02, 'turns': 0.5, 'duration_s': 1.0}
    request = {'speed_m_s': 0.05} | {number: value for number, value in short.items() if number in DEFAULTS[motion]}
    outcome = robot.explore(ExplorationRequest(motion, **request))
    assert outcome.success, outcome.message


@pytest.mark.parametrize(
    ('off_m', 'where'), [(0.079, '0.179) m in the base frame, 79 mm above'), (-0.025, '25 mm below')]
)
def test_a_contact_far_from_the_declared_surface_is_refused_with_both_places_and_the_finger_lifted(off_m, where):
    robot = Robot(TwistControllerParams(surface_z_m=0.1 + off_m)).connect()
    outcome = robot.explore(PRESS, limits=replace(LIMITS, z_low_m=-0.05))
    assert (outcome.error, outcome.slid, outcome.lifted) == (ExplorationError.NO_SURFACE, False, True)
    assert where in outcome.message
    assert "the surface declared at (0.4, 0, 0.1) m, and 20 mm are allowed ('surface_tolerance_m')" in outcome.message
    assert max(robot.pressed_n) < PRESS.force_n
    assert robot.machine.finger().force_n == 0.0
    robot.connect()
    outcome = robot.explore(PRESS, limits=replace(LIMITS, z_low_m=-0.05, surface_tolerance_m=0.08))
    assert outcome.success, outcome.message


def explorer_over(robot):
    explorer = robot.explorer()
    explorer.connect()
    robot.pass_time(0.25)
    robot.zero_force()
    return explorer


def press_at(robot, x_m, y_m, z_m=0.0, fraction=2.0):
    """Press a place as an operator would, `z_m` above the surface, with so many times the least force of a touch."""
    depth_m = fraction * TouchParams().contact_force_n / robot.machine.params.stiffness_n_m
    robot.machine.position = robot.machine._origin + robot.machine._axes @ [x_m, y_m, z_m - depth_m]
    robot.pass_time(0.02)
    return depth_m


def test_a_tilted_surface_is_found_by_four_touches_and_the_last_shows_the_residual():
    tilted = TwistControllerParams(jitter_s=0.0, force_noise_n=0.0, surface_rx_rad=0.1, surface_ry_rad=-0.2)
    robot = Robot(tilted)
    explorer = explorer_over(robot)
    for count, place in enumerate(((0.0, 0.0), (0.05, 0.0), (0.02, 0.04)), start=1):
        press_at(robot, *place)
        assert f'touch the surface at {4 - count} more place' in explorer.touch_surface()
    assert robot.arm.surface_pose[3:] == (0.0, 0.0, 0.0)
    depth_m = press_at(robot, 0.04, 0.03)
    assert 'residual 0.00 mm rms, largest 0.00 mm' in explorer.touch_surface()
    patch = explorer.patch  # the rectangle around the touches, about their middle
    assert patch.patch_x_high_m - patch.patch_x_low_m == pytest.approx(0.05, abs=0.002)
    explorer.connect()
    for place in ((0.01, -0.03), (-0.04, 0.02)):
        press_at(robot, *place, fraction=0.0)
        assert robot.arm.state().position[2] == pytest.approx(depth_m, abs=1e-6)
    normal = rotation_matrix(robot.arm.surface_pose[3:])[:, 2]
    assert normal == pytest.approx(robot.machine._axes[:, 2])


def test_touches_that_are_forgotten_are_made_again(robot):
    explorer = explorer_over(robot)
    for _ in range(2):
        press_at(robot, 0.0, 0.0)
        explorer.touch_surface()
        assert explorer.forget_touches() == 1
    assert explorer.forget_touches() == 0
    assert 'touch 1 taken' in explorer.touch_surface()


def test_a_touch_below_the_contact_force_is_refused_with_both_forces(robot):
    explorer = explorer_over(robot)
    for fraction, said in ((0.0, '0.00'), (0.5, '0.10')):
        press_at(robot, 0.0, 0.0, fraction=fraction)
        with pytest.raises(MotionRefused, match=rf'the force is {said} N, and 0\.2 N are needed'):
            explorer.touch_surface()
    assert explorer.forget_touches() == 0


def test_a_touch_with_a_sensor_that_was_never_zeroed_is_refused(robot):
    explorer = robot.explorer()
    explorer.connect()
    press_at(robot, 0.0, 0.0)
    with pytest.raises(MotionRefused, match='the force sensor is not zeroed'):
        explorer.touch_surface()


PRESS = ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=3.0, distance_m=0.02)


@pytest.fixture
def noisy():
    robot = Robot(TwistControllerParams(jitter_s=0.0, force_noise_n=0.02), touching_n=0.12).connect()
    return robot


def test_a_force_that_always_comes_half_a_second_late_by_its_stamp_is_refused_before_it_moves(noisy):
    noisy.hold_up_force(0.5)
    outcome = noisy.explore(PRESS)
    assert re.search(r'arrives 50\d ms after its stamp, and 80 ms are allowed', outcome.message)
    assert not any(any(velocity) for _, velocity in noisy.sent)


def test_a_force_that_becomes_late_while_the_finger_slides_stops_the_arm(noisy):
    def hold_up():
        if not noisy.late_s:
            noisy.hold_up_force(0.5)

    outcome = noisy.explore(PRESS, on_slide=hold_up)
    assert 'ms after its stamp' in outcome.message
    assert noisy.is_commanded_to_rest
    assert max(map(max, noisy.forces.values())) < 3.6


@pytest.mark.parametrize('stiffness_n_m', [2000.0, 5000.0])
@pytest.mark.parametrize('late_s', [0.1, 0.2, 0.5])
def test_a_late_force_whose_stamps_are_new_is_told_by_the_first_touch(late_s, stiffness_n_m):
    emulated = TwistControllerParams(jitter_s=0.0, force_noise_n=0.02, stiffness_n_m=stiffness_n_m)
    robot = Robot(emulated, touching_n=0.12)
    robot.stamps_are_honest = False
    robot.connect()
    robot.hold_up_force(late_s)
    outcome = robot.explore(replace(PRESS, force_n=5.0))
    assert "later than 'loop_delay_s'" in outcome.message
    assert outcome.lifted
    assert max(map(max, robot.forces.values())) < 5.0


@pytest.mark.parametrize('late_s', [0.03, 0.05])
def test_a_force_that_is_a_little_later_than_declared_does_no_harm_on_a_softer_contact(late_s):
    robot = Robot(TwistControllerParams(jitter_s=0.0, force_noise_n=0.02, stiffness_n_m=2000.0), touching_n=0.12)
    robot.stamps_are_honest = False
    robot.connect()
    robot.hold_up_force(late_s)
    outcome = robot.explore(replace(PRESS, force_n=5.0))
    assert outcome.success, outcome.message
    assert max(map(max, robot.forces.values())) < 6.0


class BusyRobot(Robot):
    """Now and then either end gets no computing time: nothing new comes, or steps are made up for in a row."""

    def __init__(self, *args, seed, **given):
        self.rng = np.random.default_rng(seed)
        self.paused_ns = self.asleep_ns = 0
        super().__init__(*args, **given)

    def newest_force(self):
        newest = super().newest_force()
        return newest if self.now_ns >= self.paused_ns else None

    def newest_pose(self):
        return super().newest_pose() if self.now_ns >= self.paused_ns else None

    def pass_time(self, time_s, command=None):
        if command is not None:
            self.arm.command(command)
        for _ in range(round(time_s * 1e9 / PERIOD_NS)):
            self.now_ns += PERIOD_NS
            self.machine.advance(self.now_ns)
            if self.rng.random() < 0.05:
                self.paused_ns = self.now_ns + int(self.rng.uniform(5e6, 60e6))
            if self.rng.random() < 0.05:
                self.asleep_ns = self.now_ns + int(self.rng.uniform(5e6, 40e6))
            if self.now_ns < self.asleep_ns:
                self.measure()
                continue
            self.arm.step()
            if self.now_ns < self.asleep_ns + 2 * PERIOD_NS:
                self.now_ns += 100_000
                self.arm.step()


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_a_late_force_whose_stamps_are_new_is_told_also_on_a_busy_machine(seed):
    emulated = TwistControllerParams(force_noise_n=0.002)
    robot = BusyRobot(emulated, seed=seed, deadman_s=0.4)
    robot.stamps_are_honest = False
    robot.connect()
    robot.hold_up_force(0.5)
    patient = replace(LIMITS, state_timeout_s=1.0, approach_timeout_s=60.0)
    outcome = robot.explore(PRESS, touch=TouchParams(approach_stiffness_n_m=20000.0), limits=patient)
    assert "later than 'loop_delay_s'" in outcome.message
    assert outcome.lifted
    assert max(map(max, robot.forces.values())) < 3.0


@pytest.mark.parametrize('stopped_ns', [500_000_000, 3_000_000_000])
def test_an_explorer_that_was_stopped_in_the_slide_lifts_a_finger_whose_arm_obeys(noisy, stopped_ns):
    """The guard has commanded zero meanwhile: the arm that stood still is not one that does not follow.

    Nor is it silent or late: after the stop the first looks find nothing, and then what waited all the while.
    """
    looks = []
    newest = {'pose': noisy.newest_pose, 'force': noisy.newest_force}

    def waiting(kind):
        def look():
            looks.append(kind)
            if looks.count(kind) > 5:
                return newest[kind]()
            return newest[kind]()._replace(stamp_ns=1, age_ns=stopped_ns) if looks.count(kind) == 5 else None

        return look

    def stop():
        if not looks:
            noisy.now_ns += stopped_ns
            noisy.machine.advance(noisy.now_ns)  # the emulated controller has a timeout
            noisy.newest_pose, noisy.newest_force = waiting('pose'), waiting('force')

    outcome = noisy.explore(PRESS, on_slide=stop)
    assert looks
    assert outcome.lifted, outcome.message
    assert noisy.machine.finger().force_n == 0.0


@pytest.mark.parametrize('clock_ahead_s', [-3600.0, -0.05, 3.0, 3600.0])
def test_clocks_that_do_not_agree_say_nothing_about_age(noisy, clock_ahead_s):
    noisy.clock_ahead_s = clock_ahead_s
    outcome = noisy.explore(PRESS)
    assert outcome.success, outcome.message


def test_a_finger_that_is_found_pressed_is_lifted_until_nothing_touches_it(robot, monkeypatch):
    explorer = robot.explorer()
    press_at(robot, 0.0, 0.0, fraction=0.0)
    robot.machine.position = robot.machine._origin - [0.0, 0.0, 0.002]
    robot.pass_time(0.05)
    assert robot.machine.finger().force_n == pytest.approx(4.0)
    monkeypatch.setattr('texture_exploration.explorer.Pacer', lambda *_: lambda: robot.pass_time(0.01))
    assert explorer.connect()[2] == pytest.approx(-0.002)
    assert explorer.lift() > 0.002
    assert robot.machine.finger().force_n == 0.0
    robot.pass_time(0.1)
    assert robot.is_commanded_to_rest


def test_a_heavy_tool_whose_zero_is_lost_after_a_success_is_not_taken_for_pressed(monkeypatch):
    heavy = TwistControllerParams(jitter_s=0.0, force_noise_n=0.02, tool_mass_kg=0.8)  # 7.8 N before it is zeroed
    robot = Robot(heavy, touching_n=0.12)
    monkeypatch.setattr(explorer_module, 'Pacer', lambda *_: lambda: robot.pass_time(0.01))
    explorer = robot.explorer()
    explorer.connect()
    robot.pass_time(0.25)

    def explored():
        exploration = explorer._prepare('one', PRESS)
        explorer._run(exploration)
        return exploration.outcome

    assert explored().success
    robot.pose_comes = False
    robot.pass_time(0.2)
    robot.pose_comes = True
    robot.pass_time(0.5)
    assert not robot.arm.zeroed
    outcome = explored()
    assert outcome.success, outcome.message


def test_a_check_commands_nothing_and_leaves_the_topics():
    robot = Robot(connect_timeout_s=0.1)
    robot.arm.check()
    assert (robot.sent, robot.closed) == ([], True)
    robot.pose_comes = False
    with pytest.raises(DeviceError, match='no pose arrives on'):
        robot.arm.check()
    assert robot.sent == []


def test_a_released_explorer_commands_rest_and_refuses_until_it_is_connected_again(robot):
    explorer = robot.explorer()
    explorer.connect()
    explorer.release()
    assert robot.is_commanded_to_rest
    assert robot.closed
    for ask in (
        explorer.recover,
        explorer.touch_surface,
        lambda: explorer.begin('one', ExplorationRequest('linear_slide')),
    ):
        with pytest.raises(MotionRefused, match='no control of the arm'):
            ask()
    explorer.connect()
    assert explorer.fault() == ''


def test_explorations_begin_where_somebody_else_left_the_finger_but_not_where_a_fault_did(robot):
    explorer = robot.explorer()
    home = explorer.connect()
    robot.machine.position = np.add(robot.machine.position, (0.05, 0.0, 0.0))
    assert explorer.connect() == pytest.approx(home)
    explorer.release()
    assert math.dist(explorer.connect(), home) == pytest.approx(0.05)


# Deviation from the parameters of the arm, and the largest true force in any direction that follows, N.
WALL = {'wall_m': 0.02, 'friction': 0.3}
SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=5.0, distance_m=0.06)
TRAVEL_M = 0.06
LIES = {
    'a wall in the slide': (WALL, {}, 45.0, 'along the surface'),
    'a wall stiffer than declared in a fast slide': (
        WALL,
        {'speed_m_s': 0.1, 'declared_n_m': 2000.0},
        75.0,
        'along the surface',
    ),
    'a wall on the way to the start': (WALL, {'travel': True}, 45.0, 'the finger met something'),
    'an inverted twist': ({'invert_twist': True}, {}, 5.0, 'the arm moved by'),
    'an inverted twist in contact': ({'invert_twist': True, 'start_height_m': 0.0}, {}, 15.0, 'the arm moved by'),
    'a force of the wrong sign': ({'invert_force': True}, {}, 6.0, 'its sign is wrong'),
    'a force in a frame turned by 90 degrees': ({'turn_force_rad': 1.57}, {}, 6.0, 'from the side'),
    'a force in a frame turned by -90 degrees': ({'turn_force_rad': -1.57}, {}, 6.0, 'from the side'),
    'a force in a frame turned by 180 degrees': ({'turn_force_rad': 3.14159}, {}, 6.0, 'its sign is wrong'),
    'a surface upside down': ({}, {'surface_rx_rad': math.pi}, 12.0, 'left the workspace'),
}


# A wall also where it is soft; the whole range is swept by the benchmark of motions.
@pytest.mark.parametrize(
    ('lie', 'stiffness_n_m'), [*((lie, 20000.0) for lie in LIES), *((lie, 2000.0) for lie in LIES if 'wall' in lie)]
)
def test_no_hidden_force_follows_from_what_is_not_as_the_arm_is_told(lie, stiffness_n_m, record_property):
    emulated, given, most_n, message = LIES[lie]
    params = {key: value for key, value in given.items() if key.startswith('surface')}
    params |= {'max_stiffness_n_m': 20000.0, 'max_impact_n': 0.5}
    robot = Robot(replace(NO_NOISE, force_noise_n=0.01, stiffness_n_m=stiffness_n_m, **emulated), **params)
    if given.get('travel'):
        robot.machine.position = robot.machine.position - [TRAVEL_M, 0.0, 0.0]
    robot.connect()
    robot.pass_time(0.05)
    home = robot.arm.state().position
    if given.get('travel'):
        home = (WALL['wall_m'] + 0.02, 0.0, home[2])
    request = replace(SLIDE, speed_m_s=given.get('speed_m_s', SLIDE.speed_m_s))
    touch = TouchParams(approach_stiffness_n_m=given.get('declared_n_m', stiffness_n_m))
    outcome = robot.explore(request, touch=touch, home=home)
    peak_n, end_n = max(robot.pressed_n), robot.pressed_n[-1]
    above_s = longest_above(robot.pressed_n, LIMITS.force_limit_n) * PERIOD_NS * 1e-9
    record_property('peak_n', peak_n)
    print(f'{lie}, {stiffness_n_m:g} N/m: {peak_n:.1f} N, {above_s:.3f} s above, {end_n:.1f} N left: {outcome}')
    assert not outcome.success
    assert peak_n < most_n
    assert above_s <= 0.1
    assert message in outcome.message
    assert end_n < 0.5 or not outcome.lifted


@pytest.mark.parametrize('further_m', np.linspace(0.0, 5e-4, 11))
def test_a_finger_that_barely_shows_a_wall_on_its_way_to_the_start_is_taken_off_it(further_m):
    """The arm stops later than the command, so the force grows after the end of the way, 20 kN/m."""
    wall_m = WALL['wall_m'] + further_m
    robot = Robot(replace(NO_NOISE, force_noise_n=0.01, stiffness_n_m=20000.0, wall_m=wall_m, friction=0.3))
    robot.machine.position = robot.machine.position - [TRAVEL_M, 0.0, 0.0]
    robot.connect()
    robot.pass_time(0.05)
    home = (WALL['wall_m'] + 0.02, 0.0, robot.arm.state().position[2])
    outcome = robot.explore(SLIDE, touch=TouchParams(approach_stiffness_n_m=20000.0), home=home)
    robot.pass_time(0.2)
    assert not outcome.success
    assert outcome.lifted
    assert robot.pressed_n[-1] < 0.5


def longest_above(forces_n, limit_n):
    """Return the largest number of readings in a row above a limit."""
    longest = run = 0
    for force_n in forces_n:
        run = run + 1 if force_n > limit_n else 0
        longest = max(longest, run)
    return longest


# --------------------
# Whether an arm follows what is commanded.

STEP_S = 0.004
DESCENT_M_S, LIFT_M_S = -0.0013, 0.05


def complaints(velocities_m_s, lag_s, gain=1.0):
    """Return what the watch says of an arm that does `gain` times what was commanded `lag_s` ago, (n, 3) m/s."""
    watch, late = FollowWatch(), round(lag_s / STEP_S)
    delayed = np.concatenate([np.zeros((late, 3)), velocities_m_s])[: len(velocities_m_s)]
    positions = np.cumsum(gain * delayed * STEP_S, axis=0)
    held_s = np.concatenate([[0.0], np.full(len(positions) - 1, STEP_S)])
    commanded = np.concatenate([velocities_m_s[:1], velocities_m_s[:-1]])  # until now
    steps = zip(positions, commanded, held_s, strict=True)
    said = [
        watch.update(round(number * STEP_S * 1e9), tuple(position), tuple(velocity), held)
        for number, (position, velocity, held) in enumerate(steps)
    ]
    return [sentence for sentence in said if sentence]


def along_normal(*parts):
    """Return velocities (n, 3) along the normal of parts (speed in m/s, duration in s)."""
    normal = np.concatenate([np.full(round(duration_s / STEP_S), speed_m_s) for speed_m_s, duration_s in parts])
    return np.column_stack([np.zeros((len(normal), 2)), normal])


@pytest.mark.parametrize('lag_s', [0.0, 0.04, 0.1])
def test_an_arm_that_is_lifted_out_of_its_slow_descent_follows_wherever_the_descent_ended(lag_s):
    for descent_s in np.arange(0.1, 3.2, 0.05):
        assert complaints(along_normal((DESCENT_M_S, descent_s), (LIFT_M_S, 0.6)), lag_s) == [], descent_s


@pytest.mark.parametrize('speed_m_s', [LIFT_M_S, -LIFT_M_S])
def test_an_arm_that_stands_still_after_the_reversal_is_noticed_within_half_a_second(speed_m_s):
    moving, blocked = along_normal((-speed_m_s, 0.4)), along_normal((speed_m_s, 0.5))
    watch = FollowWatch()
    place, said = 0.0, []
    for number, velocity in enumerate(np.concatenate([moving, blocked])):
        place += velocity[2] * STEP_S if number < len(moving) else 0.0
        said.append(watch.update(round(number * STEP_S * 1e9), (0.0, 0.0, place), tuple(velocity), STEP_S))
    assert not any(said[: len(moving)])
    assert any('mm commanded in 0.3 s' in sentence for sentence in said[len(moving) :])


def test_an_arm_that_stands_still_on_a_small_circle_is_noticed():
    angles = np.arange(0.0, 1.0, STEP_S) * 0.05 / 0.01  # rad: 50 mm/s on a radius of 10 mm
    circle = 0.05 * np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    assert complaints(circle, 0.1) == []
    assert complaints(circle, 0.0, gain=0.0)

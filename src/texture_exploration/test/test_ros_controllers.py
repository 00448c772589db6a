# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The arm behind ROS controllers without ROS: an emulated arm at the other end of its topics, in simulated time."""

import math
import re
import threading
from dataclasses import replace

import numpy as np
import pytest

from texture_core.errors import CommandRefused, DeviceError, ExplorationError, InvalidParameter, MotionRefused
from texture_core.types import ExplorationRequest, Phase, quaternion_matrix, rotation_matrix
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.tool_state import GRAVITY_M_S2, FollowWatch, ForceSample, PoseSample, ToolState
from texture_exploration.arms.tool_state import RosControllersParams as Params
from texture_exploration.exploration import Exploration
from texture_exploration.explorer import Explorer
from texture_exploration.motions import MOTIONS
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams
from texture_simulation.devices.twist_controller import TOOL_DOWN, EmulatedTwistArm, TwistControllerParams

PERIOD_NS = 4_000_000
EXPLORER_PERIODS = 2  # of the arm, in one of the explorer
NO_NOISE = TwistControllerParams(force_noise_n=0.0, jitter_s=0.0)
LIMITS = SafetyLimits(approach_timeout_s=30.0)  # a late arm comes down slowly on what may be stiff


class Robot:
    """The topics of an emulated arm, and the clock."""

    def __init__(self, emulated=NO_NOISE, **given):
        self.now_ns = 1_000_000_000
        self.arm = EmulatedTwistArm(emulated, self.now_ns)
        self.frames = ('base', 'tool0_controller')
        self.pose_comes = self.force_comes = True
        self.late_s, self.clock_ahead_s, self.stamps_are_honest = 0.0, 0.0, True  # of the force; of this machine
        self.readings = []
        self.heard_by = 1
        self.unsafe_because = ''
        self.sent = []  # velocities with their times
        self.forces = []
        self.pressed_n = []  # the true force, in any direction
        self.closed = False
        self.switched, self.refused_switches = [], ()
        self.driven = RosControllersArm(
            Params(**given), clock=lambda: self.now_ns, open_topics=lambda _params: self, own_thread=False
        )

    def newest_pose(self):
        x, y, z = self.arm.position.tolist()
        return PoseSample(self.now_ns, self.frames[0], (x, y, z), TOOL_DOWN) if self.pose_comes else None

    def measure(self):
        self.readings.append((self.now_ns, self.arm.reading_n().tolist()))

    def newest_force(self):
        self.measure()
        due_ns = self.now_ns - round(self.late_s * 1e9)
        while len(self.readings) > 1 and self.readings[1][0] <= due_ns:
            self.readings.pop(0)
        measured_ns, (x, y, z) = self.readings[0]
        stamp_ns = measured_ns if self.stamps_are_honest else self.now_ns
        age_ns = self.now_ns - stamp_ns + round(self.clock_ahead_s * 1e9)
        return ForceSample(stamp_ns, self.frames[1], (x, y, z), age_ns) if self.force_comes else None

    def hold_up_force(self, late_s):
        """Let the force come late by so much, as if it always had."""
        self.late_s, count = late_s, round(late_s * 1e9 / PERIOD_NS)
        past = [(self.now_ns - n * PERIOD_NS, self.arm.reading_n().tolist()) for n in range(count, 0, -1)]
        self.readings = past

    def listeners(self):
        return self.heard_by

    def unsafe(self):
        return self.unsafe_because

    def beat(self, *, moving):
        pass

    def send_velocity(self, velocity_m_s):
        self.sent.append((self.now_ns, velocity_m_s))
        self.arm.command(self.now_ns, np.array(velocity_m_s))

    def send_force(self, force_n):
        self.forces.append(force_n)
        self.arm.press(np.array(force_n))

    def switch_controllers(self, activate, deactivate):
        self.switched.append((*activate, '-', *deactivate))
        if len(self.switched) in self.refused_switches:
            raise DeviceError('the manager refused')

    def close(self):
        self.closed = True

    def pass_time(self, time_s, command=None):
        """Let time pass; the command is given again in each period of the explorer."""
        for period in range(round(time_s * 1e9 / PERIOD_NS)):
            if command is not None and period % EXPLORER_PERIODS == 0:
                self.driven.command(command)
            self.now_ns += PERIOD_NS
            self.arm.advance(self.now_ns)
            self.pressed_n.append(float(np.linalg.norm(self.arm.force_n)))
            self.driven.step()

    def connect(self):
        """Connect, and come to rest, as every connection begins."""
        self.driven.connect()
        self.pass_time(0.25)

    @property
    def is_commanded_to_rest(self):
        return not any(self.sent[-1][1])

    def zero_force(self):
        """Rise in free air and rest: then the force sensor is zeroed."""
        self.pass_time(0.3, ArmCommand(normal_m_s=0.02))
        self.pass_time(0.4, ArmCommand())
        assert self.driven.zeroed

    def explore(self, request, touch, meanwhile=lambda phase: None, *, home=None, on_slide=lambda: None, limits=LIMITS):
        home = home or self.driven.state().position
        motion = MOTIONS[request.motion](request, home, touch, limits)
        forces = {}

        def note(state):
            forces.setdefault(state.phase.value, []).append(self.arm.finger().force_n)
            if state.phase is Phase.SLIDE:
                on_slide()
            meanwhile(state.phase.value)

        exploration = Exploration(
            'one',
            request,
            arm=self.driven,
            motion=motion.lift_first(lambda: self.driven.zeroed),
            limits=limits,
            clock=lambda: self.now_ns,
            on_state=note,
        )
        return exploration.run(lambda: self.pass_time(0.01)), forces

    def explorer(self):
        return Explorer(self.driven, TouchParams(), LIMITS, lambda state: None, clock=lambda: self.now_ns)


@pytest.fixture
def robot():
    robot = Robot()
    robot.connect()
    return robot


def test_the_velocity_is_commanded_in_the_base_frame_and_measured_in_that_of_the_surface():
    turned = {'surface_rx_rad': 0.0, 'surface_ry_rad': 0.3}
    robot = Robot(TwistControllerParams(jitter_s=0.0, force_noise_n=0.0, **turned), **turned)
    robot.connect()
    robot.pass_time(0.5, ArmCommand(tangential_m_s=(0.02, -0.01)))
    expected = rotation_matrix((0.0, 0.3, 0.0)) @ [0.02, -0.01, 0.0]
    assert robot.sent[-1][1] == pytest.approx(expected)
    assert robot.driven.state().velocity == pytest.approx((0.02, -0.01, 0.0), abs=1e-6)
    assert robot.driven.state().position[2] == pytest.approx(0.01, abs=1e-6)


def test_a_controller_in_the_frame_of_the_tool_is_commanded_in_that_frame():
    robot = Robot(twist_frame_id='tool0_controller')
    robot.connect()
    robot.pass_time(0.02, ArmCommand(tangential_m_s=(0.02, 0.01), normal_m_s=0.03))
    assert robot.sent[-1][1] == pytest.approx((0.02, -0.01, -0.03))  # the tool looks down


def test_offset_and_weight_of_the_tool_are_removed_in_free_air_and_the_force_is_that_of_the_surface(robot):
    assert abs(robot.driven.state().force_n) > 1.0
    robot.zero_force()
    robot.pass_time(0.1)
    assert robot.driven.state().force_n == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('friction', [0.15, 0.6])
def test_the_tangential_force_is_friction_times_the_normal_force_and_unknown_at_rest(friction):
    robot = Robot(replace(NO_NOISE, friction=friction))
    robot.connect()
    robot.zero_force()
    assert math.isnan(robot.driven.state().tangential_force_n)
    while robot.driven.state().position[2] > 0.001:
        robot.pass_time(0.1, ArmCommand(normal_m_s=-0.01))
    robot.pass_time(3.0, ArmCommand(force_n=3.0))
    robot.pass_time(0.8, ArmCommand(tangential_m_s=(0.016, -0.012), force_n=3.0))
    state = robot.driven.state()
    assert state.force_n > 2.0
    assert state.tangential_force_n == pytest.approx(friction * state.force_n, rel=0.05)


def test_the_weight_is_removed_also_when_the_tool_has_turned_since_the_zero():
    params = Params(tool_mass_kg=0.5)
    tool = ToolState(params)
    weight = np.array([0.0, 0.0, -0.5 * GRAVITY_M_S2])
    offset = np.array([0.7, -0.2, 1.1])

    def show(now_ns, quaternion, height_m, push_n=0.0, moving=False):
        to_base = quaternion_matrix(quaternion)
        tool.take_pose(now_ns, PoseSample(now_ns, 'base', (0.4, 0.0, 0.1 + height_m), quaternion))
        force = to_base.T @ (weight + np.array([0.0, 0.0, push_n])) + offset
        tool.take_force(now_ns, ForceSample(now_ns, 'tool0_controller', tuple(force)), moving=moving)
        return tool.state('').force_n

    for step in range(50):
        show(4_000_000 * (step + 1), TOOL_DOWN, 0.01 + 1e-4 * step, moving=True)
    for step in range(60):
        show(4_000_000 * (51 + step), TOOL_DOWN, 0.015)
    assert tool.zero.zeroed
    assert tool.zero.offset_n == pytest.approx(offset)
    turned = (math.sin(0.6), 0.0, 0.0, math.cos(0.6))
    assert show(4_000_000 * 120, turned, 0.015, push_n=2.0) == pytest.approx(2.0)


def test_the_sensor_is_not_zeroed_in_contact(robot):
    robot.zero_force()
    robot.driven.recover()
    assert not robot.driven.zeroed
    robot.arm.position = robot.arm._origin - [0.0, 0.0, 0.02]  # 40 N
    robot.pass_time(0.3, ArmCommand(normal_m_s=0.01))
    robot.pass_time(0.5, ArmCommand())
    assert robot.arm.finger().force_n > 5.0
    assert not robot.driven.zeroed


def test_a_command_with_a_force_rises_first_and_presses_once_the_sensor_is_zeroed():
    robot = Robot(TwistControllerParams(start_height_m=0.002))
    robot.connect()
    robot.pass_time(0.1, ArmCommand(force_n=1.0))
    assert robot.sent[-1][1][2] > 0
    robot.pass_time(12.0, ArmCommand(force_n=1.0))
    assert robot.driven.zeroed
    assert robot.arm.finger().force_n == pytest.approx(1.0, abs=0.02)


def test_a_force_that_changes_all_the_way_up_is_a_fault(robot):
    robot.arm.position = robot.arm._origin - [0.0, 0.0, 0.05]
    robot.pass_time(3.0, ArmCommand(force_n=1.0))
    assert 'could not be zeroed' in robot.driven.state().fault
    assert robot.is_commanded_to_rest


@pytest.mark.parametrize('what', ['pose', 'force'])
def test_a_stale_pose_or_force_commands_zero_velocity_within_100_ms(robot, what):
    robot.pass_time(0.2, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert not robot.is_commanded_to_rest
    setattr(robot, f'{what}_comes', False)
    begin_ns = robot.now_ns
    robot.pass_time(0.2, ArmCommand(tangential_m_s=(0.02, 0.0)))
    first_ns = next(time_ns for time_ns, velocity in robot.sent if time_ns > begin_ns and not any(velocity))
    assert (first_ns - begin_ns) * 1e-9 <= 0.1
    assert f'no {what} has arrived on' in robot.driven.state().fault
    assert not any(velocity != (0.0, 0.0, 0.0) for time_ns, velocity in robot.sent if time_ns >= first_ns)


def test_a_broadcaster_that_repeats_an_old_pose_counts_as_stale(robot):
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    frozen = robot.newest_pose()
    robot.newest_pose = lambda: frozen
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert 'no pose has arrived' in robot.driven.state().fault


def test_a_command_that_is_not_repeated_ends_in_zero_velocity(robot):
    robot.driven.command(ArmCommand(tangential_m_s=(0.02, 0.0)))
    robot.pass_time(0.05)
    assert not robot.is_commanded_to_rest
    robot.pass_time(0.1)
    assert robot.is_commanded_to_rest


def test_a_command_out_of_range_is_refused_and_zero_velocity_is_commanded(robot):
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    with pytest.raises(CommandRefused):
        robot.driven.command(ArmCommand(tangential_m_s=(math.nan, 0.0)))
    robot.pass_time(0.01)
    assert robot.is_commanded_to_rest


def test_at_rest_nothing_is_sent_after_a_while_so_that_others_may_command(robot):
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    robot.driven.stop()
    robot.pass_time(1.0)
    number = len(robot.sent)
    robot.pass_time(1.0)
    assert len(robot.sent) == number


def test_closing_commands_zero_velocity_and_leaves_the_topics(robot):
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    robot.driven.close()
    assert robot.is_commanded_to_rest
    assert robot.closed
    with pytest.raises(DeviceError, match='not connected'):
        robot.driven.state()


def test_a_controller_that_ends_is_named(robot):
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    robot.heard_by = 0
    robot.pass_time(0.01, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert "no node subscribed to 'twist_controller/twist'" in robot.driven.state().unsafe
    assert robot.is_commanded_to_rest
    robot.pass_time(0.3, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert "no node subscribes to 'twist_controller/twist' any more" in robot.driven.state().fault
    robot.heard_by = 1
    robot.driven.recover()
    robot.pass_time(0.1, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert robot.driven.state().fault == ''


class BrokenLink(Robot):
    """A controller that keeps executing the last velocity, and a link to it that breaks."""

    commands_arrive = True

    def __init__(self):
        super().__init__(replace(NO_NOISE, command_timeout_s=0.0))

    def send_velocity(self, velocity_m_s):
        self.sent.append((self.now_ns, velocity_m_s))
        if self.commands_arrive:
            self.arm.command(self.now_ns, np.array(velocity_m_s))

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
    assert np.linalg.norm(robot.arm.velocity) == pytest.approx(0.03)
    robot.pass_time(0.3)
    assert np.linalg.norm(robot.arm.velocity) == 0.0
    robot.pass_time(1.0)
    robot.driven.recover()
    robot.pass_time(0.6, ArmCommand(tangential_m_s=(0.03, 0.0)))
    assert robot.driven.state().fault == ''
    assert np.linalg.norm(robot.arm.velocity) == pytest.approx(0.03)


def test_an_arm_that_moves_when_it_is_connected_rests_before_it_follows_a_command():
    robot = BrokenLink()
    robot.arm.command(robot.now_ns, np.array([0.0, 0.03, 0.0]))
    robot.arm.advance(robot.now_ns + 100_000_000)
    robot.now_ns += 100_000_000
    robot.driven.connect()
    robot.pass_time(0.3, ArmCommand(tangential_m_s=(0.02, 0.0)))
    robot.pass_time(0.3, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert robot.arm.velocity == pytest.approx([0.02, 0.0, 0.0])
    first = next(number for number, (_, velocity) in enumerate(robot.sent) if any(velocity))
    assert (robot.sent[first][0] - robot.sent[0][0]) * 1e-9 >= 0.2
    assert not any(any(velocity) for _, velocity in robot.sent[:first])


def test_an_arm_that_somebody_else_moves_is_a_fault_and_zero_velocity_is_all_it_is_told():
    robot = BrokenLink()
    robot.commands_arrive = False
    robot.arm.command(robot.now_ns, np.array([0.0, 0.03, 0.0]))
    robot.driven.connect()
    robot.pass_time(2.2, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert 'the arm moves although zero velocity is commanded' in robot.driven.state().fault
    assert not any(any(velocity) for _, velocity in robot.sent)


def test_a_controller_that_gets_no_computing_time_is_not_one_that_does_not_follow():
    """It neither moves the arm nor shows a pose meanwhile."""
    robot = Robot(deadman_s=1.0)
    robot.connect()
    robot.pass_time(0.2, ArmCommand(tangential_m_s=(0.03, 0.0)))
    robot.pose_comes, robot.arm.advance = False, lambda _now_ns: None
    robot.pass_time(0.6, ArmCommand(tangential_m_s=(0.03, 0.0)))
    robot.pose_comes = True
    del robot.arm.advance
    robot.pass_time(0.2, ArmCommand(tangential_m_s=(0.03, 0.0)))
    assert (robot.driven.state().unsafe, robot.driven.state().fault) == ('', '')


def test_stamps_from_the_future_are_named_as_clocks_that_do_not_agree(robot):
    assert robot.driven.warning() == ''
    robot.clock_ahead_s = -0.05
    robot.pass_time(0.1)
    assert re.search(r"the clock that stamps the force on '.*' is 50 ms ahead", robot.driven.warning())
    assert robot.driven.state().fault == ''


SLIDE = ExplorationRequest('linear_slide', speed_m_s=0.02, force_n=1.0, distance_m=0.05)


def test_a_controller_that_is_gone_for_6_ms_in_the_slide_ends_it_with_the_finger_lifted():
    robot = Robot(replace(NO_NOISE, start_height_m=0.003, force_noise_n=0.002))
    robot.connect()
    gone_ns = []

    def listeners():
        return 0 if gone_ns and robot.now_ns - gone_ns[0] <= 6_000_000 else 1

    robot.listeners = listeners
    outcome, _ = robot.explore(SLIDE, TouchParams(), on_slide=lambda: gone_ns.append(robot.now_ns))
    assert gone_ns
    assert not outcome.success
    assert 'no node subscribed' in outcome.message
    assert outcome.lifted
    assert robot.arm.finger().force_n == 0.0
    assert robot.arm.finger().z_m > 0.001


@pytest.mark.parametrize('why', ["'/other' also commands the arm", 'the guard process has ended'])
def test_what_makes_the_arm_unsafe_while_it_obeys_ends_the_slide_with_the_finger_lifted(why):
    robot = Robot(replace(NO_NOISE, start_height_m=0.003, force_noise_n=0.002))
    robot.connect()
    outcome, _ = robot.explore(SLIDE, TouchParams(), on_slide=lambda: setattr(robot, 'unsafe_because', why))
    assert not outcome.success
    assert why in outcome.message
    assert outcome.lifted
    assert robot.arm.finger().z_m > 0.001
    robot.pass_time(0.3, ArmCommand(normal_m_s=-0.01))
    assert robot.is_commanded_to_rest
    explorer = robot.explorer()
    assert why in explorer.fault()
    with pytest.raises(DeviceError, match=why):
        robot.driven.recover()


def test_a_process_that_was_told_to_end_waits_for_no_controller_and_commands_nothing(monkeypatch):
    robot = Robot(connect_timeout_s=30.0)
    ending = threading.Event()
    ending.set()
    monkeypatch.setattr('texture_exploration.arms.arm.ENDING', ending)
    with pytest.raises(DeviceError, match='aborted, as this process was asked to end'):
        robot.driven.connect()
    assert not any(any(velocity) for _, velocity in robot.sent)


def test_a_controller_that_listens_without_moving_the_arm_is_named_and_recovers():
    robot = Robot(TwistControllerParams(active=False))
    robot.connect()
    robot.pass_time(0.5, ArmCommand(tangential_m_s=(0.02, 0.0)))
    assert 'mm commanded' in robot.driven.state().unsafe
    assert 'is not active' in robot.driven.state().unsafe
    assert robot.is_commanded_to_rest
    robot.pass_time(0.5, ArmCommand(normal_m_s=0.02))  # nor does it follow a lift
    assert 'mm commanded' in robot.driven.state().fault
    assert robot.is_commanded_to_rest


@pytest.mark.parametrize('held_up_s', [0.5, 60.0])
def test_an_arm_that_is_held_up_in_the_slide_lifts_the_finger_if_it_can(noisy, held_up_s, monkeypatch):
    """As by a controller that gets no computing time: it stands, and may obey again."""
    until_ns, follow = [], noisy.arm.command

    def stand(now_ns, velocity_m_s):
        follow(now_ns, velocity_m_s if now_ns > until_ns[0] else np.zeros(3))

    def hold_up():
        if not until_ns:
            until_ns.append(noisy.now_ns + round(held_up_s * 1e9))
            noisy.arm.command = stand

    monkeypatch.setattr(TouchParams, 'stall_s', 5.0)
    patient = TouchParams(lost_contact_s=5.0)
    outcome, _ = noisy.explore(replace(PRESS, speed_m_s=0.05), patient, on_slide=hold_up)
    assert 'mm commanded' in outcome.message
    assert outcome.lifted is (held_up_s < 1.0)
    assert (noisy.arm.finger().force_n == 0.0) is outcome.lifted


def test_a_finger_that_stalls_in_mid_slide_aborts_within_half_a_second(monkeypatch):
    robot = Robot(TwistControllerParams(start_height_m=0.003, jitter_s=0.0))
    robot.connect()
    follow, stalled_ns = robot.arm.command, []

    def follow_along_the_normal_only(now_ns, velocity_m_s):
        if robot.arm.finger().x_m > 0.01:
            stalled_ns.append(now_ns)
            normal = robot.arm._axes[:, 2]
            velocity_m_s = normal * (normal @ velocity_m_s)
        follow(now_ns, velocity_m_s)

    monkeypatch.setattr(robot.arm, 'command', follow_along_the_normal_only)
    request = ExplorationRequest('linear_slide', speed_m_s=0.05, distance_m=0.04)
    outcome, _ = robot.explore(request, TouchParams())
    assert (outcome.success, outcome.slid) == (False, True)
    assert 'the finger stalled' in outcome.message or 'mm commanded' in outcome.message
    still_sliding = [at_ns for at_ns, velocity in robot.sent if abs(velocity[0]) + abs(velocity[1]) > 0.04]
    assert 0.1 < (still_sliding[-1] - stalled_ns[0]) * 1e-9 < 0.5


def test_a_late_arm_that_limits_its_speed_still_follows():
    robot = Robot(TwistControllerParams(lag_s=0.08, max_speed_m_s=0.1, max_acceleration_m_s2=1.0))
    robot.connect()
    robot.pass_time(1.0, ArmCommand(tangential_m_s=(0.2, 0.0)))
    assert robot.driven.state().fault == ''


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
        robot.driven.connect()
    assert robot.closed
    assert not any(any(velocity) for _, velocity in robot.sent)


def test_a_frame_for_velocities_that_is_neither_base_nor_tool_is_refused():
    with pytest.raises(InvalidParameter, match="it must be the base frame 'base'"):
        Params(twist_frame_id='world')


@pytest.mark.parametrize('stiffness_n_m', [600.0, 2000.0, 20000.0])
def test_the_force_is_kept_from_a_thirtieth_of_the_declared_stiffness_on(stiffness_n_m):
    emulated = TwistControllerParams(lag_s=0.02, jitter_s=0.002, stiffness_n_m=stiffness_n_m, start_height_m=0.002)
    robot = Robot(emulated, max_stiffness_n_m=20000.0, max_impact_n=0.5)
    robot.connect()
    request = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=1.0, distance_m=0.06)
    outcome, forces = robot.explore(request, TouchParams(approach_stiffness_n_m=20000.0))
    assert outcome.success, outcome.message
    assert max(forces['contact']) < 1.2
    assert np.sqrt(np.mean((np.array(forces['slide']) - 1.0) ** 2)) < 0.1  # the tolerance with which a slide begins


def test_a_compliance_controller_presses_by_itself_and_is_let_go_at_the_end():
    robot = Robot(TwistControllerParams(jitter_s=0.0), target_wrench_topic='target_wrench')
    robot.connect()
    robot.zero_force()
    robot.pass_time(6.0, ArmCommand(force_n=2.0))
    assert robot.forces[-1] == pytest.approx((0.0, 0.0, -2.0))
    assert robot.arm.finger().force_n == pytest.approx(2.0, rel=0.05)
    robot.driven.stop()
    robot.pass_time(0.05)
    assert robot.forces[-1] == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('motion', MOTIONS)
def test_every_motion_succeeds_behind_a_late_controller(motion):
    robot = Robot(TwistControllerParams(start_height_m=0.003))
    robot.connect()
    requests = {
        'circular': {'speed_m_s': 0.05, 'turns': 0.5},
        'in_hand_sliding': {'duration_s': 1.0},
        'in_hand_random': {'duration_s': 1.0},
    }
    outcome, _ = robot.explore(ExplorationRequest(motion, **requests.get(motion, {'distance_m': 0.02})), TouchParams())
    assert outcome.success, outcome.message


@pytest.mark.parametrize(
    ('off_m', 'where'), [(0.079, '0.179) m in the base frame, 79 mm above'), (-0.025, '25 mm below')]
)
def test_a_contact_far_from_the_declared_surface_is_refused_with_both_places_and_the_finger_lifted(off_m, where):
    robot = Robot(TwistControllerParams(surface_z_m=0.1 + off_m))
    robot.connect()
    outcome, _ = robot.explore(PRESS, TouchParams(), limits=replace(LIMITS, z_low_m=-0.05))
    assert (outcome.error, outcome.slid, outcome.lifted) == (ExplorationError.NO_SURFACE, False, True)
    assert where in outcome.message
    assert "the surface declared at (0.4, 0, 0.1) m, and 20 mm are allowed ('surface_tolerance_m')" in outcome.message
    assert max(robot.pressed_n) < PRESS.force_n
    assert robot.arm.finger().force_n == 0.0
    robot.connect()
    outcome, _ = robot.explore(PRESS, TouchParams(), limits=replace(LIMITS, z_low_m=-0.05, surface_tolerance_m=0.08))
    assert outcome.success, outcome.message


def explorer_over(robot):
    explorer = robot.explorer()
    explorer.connect()
    robot.pass_time(0.25)
    robot.zero_force()
    return explorer


def press_at(robot, x_m, y_m, z_m=0.0, fraction=2.0):
    """Press a place as an operator would, `z_m` above the surface, with so many times the least force of a touch."""
    depth_m = fraction * TouchParams().contact_force_n / robot.arm.params.stiffness_n_m
    robot.arm.position = robot.arm._origin + robot.arm._axes @ [x_m, y_m, z_m - depth_m]
    robot.pass_time(0.02)
    return depth_m


def test_a_tilted_surface_is_found_by_four_touches_and_the_last_shows_the_residual():
    tilted = TwistControllerParams(jitter_s=0.0, force_noise_n=0.0, surface_rx_rad=0.1, surface_ry_rad=-0.2)
    robot = Robot(tilted)
    explorer = explorer_over(robot)
    for count, place in enumerate(((0.0, 0.0), (0.05, 0.0), (0.02, 0.04)), start=1):
        press_at(robot, *place)
        assert f'touch the surface at {4 - count} more place' in explorer.touch_surface()
    assert robot.driven.surface_pose[3:] == (0.0, 0.0, 0.0)
    depth_m = press_at(robot, 0.04, 0.03)
    assert 'residual 0.00 mm rms, largest 0.00 mm' in explorer.touch_surface()
    patch = explorer.patch  # the rectangle around the touches, about their middle
    assert patch.patch_x_high_m - patch.patch_x_low_m == pytest.approx(0.05, abs=0.002)
    explorer.connect()
    for place in ((0.01, -0.03), (-0.04, 0.02)):
        press_at(robot, *place, fraction=0.0)
        assert robot.driven.state().position[2] == pytest.approx(depth_m, abs=1e-6)
    normal = rotation_matrix(robot.driven.surface_pose[3:])[:, 2]
    assert normal == pytest.approx(robot.arm._axes[:, 2])


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
    robot = Robot(TwistControllerParams(jitter_s=0.0, force_noise_n=0.02), touching_n=0.12)
    robot.connect()
    return robot


def test_a_force_that_always_comes_half_a_second_late_by_its_stamp_is_refused_before_it_moves(noisy):
    noisy.hold_up_force(0.5)
    outcome, _ = noisy.explore(PRESS, TouchParams())
    assert re.search(r'arrives 50\d ms after its stamp, and 80 ms are allowed', outcome.message)
    assert not any(any(velocity) for _, velocity in noisy.sent)


def test_a_force_that_becomes_late_while_the_finger_slides_stops_the_arm(noisy):
    def hold_up(phase):
        if phase == 'slide' and not noisy.late_s:
            noisy.hold_up_force(0.5)

    outcome, forces = noisy.explore(PRESS, TouchParams(), hold_up)
    assert 'ms after its stamp' in outcome.message
    assert noisy.is_commanded_to_rest
    assert max(map(max, forces.values())) < 3.6


@pytest.mark.parametrize('stiffness_n_m', [2000.0, 5000.0])
@pytest.mark.parametrize('late_s', [0.1, 0.2, 0.5])
def test_a_late_force_whose_stamps_are_new_is_told_by_the_first_touch(late_s, stiffness_n_m):
    emulated = TwistControllerParams(jitter_s=0.0, force_noise_n=0.02, stiffness_n_m=stiffness_n_m)
    robot = Robot(emulated, touching_n=0.12)
    robot.stamps_are_honest = False
    robot.connect()
    robot.hold_up_force(late_s)
    outcome, forces = robot.explore(replace(PRESS, force_n=5.0), TouchParams())
    assert "later than 'loop_delay_s'" in outcome.message
    assert outcome.lifted
    assert max(map(max, forces.values())) < 5.0


@pytest.mark.parametrize('late_s', [0.03, 0.05])
def test_a_force_that_is_a_little_later_than_declared_does_no_harm_on_a_softer_contact(late_s):
    robot = Robot(TwistControllerParams(jitter_s=0.0, force_noise_n=0.02, stiffness_n_m=2000.0), touching_n=0.12)
    robot.stamps_are_honest = False
    robot.connect()
    robot.hold_up_force(late_s)
    outcome, forces = robot.explore(replace(PRESS, force_n=5.0), TouchParams())
    assert outcome.success, outcome.message
    assert max(map(max, forces.values())) < 6.0


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
            self.driven.command(command)
        for _ in range(round(time_s * 1e9 / PERIOD_NS)):
            self.now_ns += PERIOD_NS
            self.arm.advance(self.now_ns)
            if self.rng.random() < 0.05:
                self.paused_ns = self.now_ns + int(self.rng.uniform(5e6, 60e6))
            if self.rng.random() < 0.05:
                self.asleep_ns = self.now_ns + int(self.rng.uniform(5e6, 40e6))
            if self.now_ns < self.asleep_ns:
                self.measure()
                continue
            self.driven.step()
            if self.now_ns < self.asleep_ns + 2 * PERIOD_NS:
                self.now_ns += 100_000
                self.driven.step()


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_a_late_force_whose_stamps_are_new_is_told_also_on_a_busy_machine(seed):
    emulated = TwistControllerParams(force_noise_n=0.002)
    robot = BusyRobot(emulated, seed=seed, deadman_s=0.4)
    robot.stamps_are_honest = False
    robot.connect()
    robot.hold_up_force(0.5)
    patient = replace(LIMITS, state_timeout_s=1.0, approach_timeout_s=60.0)
    outcome, forces = robot.explore(PRESS, TouchParams(approach_stiffness_n_m=20000.0), limits=patient)
    assert "later than 'loop_delay_s'" in outcome.message
    assert outcome.lifted
    assert max(map(max, forces.values())) < 3.0


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
            noisy.arm.advance(noisy.now_ns)  # the emulated controller has a timeout
            noisy.newest_pose, noisy.newest_force = waiting('pose'), waiting('force')

    outcome, _ = noisy.explore(PRESS, TouchParams(), on_slide=stop)
    assert looks
    assert outcome.lifted, outcome.message
    assert noisy.arm.finger().force_n == 0.0


@pytest.mark.parametrize('clock_ahead_s', [-3600.0, -0.05, 3.0, 3600.0])
def test_clocks_that_do_not_agree_say_nothing_about_age(noisy, clock_ahead_s):
    noisy.clock_ahead_s = clock_ahead_s
    outcome, _ = noisy.explore(PRESS, TouchParams())
    assert outcome.success, outcome.message


def test_a_finger_that_is_found_pressed_is_lifted_until_nothing_touches_it(robot, monkeypatch):
    explorer = robot.explorer()
    press_at(robot, 0.0, 0.0, fraction=0.0)
    robot.arm.position = robot.arm._origin - [0.0, 0.0, 0.002]
    robot.pass_time(0.05)
    assert robot.arm.finger().force_n == pytest.approx(4.0)
    monkeypatch.setattr('texture_exploration.explorer.Pacer', lambda *_: lambda: robot.pass_time(0.01))
    assert explorer.connect()[2] == pytest.approx(-0.002)
    assert explorer.lift() > 0.002
    assert robot.arm.finger().force_n == 0.0
    robot.pass_time(0.1)
    assert robot.is_commanded_to_rest


def test_a_check_commands_nothing_and_leaves_the_topics():
    robot = Robot(connect_timeout_s=0.1)
    robot.driven.check()
    assert (robot.sent, robot.closed) == ([], True)
    robot.pose_comes = False
    with pytest.raises(DeviceError, match='no pose arrives on'):
        robot.driven.check()
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
    robot.arm.position = np.add(robot.arm.position, (0.05, 0.0, 0.0))
    assert explorer.connect() == pytest.approx(home)
    explorer.release()
    assert math.dist(explorer.connect(), home) == pytest.approx(0.05)


MANAGED = {
    'controller_manager': 'controller_manager',
    'activate_controllers': 'twist',
    'deactivate_controllers': 'joints',
}
TAKEN, GIVEN_BACK = ('twist', '-', 'joints'), ('joints', '-', 'twist')


def test_controllers_are_switched_for_the_connection_and_back_once_the_arm_is_at_rest():
    robot = Robot(**MANAGED)
    robot.driven.check()
    assert robot.switched == []  # a check takes no control
    robot.connect()
    assert robot.switched == [TAKEN]
    robot.driven.close()
    assert robot.switched == [TAKEN, GIVEN_BACK]
    assert robot.is_commanded_to_rest
    robot.driven.close()
    assert len(robot.switched) == 2


def test_a_refused_switch_ends_the_connection_and_one_that_was_done_is_undone():
    robot = Robot(connect_timeout_s=0.1, **MANAGED)
    robot.refused_switches = (1,)
    with pytest.raises(DeviceError, match='the manager refused'):
        robot.driven.connect()
    assert (robot.switched, robot.closed) == ([TAKEN], True)
    robot.pose_comes = False
    with pytest.raises(DeviceError, match='no pose arrives'):
        robot.driven.connect()
    assert robot.switched[1:] == [TAKEN, GIVEN_BACK]


def test_controllers_that_cannot_be_switched_back_are_a_warning():
    robot = Robot(**MANAGED)
    robot.connect()
    robot.refused_switches = (2,)
    robot.driven.close()
    assert robot.closed
    assert robot.driven.warning() == 'the controllers were not switched back: the manager refused'


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


@pytest.mark.parametrize('stiffness_n_m', [2000.0, 20000.0])
@pytest.mark.parametrize('lie', LIES)
def test_no_hidden_force_follows_from_what_is_not_as_the_arm_is_told(lie, stiffness_n_m, record_property):
    emulated, given, most_n, message = LIES[lie]
    params = {key: value for key, value in given.items() if key.startswith('surface')}
    params |= {'max_stiffness_n_m': 20000.0, 'max_impact_n': 0.5}
    robot = Robot(replace(NO_NOISE, force_noise_n=0.01, stiffness_n_m=stiffness_n_m, **emulated), **params)
    if given.get('travel'):
        robot.arm.position = robot.arm.position - [TRAVEL_M, 0.0, 0.0]
    robot.connect()
    robot.pass_time(0.05)
    home = robot.driven.state().position
    if given.get('travel'):
        home = (WALL['wall_m'] + 0.02, 0.0, home[2])
    request = replace(SLIDE, speed_m_s=given.get('speed_m_s', SLIDE.speed_m_s))
    touch = TouchParams(approach_stiffness_n_m=given.get('declared_n_m', stiffness_n_m))
    outcome, _ = robot.explore(request, touch, home=home)
    peak_n, end_n = max(robot.pressed_n), robot.pressed_n[-1]
    above_s = longest_above(robot.pressed_n, LIMITS.force_limit_n) * PERIOD_NS * 1e-9
    record_property('peak_n', peak_n)
    print(f'{lie}, {stiffness_n_m:g} N/m: {peak_n:.1f} N, {above_s:.3f} s above, {end_n:.1f} N left: {outcome}')
    assert not outcome.success
    assert peak_n < most_n
    assert above_s <= 0.1
    assert message in outcome.message
    assert end_n < 0.5 or not outcome.lifted


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


def test_an_arm_that_goes_to_and_fro_follows():
    assert complaints(along_normal(*[(speed, 0.5) for speed in (0.05, -0.05)] * 4), 0.1) == []


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

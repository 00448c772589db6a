# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""What is sent to the UR controller, cycle by cycle, on a controller that is made up."""

import importlib.util
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest

from texture_core.errors import DeviceError
from texture_core.types import ExplorationRequest
from texture_exploration.arms import ur as ur_probe
from texture_exploration.arms import ur_worker
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.ur import UrArm, UrArmParams, UrCommand, UrReport
from texture_exploration.arms.ur_worker import (
    SILENT_S,
    STOP_DECELERATION_M_S2,
    Observer,
    UrCommandStream,
    Watchdog,
    Worker,
)
from texture_exploration.explorer import Explorer
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams
from texture_simulation.devices import ur

PARAMS = UrArmParams(surface_x_m=0.0, surface_z_m=0.0)
CYCLE_NS = 4_000_000
RISING = UrCommand(0, (0.0, 0.0, 0.05), None)


class Control:
    """Takes whatever comes, but refuses to zero the force sensor a given number of times; moves as commanded."""

    def __init__(self, refusals):
        self.refusals = refusals
        self.zeroed = 0
        self.velocity_m_s = 0.0

    def zeroFtSensor(self):  # noqa: N802 (as in ur-rtde)
        self.refusals -= 1
        self.zeroed += self.refusals < 0
        return self.refusals < 0

    def speedL(self, velocity, *_):  # noqa: N802
        self.velocity_m_s = velocity[2]
        return True

    def __getattr__(self, name):
        return lambda *_: True


class Arm:
    """The stream with a controller in its own time."""

    def __init__(self, refusals=0):
        self.control = Control(refusals)
        watchdog = Watchdog(self.control, PARAMS, guard=lambda _seconds: None, clock=lambda: self.time_ns * 1e-9)
        self.stream = UrCommandStream(self.control, PARAMS, watchdog)
        self.time_ns, self.height_m = 0, 0.01
        watchdog.arm()

    def cycles(self, seconds, command):
        for _ in range(round(seconds * 1e9 / CYCLE_NS)):
            self.time_ns += CYCLE_NS
            self.height_m += self.control.velocity_m_s * CYCLE_NS * 1e-9
            self.stream.observe(self.time_ns, (0.0, 0.0, self.height_m), (0.0, 0.0, 0.0))
            self.stream.cycle(command)


@pytest.mark.parametrize('refusals', [0, 1, 3])
def test_a_zeroing_that_the_controller_did_not_take_is_tried_again_where_the_arm_stands(refusals):
    arm = Arm(refusals)
    arm.cycles(0.1, RISING)
    arm.cycles(1.0, None)
    assert (arm.stream.trusted, arm.control.zeroed) == (True, 1)
    assert arm.control.refusals == -1


def test_without_a_rise_nothing_is_zeroed_and_nothing_is_pressed():
    arm = Arm()
    arm.cycles(1.0, None)
    arm.cycles(1.0, RISING._replace(force_n=1.0))
    assert (arm.stream.trusted, arm.control.zeroed, arm.height_m) == (False, 0, 0.01)


class SteppedLink:
    """Worker process and controller of a UR, with its emulated robot, on a stepped clock; `sent` takes the commands."""

    def __init__(self, sent, **scene):
        self.now_ns, self.wish, self.sent = 1_000_000_000, None, sent
        self.robot = ur.EmulatedRobot(ur.UrControllerParams(**scene), np.random.default_rng(20))
        watchdog = Watchdog(self, UrArmParams(), lambda _seconds: None, lambda: self.now_ns * 1e-9)
        self.stream = UrCommandStream(self, UrArmParams(), watchdog)
        self.arm = UrArm()
        self.arm.connect = lambda: setattr(self.arm, '_link', self)

    @property
    def report(self):
        robot, stream = self.robot, self.stream
        measured = (tuple(vector[:3].tolist()) for vector in (robot.pose, robot.velocity, robot.force))
        return UrReport(self.now_ns, *measured, 0.1, 1, True, stream.trusted, stream.refused)

    def check(self):
        pass

    def send(self, command):
        self.wish = command

    def pace(self):
        for _ in range(5):
            self._step()
            if self.now_ns % 4_000_000 == 0:
                self.stream.observe(self.now_ns, self.report.position_m, self.report.force_n)
                self.stream.cycle(self.wish)

    def _step(self):
        self.now_ns += 2_000_000
        self.robot.step(0.002)

    def __getattr__(self, name):
        return lambda *given: self._obey(name, *given)  # as in ur-rtde

    def _obey(self, name, *given):
        shown, robot = list(given), self.robot
        if name == 'speedL':
            robot.motion, shown = ur.SpeedMove(np.array(given[0]), given[1]), [*given[0][:3], given[1]]
        elif name == 'forceMode':
            robot.force_mode = ur.ForceMode(np.eye(3), *(np.array(given[place]) for place in (1, 2, 4)))
            shown = [given[2][2], given[4][2]]
        elif name == 'zeroFtSensor':
            robot.zero_force()
        elif name in ('speedStop', 'forceModeStop'):
            if name == 'forceModeStop':
                robot.end_force_mode()
            robot.motion = ur.stop_move(*(given or [ur.FORCE_MODE_STOP]))
            while not robot.motion.done:
                self._step()
        self.sent.append([name, *shown])
        return True


def test_a_slide_commands_force_and_speed_by_turns_and_ends_with_the_finger_lifted():
    sent = []
    link = SteppedLink(sent)
    explorer = Explorer(link.arm, TouchParams(), SafetyLimits(), lambda _state: None, lambda: link.now_ns)
    request = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=2.0, distance_m=0.03)
    outcome = explorer._prepare('one', request).run(link.pace)
    assert outcome.success and outcome.lifted, outcome.message
    names = [name for name, *_ in sent]
    pressed = names[names.index('forceMode') : names.index('forceModeStop') - 1]
    assert pressed[::2] == ['forceMode'] * len(pressed[::2])
    assert pressed[1::2] == ['speedL'] * len(pressed[1::2])
    assert names.index('zeroFtSensor') < names.index('forceMode')
    assert link.robot.pressing_n == 0.0


def test_a_wall_in_the_slide_is_met_gently_and_left_again():
    link, limits, forces_n = SteppedLink([], wall_m=0.02, stop_force_n=1e5), SafetyLimits(), []
    explorer = Explorer(link.arm, TouchParams(), limits, lambda _state: None, lambda: link.now_ns)

    def pace():
        link.pace()
        forces_n.append(np.linalg.norm(link.robot.force))

    request = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=5.0, distance_m=0.06)
    outcome = explorer._prepare('one', request).run(pace)
    assert (outcome.success, outcome.lifted) == (False, True)
    assert 'along the surface' in outcome.message
    assert max(forces_n) < limits.force_limit_n + 20000.0 * 0.08 * 0.05  # 80 ms from the first contact to a standstill
    assert sum(force_n > limits.force_limit_n for force_n in forces_n) <= 10  # steps of 10 ms
    assert forces_n[-1] < 0.5


def test_an_arm_that_does_not_follow_in_the_slide_has_stalled():
    link = SteppedLink([])
    explorer = Explorer(link.arm, TouchParams(), SafetyLimits(), lambda _state: None, lambda: link.now_ns)

    def pace():
        link.pace()
        if link.arm.state().position[0] > 0.01:
            link.robot.speed_fraction = 0.15

    request = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=3.0, distance_m=0.04)
    outcome = explorer._prepare('one', request).run(pace)
    assert outcome.message.startswith('the finger stalled: in 250 ms it moved by')
    assert outcome.lifted


@pytest.mark.parametrize('where', ['before the wall', 'before the way back is sent'])
@pytest.mark.parametrize('paused_s', [0.15, 0.2, 0.3])
def test_an_explorer_that_was_paused_at_a_wall_leads_the_finger_back_from_it(paused_s, where):
    link = SteppedLink([], wall_m=0.02, stop_force_n=1e5)
    limits = SafetyLimits(state_timeout_s=1.0)
    explorer = Explorer(link.arm, TouchParams(), limits, lambda _state: None, lambda: link.now_ns)
    pauses, forces_n, send = [paused_s], [], link.send

    def pause(place):
        if place == where and pauses:  # the newest command holds meanwhile
            for _ in range(round(pauses.pop() / 0.01)):
                link.pace()

    def pace():
        link.pace()
        if link.arm.state().position[0] > 0.018:
            pause('before the wall')
        forces_n.append(np.linalg.norm(link.robot.force))

    def paused_send(data):
        if link.arm.state().force_size_n > limits.force_limit_n:
            pause('before the way back is sent')
        send(data)

    link.send = paused_send
    request = ExplorationRequest('linear_slide', speed_m_s=0.05, force_n=5.0, distance_m=0.06)
    outcome = explorer._prepare('one', request).run(pace)
    assert max(forces_n) > 100.0
    assert outcome.lifted, outcome.message
    assert forces_n[-1] < 0.5


def test_a_finger_that_turns_back_out_of_force_control_is_led_back_before_anything_is_waited_for():
    sent = []
    link = SteppedLink(sent)
    link.stream.trusted = True
    for command in [UrCommand(0, (0.05, 0.0, 0.0), 2.0)] * 3 + [UrCommand(0, (-0.05, 0.0, 0.02), None)] * 2:
        link.stream.cycle(command)
    names = [name for name, *_ in sent]
    back = next(place for place, (name, vx, *_) in enumerate(sent) if name == 'speedL' and vx < 0.0)
    assert sent[back] == ['speedL', -0.05, 0.0, 0.0, STOP_DECELERATION_M_S2]
    assert 'forceModeStop' not in names[:back]
    assert names[back + 1 :] == ['setWatchdog', 'forceModeStop', 'setWatchdog', 'speedL']


@pytest.mark.parametrize(
    ('command', 'refused'), [(None, 'speedStop'), (None, 'forceModeStop'), (RISING, 'forceModeStop')]
)
def test_an_end_of_force_control_that_the_controller_refuses_is_named_and_repeated(command, refused):
    arm, answers = Arm(), []
    arm.stream.trusted = True
    arm.cycles(0.1, RISING._replace(force_n=1.0))
    setattr(arm.control, refused, lambda *_: answers.append(len(answers) >= 2) or answers[-1])
    arm.cycles(0.1, command)
    assert answers == [False, False, True]
    assert arm.stream.refused == refused
    assert (arm.control.velocity_m_s > 0.0) == (command is RISING)


def test_a_force_that_the_controller_refuses_and_a_command_it_refused_are_warned_of():
    arm, link = Arm(), SteppedLink([])
    arm.stream.trusted = True
    arm.control.forceMode = lambda *_: False
    arm.cycles(0.1, RISING._replace(force_n=1.0))
    assert arm.stream.refused == 'forceMode'
    link.arm.connect()
    assert link.arm.warning() == ''
    link.stream.refused = 'forceMode'
    assert "refused 'forceMode', which is sent again until it is taken" in link.arm.warning()


def test_a_controller_that_is_silent_gets_no_commands_until_it_is_heard_again(monkeypatch):
    monkeypatch.setattr(ur_worker, 'set_alarm', lambda _seconds: None)
    receive = Mock(**{f'getActualTCP{name}.return_value': [0.0] * 6 for name in ('Pose', 'Speed', 'Force')})
    receive.configure_mock(**{'getSafetyMode.return_value': 1, 'getRuntimeState.return_value': 2})
    observer, stream = Observer(receive, Mock(), PARAMS), Mock(trusted=False, refused='')
    worker = SimpleNamespace(
        _control=Mock(),
        _observer=observer,
        _commands=stream,
        _watchdog=SimpleNamespace(moving_s=0.1),
        _stopped=False,
        _ur_command=RISING,
        _measured_ns=0,
    )

    def sent(stamp_s):
        receive.getTimestamp.return_value = stamp_s
        stream.cycle.reset_mock()
        observer._poll(0.02)
        Worker._cycle(worker)
        return stream.cycle.call_count

    assert sum(sent(7.0) for _ in range(20)) == 1 + round(SILENT_S / 0.02)
    worker._control.kickWatchdog.assert_not_called()  # it stops the arm meanwhile
    assert sent(7.1) == 1


# --------------------
# The watchdog waits while a command is carried out, and guards the moving arm again after it.

WATCHED = UrArmParams(watchdog_hz=10.0)


class TimedControl:
    """A controller in its own time, whose watchdog is tripped when it hears nothing for too long."""

    def __init__(self, late_s=0.002):
        self.now_s, self.late_s = 0.0, late_s
        self.period_s = None
        self.tripped = False

    def setWatchdog(self, frequency_hz):  # noqa: N802 (as in ur-rtde)
        self.take(self.late_s / 2)
        self.period_s = 1.0 / frequency_hz
        self.take(self.late_s / 2)
        return not self.tripped

    def take(self, seconds):
        self.now_s += seconds
        self.tripped |= self.period_s is not None and seconds > self.period_s
        return not self.tripped


def watchdog_of(control):
    return Watchdog(control, WATCHED, guard=lambda seconds: None, clock=lambda: control.now_s)


def test_a_slow_command_does_not_trip_it():
    control = TimedControl()
    watchdog = watchdog_of(control)
    assert watchdog.arm()
    assert control.period_s == pytest.approx(0.1)
    with watchdog.patient():
        assert watchdog.call(control.take, 0.3)
        assert not watchdog.armed
    assert watchdog.armed
    assert not control.tripped
    assert control.period_s == pytest.approx(0.1)


def test_a_controller_that_acknowledges_the_watchdog_itself_late_is_given_more_time():
    control = TimedControl(late_s=0.3)
    watchdog = watchdog_of(control)
    assert watchdog.arm()
    assert not control.tripped
    assert control.period_s == pytest.approx(0.9)
    assert watchdog.moving_s == pytest.approx(0.9)
    control.late_s = 0.002
    assert watchdog.arm()
    assert control.period_s == pytest.approx(0.1)
    assert watchdog.moving_s == pytest.approx(0.1)


def test_it_guards_again_also_after_an_error():
    control = TimedControl()
    watchdog = watchdog_of(control)
    with pytest.raises(RuntimeError), watchdog.patient():
        raise RuntimeError
    assert watchdog.armed


def test_a_program_that_no_longer_runs_is_not_guarded():
    control = TimedControl()
    control.tripped = True
    assert not watchdog_of(control).arm()


class MovingControl(TimedControl):
    """The same, which also takes what moves the arm."""

    def speedStop(self, _deceleration):  # noqa: N802
        return self.take(0.0)

    def forceModeStop(self):  # noqa: N802
        return self.take(0.0)

    def speedL(self, *_speed):  # noqa: N802
        return self.take(0.0)

    def kickWatchdog(self):  # noqa: N802
        return self.take(0.0)


def test_an_arm_at_rest_tries_again_to_have_the_watchdog_as_short_as_it_should_be():
    control = MovingControl(late_s=0.3)
    watchdog = watchdog_of(control)
    commands = UrCommandStream(control, WATCHED, watchdog)
    assert watchdog.arm()
    commands.cycle(UrCommand(0, (0.0, 0.0, -0.01), None))
    assert watchdog.moving_s == pytest.approx(0.9)
    for _ in range(3):
        commands.cycle(None)
    control.late_s = 0.002
    commands.cycle(UrCommand(0, (0.0, 0.0, -0.01), None))
    assert watchdog.moving_s == control.period_s == pytest.approx(0.1)


# --------------------
# What is said before a controller is reached.


def test_without_ur_rtde_the_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setattr(importlib.util, 'find_spec', lambda name: None)
    with pytest.raises(DeviceError, match=r'pip install ur-rtde==1\.6\.5'):
        UrArm().connect()


def test_an_arm_that_was_never_connected_says_so_and_a_cb3_that_it_only_estimates_forces():
    arm = UrArm()
    arm._series = ur_probe.CB3
    assert 'is a CB3, which estimates forces within about 10 N' in arm.warning()
    for call in (arm.state, arm.stop, lambda: arm.command(ArmCommand((0.02, 0.0)))):
        with pytest.raises(DeviceError, match='connect it first'):
            call()
    arm.close()


@pytest.mark.parametrize(
    ('answer', 'said'),
    [
        ('3.3.4.310 (Mar 29 2017)', r'has the software 3\.3.*update it to 3.12 or newer'),
        ('URSoftware 5.4.0.76974 (Jul 16 2019)', r'has the software 5\.4.*update it to 5.6 or newer'),
        ('URSoftware 1.8.16941', r'has the software 1\.8.*update it to 3.12 or newer'),
        ('who are you?', 'when asked for its version'),
    ],
)
def test_a_controller_that_is_too_old_or_does_not_say_its_version_is_refused(answer, said):
    with pytest.raises(DeviceError, match=said):
        ur_probe._checked_version('127.0.0.82', answer)
    assert ur_probe._checked_version('127.0.0.82', '3.15.8.106339') == (3, 15)

# SPDX-License-Identifier: Apache-2.0
"""What is sent to the UR controller, cycle by cycle, on a controller that is made up."""

import numpy as np
import pytest

from texture_core.types import ExplorationRequest
from texture_exploration.arms.ur import COMMAND, Counts, UrArm, UrArmParams, UrCommand, UrReport
from texture_exploration.arms.ur_worker import UrCommandStream, Watchdog
from texture_exploration.explorer import Explorer
from texture_exploration.safety import SafetyLimits
from texture_exploration.stages import TouchParams
from texture_simulation.devices import ur

PARAMS = UrArmParams(surface_x_m=0.0, surface_z_m=0.0)
CYCLE_NS = 4_000_000
RISING = UrCommand(0, (0.0, 0.0, 0.05), None)


class Control:
    """Takes whatever comes, but refuses to zero the force sensor so many times; moves as it is told."""

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
    assert (arm.stream.trusted, arm.stream.zeroings, arm.control.zeroed) == (True, 1, 1)
    assert arm.stream.refused == refusals


def test_without_a_rise_nothing_is_zeroed():
    arm = Arm()
    arm.cycles(1.0, None)
    assert (arm.stream.trusted, arm.control.zeroed) == (False, 0)


class SteppedLink:
    """Worker process and controller of a UR, with its emulated robot, on a stepped clock; `sent` takes the commands."""

    def __init__(self, sent):
        self.now_ns, self.wish, self.sent = 1_000_000_000, None, sent
        self.robot = ur.EmulatedRobot(ur.UrControllerParams(), np.random.default_rng(20))
        watchdog = Watchdog(self, UrArmParams(), lambda _seconds: None, lambda: self.now_ns * 1e-9)
        self.stream = UrCommandStream(self, UrArmParams(), watchdog)
        self.arm = UrArm()
        self.arm.connect = lambda: setattr(self.arm, '_link', self)

    @property
    def report(self):
        robot, stream = self.robot, self.stream
        measured = (tuple(vector[:3].tolist()) for vector in (robot.pose, robot.velocity, robot.force))
        return UrReport(self.now_ns, *measured, 0.1, 1, True, False, stream.unsteady, stream.trusted, Counts())

    def check(self):
        pass

    def send(self, data):
        self.wish = UrCommand.from_bytes(data) if data[:1] == COMMAND else None

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
            robot.motion = ur.StopMove(*(given or [ur.FORCE_MODE_STOP]))
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

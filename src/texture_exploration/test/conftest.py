# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""A table to explore on: time, arm and surface stepped by hand, so that every run is the same."""

import importlib.util
import sys
import threading
from pathlib import Path

import pytest

from texture_core.types import ExplorationRequest
from texture_exploration.exploration import Exploration, no_signal_watch
from texture_exploration.explorer import Explorer
from texture_exploration.motions import MOTIONS
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams
from texture_simulation.devices.twist_controller import TwistControllerParams

sys.path.append(str(Path(__file__).parent))  # where tests find the robots
from table_arm import PLANE, TableArm, TableArmParams
from twist_robot import Robot

# The pure tests run where there is no ROS.
ROS_TESTS = [
    'test_explorer_node.py',
    'test_ros_controllers_hand_over.py',
    'test_ros_controllers_process.py',
    'test_services_page.py',
]
collect_ignore = [] if importlib.util.find_spec('rclpy') else ROS_TESTS

ARM_STEP_NS = 5_000_000
ARM, TOUCH, LIMITS = TableArmParams(), TouchParams(), SafetyLimits()
LINEAR = ExplorationRequest('linear_slide')


class Table:
    """An arm over a surface, and what the exploration on it reported."""

    def __init__(self, arm=ARM, touch=TOUCH, limits=LIMITS, shape=PLANE):
        self.now_ns = 1_000_000_000
        self.arm = TableArm(arm, lambda: self.now_ns, shape)
        self.arm.connect()
        self.home = self.arm.state().position
        self.touch, self.limits = touch, limits
        self.states, self.places = [], []
        self.exploration = None
        self.asleep_ns = 0
        self.late_ns = 0  # delay of the states of the arm
        self.signal_fault = no_signal_watch
        self.when = {}  # what to do at the third state of a phase
        self.at_each_step = lambda: None
        self.pressed = []  # time, ns, and true force, N, of each step

    def sleep(self):
        """Let the whole machine sleep: time goes on, arm and exploration do not."""
        self.asleep_ns = 400_000_000

    def pace(self):
        if self.asleep_ns:
            self.now_ns, self.asleep_ns = self.now_ns + self.asleep_ns, 0
        else:
            for _ in range(2):
                self.now_ns += ARM_STEP_NS
                self.arm.step(ARM_STEP_NS * 1e-9)
        self.pressed.append((self.now_ns, self.arm.true_force_n))
        self.at_each_step()

    @property
    def largest_n(self):
        """The largest true force."""
        return max(force_n for _, force_n in self.pressed)

    def explore(self, request=LINEAR):
        motion = MOTIONS[request.motion](request, self.home, self.touch, self.limits)
        self.exploration = Exploration(
            'one',
            request,
            arm=self.arm,
            motion=motion,
            limits=self.limits,
            clock=lambda: self.now_ns + self.late_ns,
            on_state=self.on_state,
            signal_fault=self.signal_fault,
        )
        return self.exploration.run(self.pace)

    def on_state(self, state):
        self.states.append(state)
        self.places.append(self.arm.state().position)
        if [old.phase for old in self.states[-3:]] == [state.phase] * 3:
            self.when.pop(state.phase, lambda: None)()

    @property
    def phases(self):
        """The phases in their order, each once per stay."""
        seen = [state.phase for state in self.states]
        return [phase for before, phase in zip([None, *seen], seen, strict=False) if phase is not before]

    def first(self, phase):
        """Return the first state of a phase and where the finger was."""
        at = [state.phase for state in self.states].index(phase)
        return self.states[at], self.places[at]


@pytest.fixture
def make_robot():
    """Return a function that makes a connected arm behind an emulated velocity controller."""

    def make(emulated=None, **given):
        emulated = {'start_height_m': 0.003, 'force_noise_n': 0.002, 'jitter_s': 0.0, **(emulated or {})}
        return Robot(TwistControllerParams(**emulated), **given).connect()

    return make


@pytest.fixture
def explorer(monkeypatch):
    """Return an explorer over a table: a real thread on simulated time, which rests while `table.gate` is shut."""
    table = Table(TableArmParams(start_height_m=0.002))
    table.gate = threading.Event()
    table.gate.set()

    def pace():
        assert table.gate.wait(60.0)
        table.pace()

    monkeypatch.setattr('texture_exploration.explorer.Pacer', lambda *_: pace)

    def signal_fault(listening):
        return table.signal_fault(listening)  # of the test

    made = Explorer(table.arm, TOUCH, LIMITS, table.on_state, clock=lambda: table.now_ns, signal_fault=signal_fault)
    made.table = table
    made.connect()
    yield made
    table.gate.set()
    made.close()


@pytest.fixture
def make_table():
    """Return the class of tables."""
    return Table


@pytest.fixture
def table():
    """Return a table with all defaults."""
    return Table()

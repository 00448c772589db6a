# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The topics of an emulated arm behind a velocity controller, and the clock: all stepped by hand."""

import numpy as np

from texture_core.types import Phase
from texture_exploration.arms.arm import ArmCommand
from texture_exploration.arms.ros_controllers import RosControllersArm
from texture_exploration.arms.tool_state import ForceSample, PoseSample, RosControllersParams
from texture_exploration.exploration import Exploration
from texture_exploration.explorer import Explorer
from texture_exploration.motions import MOTIONS
from texture_exploration.safety import SafetyLimits
from texture_exploration.touch import TouchParams
from texture_simulation.devices.twist_controller import TOOL_DOWN, EmulatedTwistArm, TwistControllerParams

PERIOD_NS = 4_000_000
EXPLORER_PERIODS = 2  # of the arm, in one of the explorer
NO_NOISE = TwistControllerParams(force_noise_n=0.0, jitter_s=0.0)
TOUCH = TouchParams()
LIMITS = SafetyLimits(approach_timeout_s=30.0)  # a late arm comes down slowly on what may be stiff


class Robot:
    """The arm, the machine at the other end of its topics, and what was sent to it."""

    def __init__(self, emulated=NO_NOISE, **given):
        self.now_ns = 1_000_000_000
        self.machine = EmulatedTwistArm(emulated, self.now_ns)
        self.frames = ('base', 'tool0_controller')
        self.pose_comes = self.force_comes = True
        self.late_s, self.clock_ahead_s, self.stamps_are_honest = 0.0, 0.0, True  # of the force; of this machine
        self.readings = []
        self.heard_by = 1
        self.unsafe_because = ''
        self.sent = []  # velocities with their times
        self.pressed_n = []  # the true force, in any direction
        self.closed = False
        self.phases, self.forces = [], {}  # of the exploration; the true normal force by phase
        self.arm = RosControllersArm(
            RosControllersParams(**given),
            clock=lambda: self.now_ns,
            open_topics=lambda _params: self,
            own_thread=False,
        )

    def newest_pose(self):
        x, y, z = self.machine.position.tolist()
        return PoseSample(self.now_ns, self.frames[0], (x, y, z), TOOL_DOWN) if self.pose_comes else None

    def measure(self):
        self.readings.append((self.now_ns, self.machine.reading_n().tolist()))

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
        past = [(self.now_ns - n * PERIOD_NS, self.machine.reading_n().tolist()) for n in range(count, 0, -1)]
        self.readings = past

    def listeners(self):
        return self.heard_by

    def unsafe(self):
        return self.unsafe_because

    def beat(self, *, moving):
        pass

    def send_velocity(self, velocity_m_s):
        self.sent.append((self.now_ns, velocity_m_s))
        self.machine.command(self.now_ns, np.array(velocity_m_s))

    def close(self):
        self.closed = True

    def pass_time(self, time_s, command=None):
        """Let time pass; the command is given again in each period of the explorer."""
        for period in range(round(time_s * 1e9 / PERIOD_NS)):
            if command is not None and period % EXPLORER_PERIODS == 0:
                self.arm.command(command)
            self.now_ns += PERIOD_NS
            self.machine.advance(self.now_ns)
            self.pressed_n.append(float(np.linalg.norm(self.machine.force_n)))
            self.arm.step()

    def connect(self):
        """Connect, and come to rest, as every connection begins."""
        self.arm.connect()
        self.pass_time(0.25)
        return self

    @property
    def is_commanded_to_rest(self):
        return not any(self.sent[-1][1])

    def zero_force(self):
        """Rise in free air and rest: then the force sensor is zeroed."""
        self.pass_time(0.3, ArmCommand(normal_m_s=0.02))
        self.pass_time(0.4, ArmCommand())
        assert self.arm.zeroed

    def explore(self, request, on_state=None, *, touch=TOUCH, limits=LIMITS, home=None, on_slide=None):
        motion = MOTIONS[request.motion](request, home or self.arm.state().position, touch, limits)

        def note(state):
            self.phases.append(state.phase)
            self.forces.setdefault(state.phase.value, []).append(self.machine.finger().force_n)
            if on_slide and state.phase is Phase.SLIDE:
                on_slide()
            if on_state:
                on_state(state)

        self.exploration = Exploration(
            'one',
            request,
            arm=self.arm,
            motion=motion.lift_first(lambda: self.arm.zeroed),
            limits=limits,
            clock=lambda: self.now_ns,
            on_state=note,
        )
        outcome = self.exploration.run(lambda: self.pass_time(0.01))
        self.pass_time(0.5)
        return outcome

    def explorer(self):
        return Explorer(self.arm, TOUCH, LIMITS, lambda state: None, clock=lambda: self.now_ns)

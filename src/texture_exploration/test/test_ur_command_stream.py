"""What is sent to the UR controller, cycle by cycle, on a controller that is made up."""

import pytest

from texture_exploration.arms.ur import UrArmParams, UrCommand
from texture_exploration.arms.ur_worker import UrCommandStream, Watchdog

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

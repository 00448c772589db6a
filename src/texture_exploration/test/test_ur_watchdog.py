# SPDX-License-Identifier: Apache-2.0
"""The watchdog of the UR controller waits while a command is carried out, and guards the moving arm again after it."""

import pytest

from texture_exploration.arms.ur import UrArmParams, UrCommand
from texture_exploration.arms.ur_worker import UrCommandStream, Watchdog

PARAMS = UrArmParams(watchdog_hz=10.0, acknowledge_s=1.0)


class Control:
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
    return Watchdog(control, PARAMS, guard=lambda seconds: None, clock=lambda: control.now_s)


def test_a_slow_command_does_not_trip_it_and_is_counted():
    control = Control()
    watchdog = watchdog_of(control)
    assert watchdog.arm()
    assert control.period_s == pytest.approx(0.1)
    with watchdog.patient():
        assert watchdog.call(control.take, 0.3)
        assert not watchdog.armed
    assert watchdog.armed
    assert not control.tripped
    assert control.period_s == pytest.approx(0.1)
    assert (watchdog.slow, watchdog.slowest_s) == (1, pytest.approx(0.3))


def test_a_controller_that_acknowledges_the_watchdog_itself_late_is_given_more_time():
    control = Control(late_s=0.3)
    watchdog = watchdog_of(control)
    assert watchdog.arm()
    assert not control.tripped
    assert control.period_s == pytest.approx(0.9)
    assert (watchdog.moving_s, watchdog.widened) == (pytest.approx(0.9), True)
    control.late_s = 0.002
    assert watchdog.arm()
    assert control.period_s == pytest.approx(0.1)
    assert (watchdog.moving_s, watchdog.widened) == (pytest.approx(0.1), False)


def test_it_guards_again_also_after_an_error():
    control = Control()
    watchdog = watchdog_of(control)
    with pytest.raises(RuntimeError), watchdog.patient():
        raise RuntimeError
    assert watchdog.armed


def test_a_program_that_no_longer_runs_is_not_guarded():
    control = Control()
    control.tripped = True
    assert not watchdog_of(control).arm()


class MovingControl(Control):
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
    commands = UrCommandStream(control, PARAMS, watchdog)
    assert watchdog.arm()
    commands.cycle(UrCommand(0, (0.0, 0.0, -0.01), None))
    assert watchdog.moving_s == pytest.approx(0.9)
    for _ in range(3):
        commands.cycle(None)
    control.late_s = 0.002
    commands.cycle(UrCommand(0, (0.0, 0.0, -0.01), None))
    assert watchdog.moving_s == control.period_s == pytest.approx(0.1)

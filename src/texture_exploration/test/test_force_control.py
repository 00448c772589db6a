# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The force loop alone."""

import pytest

from texture_core.errors import InvalidParameter
from texture_exploration.arms.arm import ArmCommand, ArmState
from texture_exploration.force_control import ForceController, ForceLoop, ForceLoopParams

PERIOD_S = 0.004


def test_a_limited_speed_does_not_wind_up():
    controller = ForceController(0.01, integral_s=0.1, max_speed_m_s=0.02)
    for _ in range(1000):
        assert controller.update(10.0, PERIOD_S) == -0.02
    assert controller.update(-0.1, PERIOD_S) > 0.0


def test_what_is_too_stiff_and_too_late_to_be_touched_gently_is_refused():
    params = ForceLoopParams(loop_delay_s=0.1, max_stiffness_n_m=200000.0)
    with pytest.raises(InvalidParameter, match=r'allows an approach at 0\.0069 mm/s, and 0\.05 mm/s are needed'):
        ForceLoop(params, PERIOD_S)


def press(loop, time_s, force_n):
    state = ArmState(round((1.0 + time_s) * 1e9), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), force_n)
    loop.velocity(ArmCommand(force_n=1.0), state, PERIOD_S)


def stood(force_n, steps=60, **given):
    """Return the doubt after the first touch, of a finger that is to stand; `force_n` over the time in s."""
    loop = ForceLoop(ForceLoopParams(**{'loop_delay_s': 0.008, **given}), PERIOD_S)
    for step in range(steps):
        press(loop, step * PERIOD_S, force_n(step * PERIOD_S))
    return loop.doubt


def test_a_force_that_stands_as_the_finger_does_is_not_doubted():
    assert stood(lambda s: 0.1) == ''


@pytest.mark.parametrize('pause_s', [0.1, 0.18, 0.5])
def test_a_pause_of_this_machine_after_the_touch_makes_no_force_late(pause_s):
    """The arm stood meanwhile: what rises until 'loop_delay_s' after the touch is no lateness."""
    assert stood(lambda s: 0.05 if s < 0.008 else 0.17, steps=1) == ''
    loop = ForceLoop(ForceLoopParams(loop_delay_s=0.008), PERIOD_S)
    times_s = [0.0, *(pause_s + step * PERIOD_S for step in range(60))]
    for time_s in times_s:
        press(loop, time_s, 0.05 if time_s < 0.008 else 0.17)
    assert loop.doubt == ''


def test_a_force_that_goes_on_to_rise_is_named():
    assert stood(lambda s: 0.03 + s).startswith('the force continued to rise by 0.05 N while the finger was at rest')


def test_a_harder_touch_than_the_declared_contact_allows_is_named():
    expected = 'the force rose by 0.45 N after the first touch, and 0.33 N are the most to expect'
    assert stood(lambda s: 0.05 if s < 0.008 else 0.5).startswith(expected)

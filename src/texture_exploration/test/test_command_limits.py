# SPDX-FileCopyrightText: 2026 Tactile Texture maintainers
# SPDX-License-Identifier: Apache-2.0
"""The limits of a single command, which hold for whoever commands an arm."""

import math

import pytest

from texture_core.errors import CommandRefused
from texture_exploration.arms.arm import ArmCommand, check_command

REFUSED = {
    'speed that is not a number': ArmCommand(tangential_m_s=(math.nan, 0.0)),
    'endless speed': ArmCommand(tangential_m_s=(0.0, -math.inf)),
    'fast': ArmCommand(tangential_m_s=(5.0, 0.0)),
    'fast by both axes together': ArmCommand(tangential_m_s=(0.8, 0.8)),
    'fast away': ArmCommand(normal_m_s=5.0),
    'fast towards the surface': ArmCommand(normal_m_s=-5.0),
    'normal speed that is not a number': ArmCommand(normal_m_s=math.nan),
    'hidden by a force': ArmCommand(normal_m_s=math.nan, force_n=1.0),
    'force that is not a number': ArmCommand(force_n=math.nan),
    'endless force': ArmCommand(force_n=math.inf),
    'negative force': ArmCommand(force_n=-1.0),
    'hard': ArmCommand(force_n=60.0),
}


@pytest.mark.parametrize('name', REFUSED)
def test_a_command_out_of_range_is_refused_after_the_arm_was_stopped(name):
    stops = []
    with pytest.raises(CommandRefused, match=r'the arm stopped: the .* is \S+ (m/s|N); allowed is \S+ to \S+ (m/s|N)$'):
        check_command(REFUSED[name], lambda: stops.append('stop'))
    assert stops == ['stop']


@pytest.mark.parametrize(
    'command',
    [
        ArmCommand(),
        ArmCommand(tangential_m_s=(0.6, 0.8)),
        ArmCommand(normal_m_s=-0.5),
        ArmCommand((0.25, 0.0), force_n=50.0),
        ArmCommand(force_n=0.0),
    ],
)
def test_a_command_within_the_limits_passes_and_stops_nothing(command):
    check_command(command, lambda: pytest.fail('the arm was stopped'))
